"""A power law's exponent from what is counted at several scales: fit, local slopes, error bar.

The error bar joins what counting leaves open to what the law itself does: few scales, a window that cuts
structure off, and the oscillation of a fractal that is similar to itself only at certain ratios make an
exponent depend on the scales that it is fitted to. Its measure is the largest difference between exponents
of parts of the scales.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, t

from fastmech.arrays import Floats, Integers

#: Half width above which an error bar round 1 does not tell a smooth boundary from a fractal one.
TELLING = 0.15

#: Standard errors by which the coarser half of the scales must rise less steeply to be thought bent.
BENT = 2.0

#: Standard errors beyond the finest scales' exponent that the error bar reaches.
BEYOND = 1.5


@dataclass(frozen=True)
class PowerLaw:
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
