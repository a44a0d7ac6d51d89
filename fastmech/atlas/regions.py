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

from fastmech.atlas.matching import match, trust
from fastmech.equilibria.search import MOST
from fastmech.equilibria.solve import INDICES
from fastmech.jit import INTEGERS, MATRIX, STATUSES, inlined, kernel, named_tuple

Floats = NDArray[np.float64]
Codes = NDArray[np.int8]
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
