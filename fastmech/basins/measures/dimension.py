"""Dimension of the boundaries on a map, by boxes of rising size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from fastmech.arrays import Floats, Integers
from fastmech.basins.measures.labels import LabelsLike, check_map, too_thin
from fastmech.basins.measures.slopes import PARTS, half_width, is_smooth, line, part_of
from fastmech.errors import InputError


@dataclass(frozen=True)
class BoundaryDimension:
    """Boxes that hold more than one label, over their size, and the power law."""

    edge: Integers  #: edges of the boxes [steps of the grid] (sizes,)
    mixed: Floats  #: share of the boxes' places with more than one label (sizes,)
    dimension: float  #: NaN: no boundary
    error: float  #: half width of its interval, of 95 % or more
    local_dimensions: Floats  #: between neighbouring sizes (sizes - 1,)
    local_errors: Floats  #: half widths of their 95 % intervals by parts of the map (sizes - 1,)

    codimension: float  #: the map's dimension less that of the boundary: the uncertainty exponent
    thin: str  #: why the map is too coarse for its basins, one line; empty: it is not

    @property
    def mixed_powers(self) -> Floats:
        """Powers of the edge with which the share grows between neighbouring sizes (sizes - 1,)."""
        return np.asarray(self.dimension + self.codimension - self.local_dimensions)

    @property
    def smooth(self) -> bool | None:
        """Whether the dimension of a smooth boundary, one less than the map's, lies within the error bar.

        None: the error bar is too wide to tell, there is no boundary, one is in most of the finest boxes, or
        no more than ``thin`` speaks against it.
        """
        smooth = None if self.mixed[0] > 0.5 else is_smooth(self.codimension, self.error)
        return None if self.thin and not smooth else smooth


def boundary_dimension(labels: LabelsLike, edges: ArrayLike | None = None) -> BoundaryDimension:
    """Box-counting dimension d of the boundaries on a map.

    A box of edge e (in steps of the grid, so e + 1 points an axis) is mixed if it holds two different labels.
    Of the boxes round all points of the map the share p(e) ~ e^(D - d) is mixed: box counting with every
    offset of the boxes instead of one. At the map's edge the map is mirrored, lest boundaries in its middle
    count for more. Missing labels are passed over: a box is judged by those it has.

    The exponent is a least-squares line through log p over log e. Its error bar joins the scatter between
    parts of the map (each of 5 parts along every axis left out in turn, the jackknife) and the largest
    difference between local dimensions, continued at both ends by half of their last change, and that of
    boxes judged by their corners: coarse boxes hold more than one smooth boundary, and fine ones miss
    structure of a fractal between the points of the map, so that the true dimension may be at either end.
    Corners miss as much at every size: a curve rougher than the map's points differs there, a smooth one
    does not. The dimension is that of the scales at hand: of stripes whose spacing shrinks geometrically, as
    beside a saddle, it falls towards that of one line as boxes shrink, but slowly; stripes of sin(1/x) have
    1.5 at all scales, though each is smooth.

    Args:
        labels: on a grid of any number of axes, with equal steps in one metric; negative: no label.
        edges: of the boxes, rising; 1, 2, 4, ... up to a sixteenth of the shortest axis, at least 8, by
            default.

    Raises:
        InputError: the labels are no map, or the edges do not rise or are too large for it.
    """
    array = check_map(labels)
    shortest = min(array.shape)
    given = 2 ** np.arange(max(int(np.log2(shortest / 16)), 3) + 1) if edges is None else np.asarray(edges)
    if given.ndim != 1 or given.size < 3 or not np.issubdtype(given.dtype, np.integer):
        raise InputError("edges: must be three or more integers")
    if edges is None and shortest < 32:
        raise InputError(f"labels: has shape {array.shape}; without edges, 32 points an axis are needed")
    if given[0] < 1 or (np.diff(given) < 1).any() or given[-1] > shortest // 4:
        raise InputError(f"edges: must rise from 1 or more to at most a quarter of {shortest} points")
    counts = np.array([_count(array, int(edge)) for edge in given])
    mixed, places = counts[:, 0], counts[:, 1]
    x, share = np.log(given), mixed.sum(axis=1) / places.sum(axis=1)
    rest = places.sum(axis=1, keepdims=True) - places
    without = _log((mixed.sum(axis=1, keepdims=True) - mixed) / rest)
    weight = np.ones_like(x)
    slope, local = line(x, _log(share), weight)[0], np.diff(_log(share)) / np.diff(x)
    beyond = 1.5 * local[[0, -1]] - 0.5 * local[[1, -2]]
    corners = line(x, _log(np.array([_mixed_corners(array, int(edge)) for edge in given])), weight)[0]
    error = np.hypot(half_width(line(x, without, weight)[0]), np.ptp([*local, *beyond, corners]))
    return BoundaryDimension(
        edge=given.astype(np.int64),
        mixed=share,
        dimension=float(array.ndim - slope),
        error=float(error),
        local_dimensions=array.ndim - local,
        local_errors=np.array([half_width(part) for part in np.diff(without, axis=0) / np.diff(x)[:, None]]),
        codimension=float(slope),
        thin=too_thin(array),
    )


def _count(labels: Integers, edge: int) -> Floats:
    """Places of a box with two labels, and with any, by part of the map; shape (2, parts)."""
    part = part_of(np.indices(labels.shape, sparse=True), labels.shape)
    kinds = _mixed(labels, np.ones((edge + 1,) * labels.ndim, dtype=bool))
    return np.array([np.bincount(part[kind], minlength=PARTS**labels.ndim) for kind in kinds], np.float64)


def _mixed_corners(labels: Integers, edge: int) -> float:
    """Share of the boxes whose corners have two labels."""
    corners = np.zeros((edge + 1,) * labels.ndim, dtype=bool)
    corners[(slice(None, None, edge),) * labels.ndim] = True
    mixed, known = _mixed(labels, corners)
    return float(mixed.sum() / known.sum())


def _mixed(labels: Integers, box: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether the points of a box round each point of the map have two labels, and whether any."""
    highest = maximum_filter(np.maximum(labels, -1), footprint=box, mode="mirror")
    lowest = minimum_filter(np.where(labels < 0, labels.max() + 1, labels), footprint=box, mode="mirror")
    known = highest >= 0
    return known & (lowest < highest), known


def _log(share: Floats) -> Floats:
    """Logarithm, NaN where there is nothing."""
    return np.log(np.where(share > 0.0, share, np.nan))
