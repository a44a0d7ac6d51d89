"""Power laws of what is counted at several scales: dimension of boundaries and uncertainty exponent.

The error bar joins what counting leaves open to what the law itself does: few scales, a window that cuts
structure off, and the oscillation of a fractal that is similar to itself only at certain ratios make an
exponent depend on the scales that it is fitted to. Its measure is the largest difference between exponents
of parts of the scales.

A start is uncertain at eps if a start at the distance eps from it ends elsewhere. The share of uncertain
starts falls like f(eps) ~ eps^alpha, and the boundary's (box-counting) dimension is d = D - alpha in D
dimensions: alpha = 1 for a smooth boundary, less for a fractal one, where halving f takes 2^(1/alpha) times
the accuracy (Grebogi, McDonald, Ott, Yorke, Phys. Lett. A 99 (1983) 415, and Physica D 17 (1985) 125).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.stats import norm, t

from fastmech.arrays import Floats, Integers
from fastmech.basins.measures.labels import (
    LabelOf,
    LabelsLike,
    ask,
    check_map,
    check_point,
    numbered,
    too_thin,
)
from fastmech.ensembles import checks
from fastmech.errors import InputError
from fastmech.objects import Printed, counted

#: Half width above which an error bar round 1 does not tell a smooth boundary from a fractal one.
TELLING = 0.15

#: Standard errors by which the coarser half of the scales must rise less steeply to be thought bent.
BENT = 2.0

#: Standard errors beyond the finest scales' exponent that the error bar reaches.
BEYOND = 1.5


@dataclass(frozen=True, repr=False)
class PowerLaw(Printed):
    """f(scale) ~ scale^exponent. Slopes belong to neighbouring scales, the last two of which fix the last."""

    exponent: float  #: weighted least squares of log f over log scale; NaN: fewer than two scales with f > 0
    error: float  #: half width of the exponent's 95 % interval; inf: fewer than five scales
    local_slopes: Floats  #: between neighbouring scales (scales - 1,), NaN where f = 0
    local_errors: Floats  #: half widths of their 95 % intervals by counting alone (scales - 1,)
    fitted: NDArray[np.bool_]  #: scales that take part (scales,)


def is_smooth(exponent: float, error: float) -> bool | None:
    """Whether an uncertainty exponent is that of a smooth boundary, 1; None: the error bar is too wide."""
    if abs(exponent - 1.0) > error + 1e-9:  # rounding
        return False
    return True if error <= TELLING else None


def fit_counts(scales: Floats, hits: Integers, trials: Integers, fitted: NDArray[np.bool_]) -> PowerLaw:
    """Fit shares ``hits / trials`` of independent trials at rising ``scales``, all of shape (scales,).

    Scales that are not ``fitted`` have local slopes and take no part in the exponent.

    The logarithm of a share f has the variance (1 - f)/hits. Scatter about the line beyond that is added to
    every scale's variance (DerSimonian and Laird, Control. Clin. Trials 7 (1986) 177), so that coarse scales,
    where most is counted, do not outweigh the others where the law is not exact. To that error comes the
    largest difference between exponents of parts that span half of the scales or more, less its own noise.

    The exponent is a limit at fine scales. Where basins taper, the law bends towards it so slowly that coarse
    scales hide it: the coarsest is left out as long as the coarser half rises less steeply than the finer
    one by two standard errors (five scales stay); and the bar reaches to the finest part's exponent and one
    and a half of its standard errors beyond.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        y = np.log(hits / trials)
        # A share of 1 has no variance by that formula; one trial more or less would show.
        variance = np.maximum(1.0 - hits / trials, 1.0 / trials) / hits
        steps = np.diff(np.log(scales))
        local = np.diff(y) / steps
        local_errors = norm.ppf(0.975) * np.sqrt(variance[1:] + variance[:-1]) / steps
    local[~np.isfinite(local)] = np.nan
    local_errors[~np.isfinite(local_errors)] = np.nan
    fitted = fitted & (hits > 0)
    used = np.flatnonzero(fitted)
    while len(used) > 5:
        half = (len(used) + 1) // 2
        (fine, u), (coarse, v) = (
            line(np.log(scales[part]), y[part], 1.0 / variance[part]) for part in (used[:half], used[-half:])
        )
        if fine - coarse <= BENT * np.sqrt(u + v):
            break
        fitted[used[-1]], used = False, used[:-1]
    if len(used) < 2:
        return PowerLaw(np.nan, np.nan, local, local_errors, fitted)
    x, y, variance = np.log(scales[used]), y[used], variance[used]
    weight, free = 1.0 / variance, len(x) - 2
    exponent, of_counting = line(x, y, weight)
    if len(x) < 5:  # two parts of three can agree by chance
        return PowerLaw(float(exponent), np.inf, local, local_errors, fitted)
    design = np.stack([np.ones_like(x), x], axis=1)
    hat = np.linalg.inv(design.T @ (weight[:, None] * design)) @ (design.T @ (weight[:, None] ** 2 * design))
    rest = y - np.average(y, weights=weight) - exponent * (x - np.average(x, weights=weight))
    beyond = (np.sum(weight * rest * rest) - free) / (weight.sum() - np.trace(hat))
    exponent, spread = line(x, y, 1.0 / (variance + max(beyond, 0.0)))
    quantile = t.ppf(0.975, free)  # few scales may hide a scatter that is there
    ends = combinations(range(len(x)), 2)
    halves = [slice(i, j + 1) for i, j in ends if j > i + 1 and x[j] - x[i] >= 0.5 * (x[-1] - x[0]) - 1e-9]
    fits = [line(x[part], y[part], weight[part]) for part in halves]
    apart = [(a - b) ** 2 - (u + v - 2.0 * of_counting) for (a, u), (b, v) in combinations(fits, 2)]
    finest, of_finest = min(zip(halves, fits, strict=True), key=lambda each: (each[0].start, each[0].stop))[1]
    bias = max(finest - exponent + BEYOND * np.sqrt(of_finest), 0.0)
    error = np.sqrt(quantile**2 * spread + max([*apart, bias**2]))
    return PowerLaw(float(exponent), float(error), local, local_errors, fitted)


