"""Compiled labelling of equilibria over a grid: equal labels are one equilibrium, continued.

Points whose equilibria continue one another completely, none appearing or vanishing, form a *region*. Within
a region an equilibrium is known by its rank there (0 to 5); its label is 8 times the region's number plus the
rank. Regions are found in one pass over the grid in the order of memory. Where two turn out to be one, the
second refers to the first together with how its ranks are permuted, so a label stands for one equilibrium at
every point, whatever the order. Continuing round a hole of a region may permute the equilibria; there the
region has a cut, on which the pass happens to close. The edges of that cut are listed with those between
regions.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.arrays import Codes, Floats
from fastmech.equilibria.certificate import apart
from fastmech.equilibria.search import EPS, MOST
from fastmech.equilibria.solve import INDICES
from fastmech.jit import INTEGERS, MATRIX, STATUSES, inlined, kernel, named_tuple
from fastmech.mechanism.reduced import potential_gradient, potential_hessian

#: A partner is plain if the next candidate is this many times as far, and if both Hessians stay regular
#: (see ``trust``) that many times as far around.
PLAIN = 4.0

#: Tracking gives up below this part of the way between two scenes: a fold is in between.
SHORTEST = 1.0 / 16384.0

#: Longest Newton correction [rad] that still counts as following the same equilibrium.
LEAP = 0.05


@inlined
def newton_step(c: Floats, phi: float, theta: float) -> tuple[float, float, float]:
    """Newton step of the reduced gradient and the Hessian's determinant; ``c`` as ``Coefficients``."""
    s1, c1, s2, c2 = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    s12, c12 = s1 * c2 + c1 * s2, c1 * c2 - s1 * s2
    g1, g2 = potential_gradient(s1, c1, s2, c2, c12, c[2], c[3], c[4], c[5])
    h11, h12, h22 = potential_hessian(s1, c1, s2, c2, s12, c[2], c[3], c[4], c[5])
    determinant = h11 * h22 - h12 * h12
    return -(h22 * g1 - h12 * g2) / determinant, -(h11 * g2 - h12 * g1) / determinant, determinant


@inlined
def trust(c: Floats, phi: float, theta: float) -> float:
    """Distance [rad] within which the Hessian at an equilibrium cannot become singular.

    Each stiffness changes by at most its amplitude a radian, so the least eigenvalue outlives |det|/(|H| L),
    L the sum of the amplitudes. What has not moved this far has met no fold.
    """
    s1, c1, s2, c2 = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    h11, h12, h22 = potential_hessian(s1, c1, s2, c2, s1 * c2 + c1 * s2, c[2], c[3], c[4], c[5])
    size = abs(h11) + 2.0 * abs(h12) + abs(h22)
    change = np.hypot(c[2], c[5]) + np.hypot(c[4], c[5]) + 2.0 * c[3]
    distance: float = abs(h11 * h22 - h12 * h12) / (size * change)
    return distance


@inlined
def follow(
    start: Floats, end: Floats, between: Floats, phi: float, theta: float
) -> tuple[float, float, bool]:
    """Track an equilibrium from scene ``start`` to scene ``end``, coefficients changing linearly.

    Each stretch of the way is taken by Newton's method; it is halved where the first correction is long, the
    second not much shorter, or the determinant changes by more than a factor of two: a step across two folds
    would give itself away by one of these. ``between`` (8,) is for working in.

    Returns:
        Where it ends, and whether it got there.
    """
    at, stretch = 0.0, 1.0
    before = newton_step(start, phi, theta)[2]
    while at < 1.0:
        stretch = min(stretch, 1.0 - at)
        for k in range(between.shape[0]):
            between[k] = start[k] + (at + stretch) * (end[k] - start[k])
        x, y = phi, theta
        d1, d2, determinant = newton_step(between, x, y)
        first = np.hypot(d1, d2)
        x, y = x + d1, y + d2
        d1, d2, determinant = newton_step(between, x, y)
        second = np.hypot(d1, d2)
        x, y = x + d1, y + d2
        change = determinant / before
        if first < LEAP and second <= 0.1 * first + 8.0 * EPS and 0.5 < change < 2.0:
            phi, theta, at, before = x, y, at + stretch, determinant
            stretch = 2.0 * stretch
        else:
            stretch = 0.5 * stretch
            if stretch < SHORTEST:
                return phi, theta, False
    return phi, theta, True


@inlined
def nearest(
    phi: float, theta: float, index: int, phis: Floats, thetas: Floats, indices: Codes, count: int
) -> tuple[int, float, float]:
    """The nearest equilibrium of the same Morse index, its distance and that of the next [rad]."""
    best, first, second = -1, np.inf, np.inf
    for j in range(count):
        if indices[j] == index:
            distance = apart(phi, theta, phis[j], thetas[j])
            if distance < first:
                best, first, second = j, distance, first
            elif distance < second:
                second = distance
    return best, first, second


