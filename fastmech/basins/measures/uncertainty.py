"""Uncertainty exponent: how fast the end becomes predictable as the start becomes more exact.

A start is uncertain at eps if a start at the distance eps from it ends elsewhere. The share of uncertain
starts falls like f(eps) ~ eps^alpha, and the boundary's (box-counting) dimension is d = D - alpha in D
dimensions: alpha = 1 for a smooth boundary, less for a fractal one, where halving f takes 2^(1/alpha) times
the accuracy (Grebogi, McDonald, Ott, Yorke, Phys. Lett. A 99 (1983) 415; McDonald, Grebogi, Ott, Yorke,
Physica D 17 (1985) 125).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.arrays import Floats, Integers
from fastmech.basins.measures.labels import LabelOf, ask, check_point
from fastmech.basins.measures.slopes import PowerLaw, fit_counts, is_smooth
from fastmech.ensembles import checks
from fastmech.errors import InputError

#: Part of the share of labels in no order above which a distance is as large as the basins' pieces: straight
#: stripes are exactly linear below it.
DISORDER = 0.75


@dataclass(frozen=True)
class UncertaintyExponent:
    """Shares of uncertain starts over rising distances, and their power law."""

    epsilon: Floats  #: distances, in units of the box (scales,)
    uncertain: Integers  #: uncertain starts (scales,)
    starts: Integers  #: starts whose labels and whose neighbours' are all known (scales,)
    missing: Integers  #: starts with a label missing, not counted among ``starts`` (scales,)
    law: PowerLaw  #: exponent alpha, its error, local slopes
    dimension: float  #: D - alpha; its error is that of alpha

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
    difference between exponents of half of the distances (:mod:`fastmech.basins.measures.slopes`), so it
    needs five of them, and is the narrower the more decades they span. A fractal that is similar to itself
    at one ratio makes shares oscillate; distances whose ratio is near the half of that one see too little of
    it, and the bar comes out too narrow.

    At a distance as large as the basins' pieces the share no longer tells of their boundary. So a distance is
    left out of the fit where it is more than three quarters of the share of labels in no order. That is 1
    less the sum of the cubes of the labels' shares (a start and its two neighbours). ``fitted`` tells which
    distances are left.

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
    return UncertaintyExponent(scales, hits, trials, n - trials, law, dimension)
