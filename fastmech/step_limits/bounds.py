"""Bounds on the eigenvalues of small motion where many trajectories are, in one compiled pass over lanes."""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.jit import MATRIX, VECTOR, kernel
from fastmech.kernels.passes import LANES, ROWS, STATES, fill_trigonometry, load, load_own
from fastmech.stability.linearize import polynomial, small_motion_at
from fastmech.step_limits.local import bound_of

Floats = NDArray[np.float64]


@kernel(types.void(STATES, MATRIX, VECTOR))
def eigenvalue_bounds(states: Floats, own: Floats, bound: Floats) -> None:
    """:func:`fastmech.step_limits.local.bound_of` small motion in configurations of states (n, 4), into (n,).

    ``own`` are the :func:`fastmech.kernels.passes.columns` of the coefficients.
    """
    Y, p = np.empty((ROWS, LANES)), np.empty((own.shape[0], LANES))
    told = np.empty(LANES)
    for first in range(0, states.shape[0], LANES):
        load(states, first, Y, 0)
        fill_trigonometry(Y)
        load_own(own, first, p)
        for i in range(LANES):
            motion = small_motion_at(
                Y[4, i], Y[5, i], Y[6, i], Y[7, i],
                p[0, i], p[1, i], p[2, i], p[3, i], p[4, i], p[5, i], p[6, i],
            )  # fmt: skip
            p3, p2, _, p0 = polynomial(motion)
            told[i] = bound_of(p3, p2, p0)
        for i in range(min(LANES, states.shape[0] - first)):
            bound[first + i] = told[i]
