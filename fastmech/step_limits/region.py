"""A method's growth a step over the half plane of motion that decays: bounds in a table, made once.

They tell of most modes, without the method's polynomials, that they are stable. The logarithm of a method's
amplification is subharmonic: a bound on the boundary of a part of the half plane is one within it (maximum
principle). Boundaries are sampled: rays, and the arcs between them by the rays on either side. What lies
between is left to the margin of those who use the table.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.integrators.method import Adams, Method
from fastmech.integrators.methods import find_method
from fastmech.jit import inlined
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
    own: Floats  #: the same of the mode's own root, whatever an Adams method's others do
    largest: Floats  #: of sizes up to the one of a row in any direction, (SIZES + 1,)


@cache
def region(method: str) -> Region:
    """The table of an explicit method; inf where no bound is known, and beyond the last size.

    A sector's growth is the greatest on its edges and its neighbours', at all sizes up to the row's.
    """
    formula = find_method(method)
    inward = (np.arange(SECTORS + 1.0) / SECTORS) ** 2
    directions = np.exp(1j * np.arctan2(1.0 - inward, -inward))
    growth = np.full((2, SIZES + 1, SECTORS + 1), np.inf)
    for first in range(0, SIZES, 32):
        rows = np.arange(first, min(first + 32, SIZES))
        growth[:, rows] = _growth(formula, np.multiply.outer(LEAST * RATIO**rows, directions))
        if (growth[0, rows[-1]] == np.inf).all():  # and what is larger counts as growing faster
            break
    growth = np.maximum.accumulate(growth, axis=1)
    padded = np.pad(growth, ((0, 0), (0, 0), (1, 1)), mode="edge")
    around = np.lib.stride_tricks.sliding_window_view(padded, 4, axis=2).max(axis=-1)
    return Region(around[0], around[1], growth[0].max(axis=1))  # as kernels are given it


def _growth(method: Method, z: NDArray[np.complex128]) -> tuple[Floats, Floats]:
    """Logarithm of the amplification from above, not less than 0, inf where other roots lead; the mode's."""
    if not isinstance(method, Adams):
        growth = np.log(np.maximum(np.abs(stability_function(method, z)), 1.0))
        return growth, growth
    factor = np.maximum(np.abs(principal_root(method, z)), 1.0) * (1.0 + ROUNDED)
    factor = np.where(np.isnan(factor), np.inf, factor)
    own = np.log(factor)
    return np.where(amplifies(method, z, np.where(factor < np.inf, factor, 1.0)), np.inf, own), own


@inlined
def row_of(size: Any) -> Any:
    """The tables' row for a size of h lambda; the last for what is not a number."""
    row = np.ceil(np.log(size * (1.0 / LEAST)) * (1.0 / np.log(RATIO)))
    return np.fmax(np.fmin(row, 1.0 * SIZES), 0.0)


@inlined
def sector_of(real: Any, imaginary: Any) -> Any:
    """The tables' column for a mode whose real part is negative and whose imaginary part is not."""
    inward = np.fmax(real / (real - imaginary), 0.0)
    return np.fmin(np.floor(SECTORS * np.sqrt(inward)), SECTORS - 1.0)


def rows_of(sizes: Floats) -> NDArray[np.int64]:
    """The tables' rows for sizes of h lambda."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(row_of(sizes)).astype(np.int64)


def sectors_of(real: Floats, imaginary: Floats) -> NDArray[np.int64]:
    """The tables' columns for modes."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(sector_of(real, imaginary)).astype(np.int64)


def size_within(growth: Floats, most: float) -> float:
    """The largest size of h lambda up to which the rows' rising growth (SIZES + 1,) is at most ``most``."""
    rows = int(np.searchsorted(growth, most, side="right"))
    return LEAST * RATIO ** (rows - 1.0) if rows else 0.0