def line(x: Floats, y: Floats, weight: Floats) -> tuple[Floats, float]:
    """Least-squares slope of ``y`` over ``x``, for weights that are inverse variances also its variance.

    ``y`` may have further axes, one line for each; then so has the slope.
    """
    away = x - np.average(x, weights=weight)
    square = np.sum(weight * away * away)
    return np.asarray(np.tensordot(weight * away, y, 1) / square), float(1.0 / square)


def _with_error(value: float, error: float) -> str:
    """A number and the half width of its interval."""
    return f"{value:.3f}" + (f" +- {error:.2g}" if np.isfinite(error) else " (error not known)")


def _smoothness(smooth: bool | None) -> str:
    """What an exponent or a dimension shows."""
    if smooth is None:
        return "it may be smooth or not"
    return "it is smooth, within that error" if smooth else "it is not smooth"


#: Points an axis that boxes of the usual sizes need.
SMALLEST_MAP = 32

#: Parts of a map along every axis; odd, for many a map has a boundary in its middle.
PARTS = 5


def part_of(indices: Sequence[Integers], shape: tuple[int, ...]) -> Integers:
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


@dataclass(frozen=True, repr=False)
class BoundaryDimension(Printed):
    """Boxes that hold more than one label, over their size, and the power law."""

    edge: Integers  #: edges of the boxes [steps of the grid] (sizes,)
    mixed: Floats  #: share of the boxes' places with more than one label (sizes,)
    dimension: float  #: NaN: no boundary
    error: float  #: half width of its interval, of 95 % or more
    local_dimensions: Floats  #: between neighbouring sizes (sizes - 1,)
    local_errors: Floats  #: half widths of their 95 % intervals by parts of the map (sizes - 1,)
    codimension: float  #: the map's dimension less that of the boundary: the uncertainty exponent
    thin: str  #: why the map is too coarse for its basins, one line; empty: it is not

    def told(self) -> str:
        """The dimension, and whether it is that of a smooth boundary."""
        if np.isnan(self.dimension):
            return "the map has no boundary"
        return (
            f"boundary of dimension {_with_error(self.dimension, self.error)}, by boxes of {self.edge[0]} to "
            f"{self.edge[-1]} steps of the map\n  {self.thin or _smoothness(self.smooth)}"
        )

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
    array = numbered(check_map(labels))
    shortest = min(array.shape)
    given = 2 ** np.arange(max(int(np.log2(shortest / 16)), 3) + 1) if edges is None else np.asarray(edges)
    if given.ndim != 1 or given.size < 3 or not np.issubdtype(given.dtype, np.integer):
        raise InputError("edges: must be three or more integers")
    if edges is None and shortest < SMALLEST_MAP:
        raise InputError(
            f"labels: has shape {array.shape}; without edges, {SMALLEST_MAP} points an axis are needed"
        )
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


def not_smooth(labels: Integers) -> bool:
    """Whether boxes of several sizes show that a map's boundaries are not smooth; small maps show nothing."""
    return min(labels.shape) >= SMALLEST_MAP and boundary_dimension(labels).smooth is False


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


#: Part of the share of labels in no order above which a distance is as large as the basins' pieces: straight
#: stripes are exactly linear below it.
DISORDER = 0.75


