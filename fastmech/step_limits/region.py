"""A method's growth a step over the half plane of motion that decays: bounds in a table, made once.

They tell of most modes, without the method's polynomials, that they are stable. The logarithm of a method's
amplification is subharmonic: a bound on the boundary of a part of the half plane is one within it (maximum
principle). Boundaries are sampled: rays, and the arcs between them by the rays on either side. What lies
between is left to the margin of those who use the table.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.integrators.method import Adams, Method
from fastmech.integrators.methods import find_method
from fastmech.step_limits.amplification import amplifies, principal_root, stability_function

Floats = NDArray[np.float64]

#: Sizes of h lambda in the table, each by a ratio greater than the one before.
LEAST, RATIO, SIZES = 1e-3, 1.06, 156

#: Sectors of directions, from the imaginary to the negative real axis: narrow where growth begins.
SECTORS = 32

#: By how much other roots of an Adams method may exceed the mode's own.
ROUNDED = 1e-12


class Region(NamedTuple):
    """Growth a step, logarithms."""

    sector: Floats  #: of sizes up to the one of a row in the sector of a column, (SIZES + 1, SECTORS)
    largest: Floats  #: of sizes up to the one of a row in any direction, (SIZES + 1,)


@cache
def region(method: str) -> Region:
    """The table of an explicit method; inf where no bound is known, and beyond the last size.

    A sector's growth is the greatest on its edges and its neighbours', at all sizes up to the row's.
    """
    formula = find_method(method)
    inward = (np.arange(SECTORS + 1.0) / SECTORS) ** 2
    directions = np.exp(1j * np.arctan2(1.0 - inward, -inward))
    growth = np.full((SIZES + 1, SECTORS + 1), np.inf)
    for first in range(0, SIZES, 32):
        rows = np.arange(first, min(first + 32, SIZES))
        growth[rows] = _growth(formula, np.multiply.outer(LEAST * RATIO**rows, directions))
        if (growth[rows[-1]] == np.inf).all():  # and what is larger counts as growing faster
            break
    growth = np.maximum.accumulate(growth, axis=0)
    padded = np.pad(growth, ((0, 0), (1, 1)), mode="edge")
    around = np.lib.stride_tricks.sliding_window_view(padded, 4, axis=1)
    return Region(around.max(axis=-1), growth.max(axis=1))


def _growth(method: Method, z: NDArray[np.complex128]) -> Floats:
    """Logarithm of the amplification from above, not less than 0; inf where other roots lead."""
    if not isinstance(method, Adams):
        return np.log(np.maximum(np.abs(stability_function(method, z)), 1.0))
    factor = np.maximum(np.abs(principal_root(method, z)), 1.0) * (1.0 + ROUNDED)
    grows = np.isnan(factor) | amplifies(method, z, np.where(np.isnan(factor), 1.0, factor))
    return np.where(grows, np.inf, np.log(factor))


def rows_of(sizes: Floats) -> NDArray[np.int64]:
    """The tables' rows for sizes of h lambda; the last for what is not a number."""
    with np.errstate(invalid="ignore", divide="ignore"):
        row = np.ceil(np.log(sizes * (1.0 / LEAST)) * (1.0 / np.log(RATIO)))
        return np.where(row < SIZES, np.maximum(row, 0.0), SIZES).astype(np.int64)


def sectors_of(real: Floats, imaginary: Floats) -> NDArray[np.int64]:
    """The tables' columns for modes whose real part is negative and whose imaginary part is not."""
    with np.errstate(invalid="ignore", divide="ignore"):
        inward = real / (real - imaginary)
        return np.minimum(SECTORS * np.sqrt(np.where(inward > 0.0, inward, 0.0)), SECTORS - 1).astype(
            np.int64
        )
