"""Wada test by merging: do all basins share one boundary?

Daza, Wagemakers, Sanjuan, Sci. Rep. 8 (2018) 9954: for every label all others are merged into one, which
gives a boundary of two colours. If three or more basins have the Wada property, all these boundaries are one
and the same set; on a map they then agree when fattened by a few points, at every resolution. Here the least
fattening is computed at once: the largest distance from a point of one of the boundaries to another of the
boundaries (their Hausdorff distance, in steps of the grid along the axes: fattening by squares).

Bands that merely touch are near each other too. What tells them apart is the resolution: seen with every
second point of the map, boundaries of Wada basins lie twice as far apart, as boundaries that are one set do
for want of points, those of bands as far as before, the width of a band. Bands hardly wider than points
come nearer in that way too; so boundaries are taken for one set only where boxes of several sizes show that
they are no smooth lines.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_cdt

from fastmech.arrays import Floats, Integers
from fastmech.basins.measures.labels import LabelsLike, check_map, known_labels, too_thin
from fastmech.basins.measures.slopes import not_smooth
from fastmech.ensembles import checks
from fastmech.objects import Printed, counted

#: Strides with which a map is looked at, from coarse to fine.
STRIDES = (4, 2, 1)

#: Share of their distance with which boundaries that are one set remain at half the stride, at most; those of
#: bands, at least, from every second to every point and from every fourth.
SHRINKS, STAYS, STAYED = 0.65, 0.8, 0.45

#: What is said of boundaries that come together without being seen to be rough.
STRAIGHT = "boundaries may be smooth ones as near to each other as points are: a finer map can tell"

#: So many neighbours may differ, lest bands be thinner than points.
FULL = 0.5


@dataclass(frozen=True, repr=False)
class WadaTest(Printed):
    """Boundaries of every basin against that of all others, compared with each other."""

    wada: bool | None  #: whether three or more basins share one boundary; None: the map cannot tell
    reason: str  #: why, one line
    labels: Integers  #: the labels that occur (k,)
    distance: Floats  #: largest distance from boundary i to boundary j [steps] (k, k); inf: j has none
    far_share: Floats  #: share of boundary i further from j than the fattening (k, k)
    boundary_points: Integers  #: places of every boundary between two neighbouring points (k,)
    stride: Integers  #: every so many points of the map were looked at (3,)
    apart: Floats  #: largest mean distance of two boundaries then [steps of the map] (3,); inf: one missed
    fattening: int  #: steps
    missing: int  #: points without a label

    def told(self) -> str:
        """The answer, and why."""
        answers = {True: "all share one boundary", False: "not Wada basins", None: "the map cannot tell"}
        return f"Wada test of {counted(self.labels.size, 'basin')}: {answers[self.wada]}\n  {self.reason}"

    @property
    def least_fattening(self) -> float:
        """Fattening [steps] with which all boundaries contain each other; inf: none does."""
        return float(self.distance.max(initial=0.0)) if len(self.labels) > 1 else np.inf


def wada_merge_test(labels: LabelsLike, fattening: int = 5) -> WadaTest:
    """Merge test of a map, at its resolution and two coarser ones.

    - True: three or more basins; no boundary is further from another than the fattening, and each time that
      the stride is halved the largest mean distance of two boundaries shrinks to 0.65 of itself or less, and
      :func:`boundary_dimension` says that boundaries are not smooth. A map of finite resolution cannot prove
      the property: the answer holds at its scale.
    - False: less than three basins, or the distance stays (from every second point to every point 0.8 of it
      or more, from every fourth 0.45): boundaries do lie apart.
    - None: neither, or more than half of the neighbours along an axis differ, or the map has less than 32
      points an axis.

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
    looks = [_look(array[(slice(None, None, stride),) * array.ndim], which, fattening) for stride in STRIDES]
    apart = np.array([look[0].max(initial=0.0) * stride for look, stride in zip(looks, STRIDES, strict=True)])
    _, distance, far, points = looks[-1]
    full = max(float(np.mean(np.diff(array, axis=axis) != 0)) for axis in range(array.ndim))
    wada, reason = _judge(len(which), apart, float(distance.max(initial=0.0)), full, fattening)
    if wada and (thin := too_thin(array) or ("" if not_smooth(array) else STRAIGHT)):
        wada, reason = None, thin
    return WadaTest(
        wada=wada,
        reason=reason,
        labels=which,
        distance=distance,
        far_share=far,
        boundary_points=points,
        stride=np.array(STRIDES),
        apart=apart,
        fattening=fattening,
        missing=int(np.count_nonzero(array < 0)),
    )


def _judge(basins: int, apart: Floats, least: float, full: float, fattening: int) -> tuple[bool | None, str]:
    """Whether basins are Wada, and why; see :func:`wada_merge_test`."""
    if basins < 3:
        return False, f"{basins} basins; the property needs three or more"
    told = ", ".join(f"{distance:.3g}" for distance in apart)
    means = f"mean distances of boundaries at every 4th, 2nd and every point are up to {told} steps"
    if np.isinf(apart[-1]):
        return False, "a basin has no boundary on the map"
    if not np.isfinite(apart).all():
        return None, f"too few points: {means}"
    if apart[2] >= max(STAYS * apart[1], STAYED * apart[0]):
        return False, f"boundaries lie apart, at any resolution: {means}"
    if full > FULL:
        return None, f"{100.0 * full:.0f} % of neighbours along an axis differ: a finer map can tell"
    if (apart[1:] <= SHRINKS * apart[:-1]).all() and least <= fattening:
        return True, f"boundaries come together as the resolution rises: {means}"
    return None, f"a finer map can tell: {means}, the largest of all is {least:g} steps"


def _look(array: Integers, which: Integers, fattening: int) -> tuple[Floats, Floats, Floats, Integers]:
    """Mean and largest distances between boundaries, far shares (k, k), and boundaries' places (k,)."""
    boundaries = [_boundary(array, int(label)) for label in which]
    mean, most, far = (np.zeros((which.size, which.size)) for _ in range(3))
    for j, to in enumerate(boundaries):
        if not to.any():
            mean[:, j] = most[:, j] = np.inf
            continue
        away = distance_transform_cdt(~to, "chessboard") / 2.0
        for i, other in enumerate(boundaries):
            if other.any():
                there = away[other]
                mean[i, j], most[i, j], far[i, j] = there.mean(), there.max(), np.mean(there > fattening)
    return mean, most, far, np.array([np.count_nonzero(b) for b in boundaries], dtype=np.int64)


def _boundary(array: Integers, label: int) -> NDArray[np.bool_]:
    """Where neighbours lie on different sides of the boundary between a label and all others merged.

    On the grid of half the step: points have even indices, places between neighbours one odd index.
    """
    own, known = array == label, array >= 0
    found = np.zeros([2 * n - 1 for n in array.shape], dtype=bool)
    for axis in range(array.ndim):
        a, b = [slice(None)] * array.ndim, [slice(None)] * array.ndim
        a[axis], b[axis] = slice(None, -1), slice(1, None)
        between = [slice(int(k == axis), None, 2) for k in range(array.ndim)]
        first, second = tuple(a), tuple(b)
        found[tuple(between)] = (own[first] != own[second]) & known[first] & known[second]
    return found
