"""Wada test by merging: do all basins share one boundary?

Daza, Wagemakers, Sanjuan, Sci. Rep. 8 (2018) 9954: for every label all others are merged into one, which
gives a boundary of two colours. If three or more basins have the Wada property, all these boundaries are one
and the same set; on a map they then agree when fattened by a few points. Here the least fattening is computed
at once: the largest distance from a point of one of the boundaries to another of the boundaries (their
Hausdorff distance, in steps of the grid along the axes: fattening by squares).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import distance_transform_cdt

from fastmech.basins.measures.labels import Floats, Integers, check_map, known_labels
from fastmech.ensembles import checks


@dataclass(frozen=True)
class WadaTest:
    """Boundaries of every basin against that of all others, compared with each other."""

    labels: Integers  #: the labels that occur (k,)
    distance: Floats  #: largest distance from boundary i to boundary j [steps] (k, k); inf: j has none
    far_share: Floats  #: share of boundary i further from j than the fattening (k, k)
    boundary_points: Integers  #: points of every boundary (k,)
    fattening: int  #: steps
    missing: int  #: points without a label

    @property
    def least_fattening(self) -> float:
        """Fattening [steps] with which all boundaries contain each other; inf: none does."""
        return float(self.distance.max(initial=0.0)) if len(self.labels) > 1 else np.inf

    @property
    def wada(self) -> bool:
        """Whether three or more basins share one boundary, as far as the map shows."""
        return len(self.labels) >= 3 and self.least_fattening <= self.fattening


def wada_merge_test(labels: ArrayLike, fattening: int = 5) -> WadaTest:
    """Merge test of a map.

    A map of finite resolution cannot prove the property: a positive answer holds at its scale. Repeat it on a
    finer map, where the least fattening in steps must stay, and so shrink in length.

    Args:
        labels: on a grid of any number of axes, with any gaps; negative: no label, belongs to no basin and
            makes no boundary.
        fattening: steps by which boundaries may differ.

    Raises:
        InputError: the labels are no map, or the fattening is no whole number of steps.
    """
    array = check_map(labels)
    fattening = checks.whole_number("fattening", fattening, least=0)
    which = known_labels(array)
    boundaries = [_boundary(array, int(label)) for label in which]
    distance = np.zeros((which.size, which.size))
    far = np.zeros_like(distance)
    for j, to in enumerate(boundaries):
        away = np.full(to.shape, np.inf)
        if to.any():
            away[:] = distance_transform_cdt(~to, "chessboard")
        for i, other in enumerate(boundaries):
            distance[i, j] = away[other].max(initial=0.0)
            far[i, j] = np.mean(away[other] > fattening) if other.any() else 0.0
    return WadaTest(
        labels=which,
        distance=distance,
        far_share=far,
        boundary_points=np.array([np.count_nonzero(b) for b in boundaries], dtype=np.int64),
        fattening=fattening,
        missing=int(np.count_nonzero(array < 0)),
    )


def _boundary(array: Integers, label: int) -> NDArray[np.bool_]:
    """Points next to one on the other side of the boundary between a label and all others merged."""
    own, known = array == label, array >= 0
    found = np.zeros(array.shape, dtype=bool)
    for axis in range(array.ndim):
        a, b = [slice(None)] * array.ndim, [slice(None)] * array.ndim
        a[axis], b[axis] = slice(None, -1), slice(1, None)
        first, second = tuple(a), tuple(b)
        differ = (own[first] != own[second]) & known[first] & known[second]
        found[first] |= differ
        found[second] |= differ
    return found
