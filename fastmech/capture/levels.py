"""Where states lie in the balls about places of an orbit, and in the tube about a cycle."""

from __future__ import annotations

import numpy as np
from numba import types

from fastmech.arrays import Floats, Integers
from fastmech.jit import CUBE, INTEGERS, MATRIX, VECTOR, inlined, kernel

#: Newton steps to the nearest phase of a cycle.
PROJECTIONS = 4


@inlined
def hermite(a: float, begin: float, end: float, slope: float, at_end: float) -> float:
    """The cubic between two values with these slopes, at a from 0 to 1."""
    b = 1.0 - a
    return b * b * ((1.0 + 2.0 * a) * begin + a * slope) + a * a * ((1.0 + 2.0 * b) * end - b * at_end)


@kernel(types.void(MATRIX, MATRIX, CUBE, MATRIX, VECTOR, INTEGERS, VECTOR))
def levels(
    states: Floats,
    places: Floats,
    forms: Floats,
    slopes: Floats,
    turning: Floats,
    found: Integers,
    level: Floats,
) -> None:
    """The place about which V is least for each state (n, dim), into ``found`` (n,), and V into ``level``.

    Beside a cycle's place, e is the distance from the cubic through its neighbours at the same phase.
    """
    dim, m = states.shape[1], places.shape[0]
    e = np.empty(dim)
    for i in range(states.shape[0]):
        found[i], level[i] = -1, np.inf
        for j in range(m):
            along = 0.0
            for d in range(dim):
                e[d] = states[i, d] - places[j, d]
                if turning[d]:
                    e[d] -= 2.0 * np.pi * np.rint(e[d] / (2.0 * np.pi))
                along += forms[j, dim, d] * e[d]
            if not abs(along) <= 0.75:
                continue
            if along != 0.0:
                sign = 1.0 if along > 0.0 else -1.0
                k = (j + 1) % m if along > 0.0 else (j + m - 1) % m
                a, correction = 0.0, abs(along)
                for _ in range(PROJECTIONS):
                    a += correction
                    correction = 0.0
                    for d in range(dim):
                        gone, away = places[k, d] - places[j, d], states[i, d] - places[j, d]
                        if turning[d]:
                            gone -= 2.0 * np.pi * np.rint(gone / (2.0 * np.pi))
                            away -= 2.0 * np.pi * np.rint(away / (2.0 * np.pi))
                        e[d] = away - hermite(a, 0.0, gone, sign * slopes[j, d], sign * slopes[k, d])
                        correction += sign * forms[j, dim, d] * e[d]
            size = 0.0
            for row in range(dim):
                part = 0.0
                for d in range(dim):
                    part += forms[j, row, d] * e[d]
                size += part * part
            if size < level[i]:
                found[i], level[i] = j, size
