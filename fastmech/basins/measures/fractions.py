"""How much of the starts ends where: basin fractions, basin stability, finite-time basin stability.

Every share comes with its Wilson interval (E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209): for k of n
independent starts and the normal quantile z of the confidence,
``(k + z^2/2 -+ z sqrt(k (n - k)/n + z^2/4)) / (n + z^2)``. It stays within [0, 1] and is honest at k = 0 and
k = n, where the usual k/n -+ z sqrt(k (n - k)/n^3) has no width. Its lower end counts starts without a label
as ending elsewhere, its upper end as ending there. For a grid, whose points are more even than random ones,
it is wider than it need be.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import binomtest

from fastmech.arrays import Floats, Integers
from fastmech.basins.measures.labels import GONE, LabelsLike, check_labels, known_labels
from fastmech.ensembles import checks
from fastmech.errors import InputError
from fastmech.objects import EACH, WIDTH, Printed


@dataclass(frozen=True, repr=False)
class Shares(Printed):
    """Shares of n starts, arrays of one shape."""

    count: Integers  #: starts that belong to each
    n: int  #: all starts
    missing: int  #: starts of which it is not known where they end; they are counted in ``n``
    fraction: Floats  #: count / n
    lower: Floats  #: lower end of the Wilson interval of ``fraction``
    upper: Floats  #: upper end of the Wilson interval of ``at_most``
    at_most: Floats  #: the fraction if every start without a label belonged there

    def told(self) -> str:
        """Each share with its interval."""
        return f"share of {self.n:,} starts: {self.listed([''] * self.fraction.size)}"

    def listed(self, names: Sequence[str]) -> str:
        """The first of them, a name before each, and how many starts have no label."""
        ends = zip(names, *map(np.ravel, (self.fraction, self.lower, self.upper)), strict=True)
        each = [f"{name}{x:.1%} ({low:.1%} to {high:.1%})" for name, x, low, high in ends]
        others = [f"{len(each) - EACH} more"] * (len(each) > EACH)
        return "; ".join([*each[:EACH], *others, f"no label: {self.missing:,} of {self.n:,}"])


def wilson(count: ArrayLike, n: int, confidence: float = 0.95) -> tuple[Floats, Floats]:
    """Lower and upper ends of the Wilson interval for ``count`` of ``n``, shapes as ``count``.

    Raises:
        InputError: not 0 <= count <= n with n >= 1, or the confidence is not between 0 and 1.
    """
    n = checks.whole_number("n", n, least=1)
    if not checks.number("confidence", confidence, "", above=0.0) < 1.0:
        raise InputError(f"confidence = {confidence!r}: must be less than 1")
    k = np.asarray(count)
    if not np.issubdtype(k.dtype, np.integer) or (k < 0).any() or (k > n).any():
        raise InputError(f"count: must be integers from 0 to n = {n}")
    different, place = np.unique(k, return_inverse=True)
    ends = np.array([binomtest(int(c), n).proportion_ci(confidence, method="wilson") for c in different])
    ends = ends.reshape(-1, 2)[place.reshape(k.shape)]
    return ends[..., 0], ends[..., 1]


class BasinFractions(NamedTuple):
    """Shares of labels."""

    labels: Integers  #: those that occur, rising, (labels,)
    shares: Shares  #: arrays (labels,)

    def _repr_html_(self) -> str:
        return f"<div>{self!r}</div>"

    def __repr__(self) -> str:
        names = [f"label {label}: " for label in self.labels]
        return "\n".join(textwrap.wrap(self.shares.listed(names), WIDTH))


def basin_fractions(labels: LabelsLike, *, confidence: float = 0.95) -> BasinFractions:
    """Share of every label in a map or a sample.

    Args:
        labels: any shape, negative: no label.
        confidence: of the intervals, each by itself.

    Returns:
        The labels that occur, rising, and their shares, arrays (labels,). What they lack of 1 is missing, the
        share ``missing / n``, or has escaped or left its range, as the statuses of a map or sample tell.

    Raises:
        InputError: the labels are not integers, or the confidence is not between 0 and 1.
    """
    array = check_labels(labels)
    which = known_labels(array)
    which = which[which != GONE]
    count = np.array([np.count_nonzero(array == label) for label in which], dtype=np.int64)
    return BasinFractions(which, _shares(count, array, confidence))


def basin_stability(labels: LabelsLike, label: int, *, confidence: float = 0.95) -> Shares:
    """Basin stability of one attractor: the probability that a random start returns to it.

    S_B = integral of 1_B(x) rho(x) dx, with B the basin and rho the density that the starts were drawn from
    (Menck, Heitzig, Marwan, Kurths, Nature Physics 9 (2013) 89); estimated by the share of the starts that
    end there.

    Args:
        labels: of independent starts drawn from rho, any shape; negative: no label.
        label: the attractor's label.
        confidence: of the interval.

    Raises:
        InputError: the labels are not integers, or the confidence is not between 0 and 1.
    """
    array = check_labels(labels)
    label = checks.whole_number("label", label, least=0)
    return _shares(np.array(np.count_nonzero(array == label)), array, confidence)


def finite_time_basin_stability(
    labels: LabelsLike, times: ArrayLike, label: int, horizons: ArrayLike, *, confidence: float = 0.95
) -> Shares:
    """Probability that a random start has returned to an attractor within a given time.

    S_B(T) = P(x in B and its time of return <= T) (Schultz, Hellmann, Webster, Kurths, Chaos 28 (2018)
    043102); it rises with T towards the basin stability. The time of return is whatever ``times`` hold: of
    capture, or of settling within a ball. Attractors are arrived at when it is looked, ``looks`` [s] apart,
    and horizons shorter than some looks say nothing.

    Args:
        labels: of independent starts, any shape; negative: no label.
        times: of return [s], the shape of ``labels``; not looked at where the label is another one.
        label: the attractor's label.
        horizons: times T [s], any shape.
        confidence: of the intervals, each by itself.

    Raises:
        InputError: the shapes differ, a time of return is NaN, or another argument is wrong.
    """
    array, moments = check_labels(labels), np.asarray(times, dtype=np.float64)
    label = checks.whole_number("label", label, least=0)
    if moments.shape != array.shape:
        raise InputError(f"times: has shape {moments.shape}, must be that of labels, {array.shape}")
    own = np.sort(moments[array == label])
    within = np.asarray(horizons, dtype=np.float64)
    if np.isnan(own).any() or np.isnan(within).any():
        raise InputError("times, horizons: must not be NaN where they are needed")
    return _shares(np.asarray(np.searchsorted(own, within, side="right")), array, confidence)


def _shares(count: Integers, labels: Integers, confidence: float) -> Shares:
    n, missing = labels.size, int(np.count_nonzero(labels < 0))
    return Shares(
        count=count,
        n=n,
        missing=missing,
        fraction=count / n,
        lower=wilson(count, n, confidence)[0],
        upper=wilson(count + missing, n, confidence)[1],
        at_most=(count + missing) / n,
    )