@inlined
def match(
    start: Floats,
    end: Floats,
    phi: Floats,
    theta: Floats,
    index: Codes,
    regular: Floats,
    count: int,
    phis: Floats,
    thetas: Floats,
    indices: Codes,
    regulars: Floats,
    counts: int,
    between: Floats,
    partner: Codes,
) -> int:
    """Write the slot in ``end`` that each equilibrium in ``start`` continues to into ``partner``, -1: none.

    ``regular`` and ``regulars`` are the distances by ``trust``.

    Returns:
        the number of pairs; no slot is given twice.
    """
    pairs = 0
    for i in range(count):
        partner[i] = -1
        if index[i] < 0:
            continue
        j, first, second = nearest(phi[i], theta[i], index[i], phis, thetas, indices, counts)
        if j < 0:
            continue
        steady = PLAIN * first < min(regular[i], regulars[j])
        if not (steady and first < LEAP and second > PLAIN * first):
            x, y, reached = follow(start, end, between, phi[i], theta[i])
            if not reached:
                continue
            j, first, second = nearest(x, y, index[i], phis, thetas, indices, counts)
            if first > LEAP:
                continue
        taken = False
        for k in range(i):
            if partner[k] == j:
                taken = True
                partner[k] = -1
                pairs -= 1
        if not taken:
            partner[i] = j
            pairs += 1
    return pairs


Labels = NDArray[np.int32]

#: Labels of a region: its number times this plus a rank.
RANKS = 8

#: Label of an empty slot and of an equilibrium whose Hessian is singular: there sheets meet.
NO_LABEL = -1

LABELS = types.Array(types.int32, 2, "C")
PLACES = types.Array(types.int64, 2, "C")
LABEL_LIST = types.Array(types.int32, 1, "C")


@inlined
def resolve(parent: Labels, rank: Codes, label: int) -> int:
    """The label at the root of its region's tree; the path to it is left as it is (trees stay flat)."""
    region, k = label // RANKS, label % RANKS
    while parent[region] != region:
        k = rank[region, k]
        region = parent[region]
    return region * RANKS + k


@inlined
def join(parent: Labels, rank: Codes, mine: Labels, other: Labels, partner: Codes, count: int) -> bool:
    """Make two regions one: slot i of ``other`` continues to slot partner[i] of ``mine``.

    Returns:
        Whether they are one now with every slot where it continues. If they were one before and it is not,
        going round a hole of the region exchanges equilibria.
    """
    root, attached, agree = -1, -1, True
    for i in range(count):
        if other[i] < 0:
            continue
        a = resolve(parent, rank, mine[partner[i]])
        b = resolve(parent, rank, other[i])
        agree = agree and a == b
        attached, root = a // RANKS, b // RANKS
    if root == attached:
        return agree
    swap = root > attached
    if swap:
        root, attached = attached, root
    for i in range(count):
        if other[i] < 0:
            continue
        a = resolve(parent, rank, mine[partner[i]]) % RANKS
        b = resolve(parent, rank, other[i]) % RANKS
        if swap:
            rank[attached, b] = a
        else:
            rank[attached, a] = b
    parent[attached] = root
    return True


class Points(NamedTuple):
    """Points of a grid, consecutive in memory order, as ``solve`` fills them."""

    coefficients: Floats  #: (n, 8)
    phi: Floats  #: (n, 6)
    theta: Floats
    index: Codes  # type: ignore[assignment]
    count: Codes  # type: ignore[assignment]  #: (n,)


class Place(NamedTuple):
    """Where points lie in their grid."""

    ghosts: int  #: first points, which have their labels already
    offset: int  #: position of point 0 in the whole grid
    strides: NDArray[np.int64]  #: of the grid's axes, in points
    lengths: NDArray[np.int64]  #: the same


class Trees(NamedTuple):
    """Trees of regions, with room for one more region for every point."""

    parent: Labels
    rank: Codes
    morse: Codes  #: (room, 8) Morse index of every label


class Edges(NamedTuple):
    """Edges of the grid across which not everything continues."""

    borders: NDArray[np.int64]  #: (room, 2) point of the second end, and axis
    partners: Codes  #: (room, 6) slot of the second end that each slot of the first continues to, -1: none
    filled: NDArray[np.int64]  #: (1,) how many


POINTS = named_tuple([MATRIX, MATRIX, MATRIX, INDICES, STATUSES], Points)
PLACE = named_tuple([types.int64, types.int64, INTEGERS, INTEGERS], Place)
TREES = named_tuple([LABEL_LIST, INDICES, INDICES], Trees)
EDGES = named_tuple([PLACES, INDICES, INTEGERS], Edges)


