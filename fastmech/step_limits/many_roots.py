"""Passes over many h lambda of one Adams method: which make errors grow, and what becomes of the mode."""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.jit import VECTOR, kernel
from fastmech.step_limits.circle import CHUNK, find_principal, mark_outside

Floats = NDArray[np.float64]

FLAGS = types.Array(types.boolean, 1, "C")


@kernel(types.void(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, FLAGS))
def tell_outside(
    real: Floats,
    imaginary: Floats,
    factor: Floats,
    predictor: Floats,
    corrector: Floats,
    outside: NDArray[np.bool_],
) -> None:
    """:func:`fastmech.step_limits.circle.mark_outside` of many modes (n,)."""
    work = np.empty((2, predictor.size + 2, CHUNK))
    zr, zi, f, told = np.empty(CHUNK), np.empty(CHUNK), np.empty(CHUNK), np.empty(CHUNK, dtype=np.bool_)
    for first in range(0, real.size, CHUNK):
        for i in range(CHUNK):
            k = min(first + i, real.size - 1)
            zr[i], zi[i], f[i] = real[k], imaginary[k], factor[k]
        mark_outside(zr, zi, f, predictor, corrector, work, told)
        for i in range(min(CHUNK, real.size - first)):
            outside[first + i] = told[i]


@kernel(types.void(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR))
def find_roots(
    real: Floats,
    imaginary: Floats,
    predictor: Floats,
    corrector: Floats,
    root_real: Floats,
    root_imaginary: Floats,
) -> None:
    """:func:`fastmech.step_limits.circle.find_principal` of many modes (n,)."""
    work = np.empty((2, predictor.size + 2, CHUNK))
    zr, zi, rr, ri = np.empty(CHUNK), np.empty(CHUNK), np.empty(CHUNK), np.empty(CHUNK)
    for first in range(0, real.size, CHUNK):
        for i in range(CHUNK):
            k = min(first + i, real.size - 1)
            zr[i], zi[i] = real[k], imaginary[k]
        find_principal(zr, zi, predictor, corrector, work, rr, ri)
        for i in range(min(CHUNK, real.size - first)):
            root_real[first + i], root_imaginary[first + i] = rr[i], ri[i]