@dataclass(frozen=True, repr=False)
class UncertaintyExponent(Printed):
    """Shares of uncertain starts over rising distances, and their power law."""

    epsilon: Floats  #: distances, in units of the box (scales,)
    uncertain: Integers  #: uncertain starts (scales,)
    starts: Integers  #: starts whose labels and whose neighbours' are all known (scales,)
    missing: Integers  #: starts with a label missing, not counted among ``starts`` (scales,)
    law: PowerLaw  #: exponent alpha, its error, local slopes
    dimension: float  #: D - alpha; its error is that of alpha

    def told(self) -> str:
        """The exponent and what it means."""
        if np.isnan(self.law.exponent):
            return "too few starts are uncertain for an exponent"
        missing = f"; {self.missing.sum():,} starts without a label" * bool(self.missing.any())
        return (
            f"uncertainty exponent {_with_error(self.law.exponent, self.law.error)}: a boundary of dimension "
            f"{self.dimension:.3f}\n  {_smoothness(self.smooth)}\n  fitted to {self.fitted.sum()} of "
            f"{counted(self.epsilon.size, 'distance')}{missing}"
        )

    @property
    def fitted(self) -> NDArray[np.bool_]:
        """Distances that take part in the law (scales,)."""
        return self.law.fitted

    @property
    def smooth(self) -> bool | None:
        """Whether alpha = 1 lies within the error bar; None: that is too wide to tell, or there is none."""
        return is_smooth(self.law.exponent, self.law.error)


def uncertainty_exponent(
    label_of: LabelOf, low: ArrayLike, high: ArrayLike, epsilon: ArrayLike, *, n: int = 4096, seed: int = 0
) -> UncertaintyExponent:
    """Uncertainty exponent of the boundaries in a box, from fresh random starts at every distance.

    Starts are uniform in the box; each has two neighbours, at -eps and +eps times the box's edges along a
    random direction of the box scaled to a unit cube. States whose edges have no length stay fixed and do not
    count in D. Starts of different distances are independent. The error bar joins counting and the largest
    difference between exponents of half of the distances, so it needs five of them, and is the narrower the
    more decades they span. A fractal that is similar to itself at one ratio makes shares oscillate; distances
    whose ratio is near the half of that one see too little of it, and the bar comes out too narrow.

    At a distance as large as the basins' pieces the share no longer tells of their boundary. So a distance is
    left out of the fit, as ``fitted`` tells, where it is more than three quarters of the share of labels in
    no order: 1 less the sum of the cubes of the labels' shares (a start and its two neighbours).

    Args:
        label_of: labels (n,) of starts (n, dim); negative: none.
        low: lower corner of the box (dim,).
        high: upper corner (dim,).
        epsilon: distances, greater than 0 and at most 0.5, rising, two or more, five for an error bar; in
            units of the box's edges.
        n: starts at every distance (each costs three trajectories).
        seed: of NumPy's ``default_rng([seed, scale])``.

    Raises:
        InputError: an argument is wrong.
    """
    corner, far = check_point("low", low), check_point("high", high)
    edges = far - corner if far.shape == corner.shape else np.array([-1.0])
    if (edges < 0.0).any() or not (edges > 0.0).any():
        raise InputError("high: must have the shape of low, nowhere be less and somewhere be greater")
    scales = check_point("epsilon", epsilon)
    if len(scales) < 2 or not (np.diff(scales, prepend=0.0) > 0.0).all() or scales[-1] > 0.5:
        raise InputError("epsilon: must be two or more rising distances, greater than 0, at most 0.5")
    n = checks.whole_number("n", n, least=1)
    seed = checks.whole_number("seed", seed, least=0)
    free = edges > 0.0
    counts, disordered = [], []
    for k, eps in enumerate(scales):
        rng = np.random.default_rng([seed, k])
        starts = corner + rng.random((n, len(edges))) * edges
        direction = np.where(free, rng.standard_normal((n, len(edges))), 0.0)
        aside = eps * edges * direction / np.linalg.norm(direction, axis=1, keepdims=True)
        labels = ask(label_of, np.concatenate([starts, starts - aside, starts + aside])).reshape(3, n)
        known = (labels >= 0).all(axis=0)
        uncertain = known & ((labels[1] != labels[0]) | (labels[2] != labels[0]))
        each = np.unique(labels[0, known], return_counts=True)[1]
        counts.append((int(np.count_nonzero(uncertain)), int(each.sum())))
        disordered.append(1.0 - float(np.sum((each / max(each.sum(), 1)) ** 3)))
    hits, trials = np.array(counts, dtype=np.int64).T
    fitted = hits <= DISORDER * trials * np.array(disordered)
    law = fit_counts(scales, hits, trials, fitted)
    dimension = float(np.count_nonzero(free) - law.exponent)
    return UncertaintyExponent(scales, hits, trials, n - trials, law, dimension=dimension)
