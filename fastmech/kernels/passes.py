"""Passes over many trajectories: what every lane of them is given, in whole vectors.

A pass goes through :data:`LANES` trajectories at a time, the last time through copies of the last one too:
loops that always have that length are packed instructions for all of them, so a trajectory's numbers depend
neither on its place nor on its companions.
"""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.jit import inlined
from fastmech.kernels.sincos import REDUCTION_LIMIT, sincos
from fastmech.mechanism.coefficients import Coefficients

Floats = NDArray[np.float64]

#: States (n, 4), which a user may have locked.
STATES = types.Array(types.float64, 2, "C", readonly=True)

#: Trajectories that are in the caches together; whole vectors of any processor.
LANES = 64

#: Rows of what is known of a lane: its state, then sine and cosine of phi, sine and cosine of theta.
ROWS = 8


def columns(c: Coefficients, members: slice) -> Floats:
    """Coefficients of some trajectories as passes are given them, shape (8, n); (8, 1) where all share."""
    values = [np.asarray(value) for value in c]
    own = [value for value in values if value.ndim and value.strides[0]]
    if own:
        rows = np.empty((len(values), own[0][members].size))
        for row, value in zip(rows, values, strict=True):
            row[:] = value[members] if value.ndim else value
        return rows
    return np.array([value.flat[0] for value in values], dtype=np.float64)[:, None]


@inlined
def load(states: Floats, first: int, Y: Floats, place: int) -> None:
    """Put states from ``first`` on into ``Y`` from ``place`` on; what is left over holds the last one."""
    for i in range(LANES):
        row = min(first + i, states.shape[0] - 1)
        for d in range(4):
            Y[d, place + i] = states[row, d]


@inlined
def fill_trigonometry(Y: Floats) -> None:
    """Sines and cosines of lanes, into their rows of ``Y`` (ROWS, lanes)."""
    for angle in range(2):
        beyond = 0
        for i in range(Y.shape[1]):
            beyond |= abs(Y[angle, i]) > REDUCTION_LIMIT
            Y[4 + 2 * angle, i], Y[5 + 2 * angle, i] = sincos(Y[angle, i])
        if beyond:
            for i in range(Y.shape[1]):
                if abs(Y[angle, i]) > REDUCTION_LIMIT:
                    Y[4 + 2 * angle, i], Y[5 + 2 * angle, i] = np.sin(Y[angle, i]), np.cos(Y[angle, i])


@inlined
def load_own(own: Floats, first: int, p: Floats) -> None:
    """Put the coefficients of lanes from ``first`` on into ``p`` (8, LANES)."""
    last = own.shape[1] - 1
    if last or not first:
        for r in range(own.shape[0]):
            for i in range(LANES):
                p[r, i] = own[r, min(first + i, last)]
