"""A power law's exponent from counts at several scales: fit, local slopes, error bar."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, t

from fastmech.basins.measures.labels import Floats


@dataclass(frozen=True)
class PowerLaw:
    """f(scale) ~ scale^exponent. Slopes belong to neighbouring scales, the last two of which fix the last."""

    exponent: float  #: weighted least squares of log f over log scale; NaN: fewer than two scales with f > 0
    error: float  #: half width of the exponent's 95 % confidence interval
    local_slopes: Floats  #: between neighbouring scales (scales - 1,), NaN where f = 0
    local_errors: Floats  #: half widths of their 95 % intervals (scales - 1,)


def fit_counts(scales: Floats, hits: NDArray[np.int64], trials: NDArray[np.int64]) -> PowerLaw:
    """Fit shares ``hits / trials`` of independent trials at rising ``scales``, all of shape (scales,).

    The logarithm of a share f has the variance (1 - f)/hits. Scatter about the line beyond that widens the
    error (by the root of chi^2 over its degrees of freedom, with Student's quantile).
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
    known = hits > 0
    if np.count_nonzero(known) < 2:
        return PowerLaw(np.nan, np.nan, local, local_errors)
    x, y, weight = np.log(scales[known]), y[known], 1.0 / variance[known]
    x = x - np.average(x, weights=weight)
    spread = np.sum(weight * x * x)
    exponent = float(np.sum(weight * x * y) / spread)
    rest = y - np.average(y, weights=weight) - exponent * x
    error = norm.ppf(0.975) / np.sqrt(spread)
    free = len(x) - 2
    if free > 0:
        excess = np.sum(weight * rest * rest) / free
        error = max(error, t.ppf(0.975, free) * np.sqrt(excess / spread))
    return PowerLaw(exponent, float(error), local, local_errors)
