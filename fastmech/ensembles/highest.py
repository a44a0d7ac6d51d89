"""The highest energies that trajectories can come to, in one compiled pass over lanes."""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.ensembles.energies import lane_energy, lane_work
from fastmech.jit import MATRIX, VECTOR, kernel
from fastmech.kernels.passes import LANES, ROWS, STATES, fill_trigonometry, load, load_own

Floats = NDArray[np.float64]


@kernel(types.void(STATES, MATRIX, VECTOR))
def highest_energies(start: Floats, own: Floats, energy: Floats) -> None:
    """T + U over m2 l^2 [1/s^2] of starts (n, 4), and the most that a decaying force can add to it.

    ``own`` are the :func:`fastmech.kernels.passes.columns` of the coefficients.
    """
    Y, p = np.empty((ROWS, LANES)), np.empty((own.shape[0], LANES))
    told = np.empty(LANES)
    for first in range(0, start.shape[0], LANES):
        load(start, first, Y, 0)
        fill_trigonometry(Y)
        load_own(own, first, p)
        for i in range(LANES):
            T, u = lane_energy(Y, i, p, i)
            told[i] = T + u + lane_work(Y, p, i)[0]
        for i in range(min(LANES, start.shape[0] - first)):
            energy[first + i] = told[i]
