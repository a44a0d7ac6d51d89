"""Error bars of what is measured on one map: the map's parts left out in turn.

Neighbouring points of a map are no independent samples, its distant parts nearly are (Efron and Tibshirani,
An Introduction to the Bootstrap (1993), chapter 11).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t

from fastmech.basins.measures.labels import Floats, Integers

#: Parts of a map along every axis; odd, for many a map has a boundary in its middle.
PARTS = 5


def part_of(indices: Sequence[NDArray[np.int64]], shape: tuple[int, ...]) -> Integers:
    """Number of the part, below PARTS^axes, that points with these indices along every axis are in."""
    part = np.zeros(1, dtype=np.int64)
    for index, length in zip(indices, shape, strict=True):
        part = part * PARTS + index * PARTS // length
    return part


def half_width(without: Floats) -> float:
    """Half width of the 95 % interval from the values with each part left out (parts,)."""
    m = without.size
    spread = np.sqrt((m - 1) / m * np.sum((without - without.mean()) ** 2))
    return float(t.ppf(0.975, m - 1) * spread)
