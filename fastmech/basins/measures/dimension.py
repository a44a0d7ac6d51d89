"""Dimension of the boundaries on a map, by boxes of rising size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.stats import t

from fastmech.basins.measures.jackknife import PARTS, half_width, part_of
from fastmech.basins.measures.labels import Floats, Integers, check_map
from fastmech.errors import InputError


@dataclass(frozen=True)
class BoundaryDimension:
    """Boxes that hold more than one label, over their size, and the power law."""

    edge: Integers  #: edges of the boxes [steps of the grid] (sizes,)
    mixed: Floats  #: share of the boxes' places with more than one label (sizes,)
    dimension: float  #: NaN: no boundary
    error: float  #: half width of its 95 % interval
    local_dimensions: Floats  #: between neighbouring sizes (sizes - 1,)

    codimension: float  #: the map's dimension less that of the boundary: the uncertainty exponent

    @property
    def smooth(self) -> bool:
        """Whether the dimension of a smooth boundary, one less than the map's, lies within the error bar."""
        return bool(abs(self.codimension - 1.0) <= self.error + 1e-9)  # rounding


def boundary_dimension(labels: ArrayLike, edges: ArrayLike | None = None) -> BoundaryDimension:
    """Box-counting dimension d of the boundaries on a map.

    A box of edge e (in steps of the grid, so e + 1 points an axis) is mixed if it holds two different labels.
    Of the boxes round all points of the map the share p(e) ~ e^(D - d) is mixed: box counting with every
    offset of the boxes instead of one. At the map's edge the map is mirrored, lest boundaries in its middle
    count for more. Missing labels are passed over: a box is judged by those it has.

    The exponent is a least-squares line through log p over log e. Its error bar joins two parts: the scatter
    between parts of the map (each of 4 parts along every axis left out in turn, the jackknife) and that of
    the local slopes about the line. It does not know of structure finer than the map or the bias that all
    sizes share.

    Args:
        labels: on a grid of any number of axes, with equal steps in one metric; negative: no label.
        edges: of the boxes, rising; 1, 2, 4, ... up to a sixteenth of the shortest axis by default.

    Raises:
        InputError: the labels are no map, or the edges do not rise or are too large for it.
    """
    array = check_map(labels)
    shortest = min(array.shape)
    given = 2 ** np.arange(int(np.log2(max(shortest / 16, 1))) + 1) if edges is None else np.asarray(edges)
    if given.ndim != 1 or given.size < 2 or not np.issubdtype(given.dtype, np.integer):
        raise InputError("edges: must be two or more integers; a map needs 32 points an axis for its own")
    if given[0] < 1 or (np.diff(given) < 1).any() or given[-1] > shortest // 4:
        raise InputError(f"edges: must rise from 1 or more to at most a quarter of {shortest} points")
    counts = np.array([_count(array, int(edge)) for edge in given])
    mixed, places = counts[:, 0], counts[:, 1]
    x, share = np.log(given), mixed.sum(axis=1) / places.sum(axis=1)
    slope, scatter = _line(x, share[:, None])
    rest = places.sum(axis=1, keepdims=True) - places
    others, _ = _line(x, (mixed.sum(axis=1, keepdims=True) - mixed) / rest)
    error = np.hypot(half_width(others), scatter[0])
    return BoundaryDimension(
        edge=given.astype(np.int64),
        mixed=share,
        dimension=float(array.ndim - slope[0]),
        error=float(error),
        local_dimensions=array.ndim - np.diff(_log(share)) / np.diff(x),
        codimension=float(slope[0]),
    )


def _count(labels: Integers, edge: int) -> Floats:
    """Places of a box with two labels, and with any, by part of the map; shape (2, parts)."""
    highest = maximum_filter(np.maximum(labels, -1), size=edge + 1, mode="mirror")
    filled = np.where(labels < 0, labels.max() + 1, labels)
    lowest = minimum_filter(filled, size=edge + 1, mode="mirror")
    part = part_of(np.indices(labels.shape, sparse=True), labels.shape)
    known = highest >= 0
    kinds = (known & (lowest < highest), known)
    return np.array([np.bincount(part[kind], minlength=PARTS**labels.ndim) for kind in kinds], np.float64)


def _log(share: Floats) -> Floats:
    """Logarithm, NaN where there is nothing."""
    return np.log(np.where(share > 0.0, share, np.nan))


def _line(x: Floats, shares: Floats) -> tuple[Floats, Floats]:
    """Slopes of log shares (sizes, lines) over x, and half widths of their 95 % intervals by scatter."""
    y = _log(shares)
    away = (x - x.mean())[:, None]
    slope = (away * y).sum(axis=0) / (away**2).sum()
    if len(x) < 3:
        return slope, np.zeros_like(slope)
    rest = y - y.mean(axis=0) - slope * away
    free = len(x) - 2
    return slope, t.ppf(0.975, free) * np.sqrt((rest**2).sum(axis=0) / free / (away**2).sum())