@kernel(types.int64(POINTS, PLACE, types.int64, TREES, LABELS, EDGES))
def label_points(
    points: Points, place: Place, regions: int, trees: Trees, label: Labels, edges: Edges
) -> int:
    """Label points (n, 6) of which some may have their labels already; all but the first two are written.

    Returns:
        The number of regions, of which there were so many before.
    """
    coefficients, phi, theta, index, count = points
    parent, rank, borders = trees.parent, trees.rank, edges.borders
    axes = place.strides.shape[0]
    partner = np.empty((axes, MOST), dtype=np.int8)
    border = np.empty(axes, dtype=np.bool_)
    between = np.empty(coefficients.shape[1])
    regular = np.empty((len(count), MOST))
    known = np.zeros(len(count), dtype=np.int8)
    for p in range(len(count)):
        for i in range(count[p]):
            if index[p, i] >= 0:
                regular[p, i] = trust(coefficients[p], phi[p, i], theta[p, i])
                known[p] += 1
    filled = 0
    for p in range(place.ghosts, len(count)):
        n = int(count[p])
        for i in range(MOST):
            label[p, i] = NO_LABEL
        settled = False
        for axis in range(axes):
            border[axis] = False
            if ((place.offset + p) // place.strides[axis]) % place.lengths[axis] == 0:
                continue
            q = p - place.strides[axis]
            m = int(count[q])
            pairs = match(
                coefficients[q],
                coefficients[p],
                phi[q],
                theta[q],
                index[q],
                regular[q],
                m,
                phi[p],
                theta[p],
                index[p],
                regular[p],
                n,
                between,
                partner[axis],
            )
            border[axis] = True
            if pairs > 0 and m == n and pairs == known[p] and pairs == known[q]:
                if settled:
                    border[axis] = not join(parent, rank, label[p], label[q], partner[axis], n)
                else:
                    for i in range(n):
                        if partner[axis, i] >= 0:
                            label[p, partner[axis, i]] = label[q, i]
                    settled = True
                    border[axis] = False
        if not settled and known[p] > 0:
            parent[regions] = regions
            for i in range(n):
                if index[p, i] >= 0:
                    label[p, i] = regions * RANKS + i
                    trees.morse[regions, i] = index[p, i]
            regions += 1
        for axis in range(axes):
            if border[axis]:
                q = p - place.strides[axis]
                borders[filled, 0], borders[filled, 1] = p, axis
                for i in range(MOST):
                    edges.partners[filled, i] = partner[axis, i] if i < count[q] else -1
                filled += 1
    edges.filled[0] = filled
    return regions


@kernel(types.void(LABEL_LIST, INDICES, LABELS))
def resolve_all(parent: Labels, rank: Codes, label: Labels) -> None:
    """Replace every label by the one at the root of its region's tree."""
    for p in range(label.shape[0]):
        for i in range(label.shape[1]):
            if label[p, i] >= 0:
                label[p, i] = resolve(parent, rank, label[p, i])


@dataclass
class Forest:
    """The trees of regions, growing."""

    regions: int = 0
    parent: Labels = field(default_factory=lambda: np.empty(0, dtype=np.int32))
    rank: Codes = field(default_factory=lambda: np.empty((0, RANKS), dtype=np.int8))
    morse: Codes = field(default_factory=lambda: np.empty((0, RANKS), dtype=np.int8))  #: of every label

    @property
    def trees(self) -> Trees:
        """The trees as they are now."""
        return Trees(self.parent, self.rank, self.morse)

    def make_room(self, n: int) -> None:
        """Make room for n more regions."""
        if self.regions + n <= len(self.parent):
            return
        n = 2 * n + 1024
        self.parent = np.concatenate([self.parent[: self.regions], np.empty(n, dtype=np.int32)])
        extra = np.empty((n, RANKS), dtype=np.int8)
        self.rank = np.concatenate([self.rank[: self.regions], extra])
        self.morse = np.concatenate([self.morse[: self.regions], extra])

    def resolve(self, label: Labels) -> None:
        """Replace labels (n, 6) by those at the roots of their regions' trees."""
        resolve_all(self.parent, self.rank, label)

    def root(self, label: int) -> int:
        """The label at the root of its region's tree."""
        return int(resolve(self.parent, self.rank, label))

    def unite(self, one: NDArray[np.int64], two: NDArray[np.int64]) -> None:
        """Make the regions of two lists of labels one; labels at the same place are one equilibrium."""
        mine, other = (np.array(labels, dtype=np.int32) for labels in (one, two))
        join(self.parent, self.rank, mine, other, np.arange(one.size, dtype=np.int8), one.size)
