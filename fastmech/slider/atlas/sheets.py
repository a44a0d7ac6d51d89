"""Sheets: each equilibrium's identity across a map.

The equilibria over a plane of parameters are a smooth surface, and along the folds its tangent plane stands
upright. Cut along the folds it falls into **branches**: what can be continued without meeting a fold, all of
one Morse index. A branch may pass over a point more than once. Between the two folds that meet in a cusp
there are two minima that are one and the same when continued round the cusp. A **sheet** is a part of a
branch with at most one equilibrium at a point:

- Regions (see ``fastmech.slider.atlas.sheets``) continue one another across folds by what survives there.
- Where a branch is twice over a region, these two are sheets of their own there, and the branch's other
  sheets end at the region's border. So nothing jumps at a fold, and neither of the two is preferred.

Hence neighbouring points with the same sheet number have the same equilibrium, continued along the straight
line between them, except on the edges that are listed as **breaks**: where two folds pass between
neighbours, or where going round a hole of the map exchanges two equilibria.

Ways between neighbouring regions of a map through channels of parameters that are narrower than its grid.
Towards a cusp two folds come together like a horn, and the grid's points between them fall apart into
islands. Whether two islands are one region is decided by walking from one to the other between the folds.

Compiled labelling of equilibria over a grid: equal labels are one equilibrium, continued. Points whose
equilibria continue one another completely, none appearing or vanishing, form a *region*. Within a region an
equilibrium is known by its rank there (0 to 5); its label is 8 times the region's number plus the rank.
Regions are found in one pass over the grid in the order of memory. Where two turn out to be one, the second
refers to the first together with how its ranks are permuted, so a label stands for one equilibrium at every
point, whatever the order. Continuing round a hole of a region may permute the equilibria; there the region
has a cut, on which the pass happens to close. The edges of that cut are listed with those between regions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fastmech.arrays import Codes, Floats, Integers
from fastmech.jit import INTEGERS, MATRIX, STATUSES, inlined, kernel, named_tuple
from fastmech.outcome import Outcome
from fastmech.scene import Scene
from fastmech.slider.atlas.axes import margins, rows_at
from fastmech.slider.descent import slope
from fastmech.slider.proof import apart
from fastmech.slider.solve import INDICES, Roots, solve_rows
from fastmech.slider.theorem import EPS, MOST

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
    g1, g2, h11, h12, h22 = slope(c, phi, theta)
    determinant = h11 * h22 - h12 * h12
    return -(h22 * g1 - h12 * g2) / determinant, -(h11 * g2 - h12 * g1) / determinant, determinant


@inlined
def trust(c: Floats, phi: float, theta: float) -> float:
    """Distance [rad] within which the Hessian at an equilibrium cannot become singular.

    Each stiffness changes by at most its amplitude a radian, so the least eigenvalue outlives |det|/(|H| L),
    L the sum of the amplitudes. What has not moved this far has met no fold.
    """
    _, _, h11, h12, h22 = slope(c, phi, theta)
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


class SheetPoints(NamedTuple):
    """Points of a grid, consecutive in memory order, as ``solve`` fills them."""

    coefficients: Floats  #: (n, 8)
    phi: Floats  #: (n, 6)
    theta: Floats
    index: Codes  # type: ignore[assignment]
    count: Codes  # type: ignore[assignment]  #: (n,)


@inlined
def match(points: SheetPoints, regular: Floats, q: int, p: int, between: Floats, partner: Codes) -> int:
    """Write the slot in row ``p`` that each equilibrium in row ``q`` continues to into ``partner``, -1: none.

    ``regular`` (n, 6) are the distances by ``trust``; ``between`` (8,) is for working in.

    Returns:
        the number of pairs; no slot is given twice.
    """
    coefficients, phi, theta, index, count = points
    pairs = 0
    for i in range(count[q]):
        partner[i] = -1
        if index[q, i] < 0:
            continue
        j, first, second = nearest(phi[q, i], theta[q, i], index[q, i], phi[p], theta[p], index[p], count[p])
        if j < 0:
            continue
        steady = PLAIN * first < min(regular[q, i], regular[p, j])
        if not (steady and first < LEAP and second > PLAIN * first):
            x, y, reached = follow(coefficients[q], coefficients[p], between, phi[q, i], theta[q, i])
            if not reached:
                continue
            j, first, second = nearest(x, y, index[q, i], phi[p], theta[p], index[p], count[p])
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


class SheetPlace(NamedTuple):
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


POINTS = named_tuple([MATRIX, MATRIX, MATRIX, INDICES, STATUSES], SheetPoints)
PLACE = named_tuple([types.int64, types.int64, INTEGERS, INTEGERS], SheetPlace)
TREES = named_tuple([LABEL_LIST, INDICES, INDICES], Trees)
EDGES = named_tuple([PLACES, INDICES, INTEGERS], Edges)


@kernel(types.int64(POINTS, PLACE, types.int64, TREES, LABELS, EDGES))
def label_points(
    points: SheetPoints, place: SheetPlace, regions: int, trees: Trees, label: Labels, edges: Edges
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
            pairs = match(points, regular, q, p, between, partner[axis])
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


class Forest:
    """The trees of at most ``room`` regions, growing."""

    def __init__(self, room: int) -> None:
        ranks = np.empty((2, room, RANKS), dtype=np.int8)
        self.trees, self.regions = Trees(np.empty(room, dtype=np.int32), ranks[0], ranks[1]), 0

    def resolve(self, label: Labels) -> None:
        """Replace labels (n, 6) by those at the roots of their regions' trees."""
        resolve_all(*self.trees[:2], label)

    def root(self, label: int) -> int:
        """The label at the root of its region's tree."""
        return int(resolve(*self.trees[:2], label))

    def unite(self, one: NDArray[np.int64], two: NDArray[np.int64]) -> None:
        """Make the regions of two lists of labels one; labels at the same place are one equilibrium."""
        mine, other = (np.array(labels, dtype=np.int32) for labels in (one, two))
        join(*self.trees[:2], mine, other, np.arange(one.size, dtype=np.int8), one.size)


class Borders(NamedTuple):
    """Edges and what is at their ends, the first end (index 0) and the second one along the axis (1)."""

    point: Integers  #: (edges, 2), numbers of the points in the grid
    axis: Integers  #: (edges,)
    partner: Codes  #: (edges, 6), see ``match``
    label: Labels  #: (edges, 2, 6)
    angles: Floats  #: (edges, 2, 2, 6) phi and theta

    def resolve(self, forest: Forest) -> None:
        """Replace labels by those at the roots of the trees of regions."""
        forest.resolve(self.label.reshape(-1, MOST))

    def links(self) -> Integers:
        """Pairs of labels (n, 2) that continue one another across an edge, each once."""
        edge, slot = np.nonzero(self.partner >= 0)
        one = self.label[edge, 0, slot]
        two = self.label[edge, 1, self.partner[edge, slot]]
        pairs = np.sort(np.stack([one, two], axis=1)[(one >= 0) & (two >= 0)], axis=1)
        return np.unique(pairs.astype(np.int64), axis=0).reshape(-1, 2)

    def breaks(self, number: Labels) -> tuple[Integers, Integers, Integers]:
        """Second end, axis and sheet where a sheet is at both ends of an edge but does not continue."""
        sheet = number[self.label]
        same = (sheet[:, 0, :, None] == sheet[:, 1, None, :]) & (sheet[:, 0, :, None] >= 0)
        linked = self.partner[:, :, None] == np.arange(MOST)
        edge, slot, _ = np.nonzero(same & ~linked)
        return self.point[edge, 1], self.axis[edge], sheet[edge, 0, slot].astype(np.int64)

    def ends(self) -> tuple[Integers, Labels, Floats]:
        """Points of the grid at the edges' ends, each once, with their labels and angles (n, 2, 6)."""
        point, first = np.unique(self.point.ravel(), return_index=True)
        label = self.label.reshape(-1, MOST)[first]
        return point, label, self.angles.reshape(-1, 2, MOST)[first]


def region_of(label: Labels) -> Integers:
    """Region of every row of labels (n, 6) with an equilibrium in the first slots, -1 where it has none."""
    return np.where((label >= 0).any(axis=1), label.max(axis=1) // RANKS, -1).astype(np.int64)


#: Islands further apart than this many cells of the grid are not joined.
REACH = 4

#: Steps of a way, a cell of the grid.
STEPS = 32

#: How far, in cells, a way may bend aside, and the number of places that are tried across it.
ASIDE, ACROSS = 2.0, 17

#: Halvings of the distance between the places tried, to find the widest part of the channel.
SHARPENINGS = 40


@dataclass(frozen=True)
class Ground:
    """Parameters between the points of a grid, linear in the points' numbers."""

    scene: Scene
    axes: Mapping[str, Floats]

    def coefficients(self, places: Floats) -> Floats:
        """Reduced coefficients (n, 8) at places (n, axes) counted in cells; NaN outside the grid."""
        values = {}
        inside = np.ones(len(places), dtype=bool)
        for place, (name, axis) in zip(places.T, self.axes.items(), strict=True):
            values[name] = np.interp(place, np.arange(axis.size), axis)
            inside &= (place >= 0.0) & (place <= axis.size - 1)
        return np.where(inside[:, None], rows_at(self.scene, values), np.nan)

    def depth(self, places: Floats, sign: float) -> Floats:
        """How deep (..., axes) is within the channel: the margin to the fold, times its sign [rad]."""
        flat = margins(self.coefficients(places.reshape(-1, places.shape[-1])))[0]
        return np.where(np.isnan(flat), -np.inf, sign * flat).reshape(places.shape[:-1])


def way(ground: Ground, start: Floats, end: Floats, count: int) -> Floats | None:
    """Places (n, axes) from a point of the grid to another, everywhere with ``count`` equilibria.

    The straight way, pushed aside across its main direction to where the channel is deepest wherever it
    leaves the channel. None: there is no such way.
    """
    sign = 1.0 if count == MOST else -1.0
    main = int(np.argmax(np.abs(end - start)))
    steps = STEPS * int(np.abs(end - start).max())
    places = start + np.linspace(0.0, 1.0, steps + 1)[:, None] * (end - start)
    lost = np.flatnonzero(ground.depth(places, sign) <= 0.0)
    sides = [axis for axis in range(len(start)) if axis != main]
    if lost.size and not sides:
        return None
    tried = places[lost]
    for _ in range(len(sides)):  # one round finds the deepest place across one axis, two across two
        for axis in sides:
            tried = deepest(ground, tried, axis, sign)
    places[lost] = tried
    return places if (ground.depth(places, sign) > 0.0).all() else None


def deepest(ground: Ground, places: Floats, axis: int, sign: float) -> Floats:
    """The places (n, axes), moved along one axis to where the channel is deepest."""
    half = ASIDE
    offsets = np.linspace(-half, half, ACROSS)
    for _ in range(SHARPENINGS):
        line = np.repeat(places[:, None], offsets.size, axis=1)
        line[..., axis] += offsets
        depth = ground.depth(line, sign)
        places = line[np.arange(len(places)), np.argmax(depth, axis=1)]
        if (depth.max(axis=1) > 0.0).all() and half < ASIDE:
            break
        half *= 0.5
        offsets = half * np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
    return places


def continued(ground: Ground, start: Floats, end: Floats, count: int) -> tuple[Roots, Labels] | None:
    """The equilibria all along a way, and their labels: equal ones continue one another; None: no way."""
    places = way(ground, start, end, count)
    if places is None:
        return None
    rows = ground.coefficients(places)
    found = solve_rows(rows)
    if not ((found.outcome == Outcome.COMPLETE) & (found.count == count)).all():
        return None
    n = len(rows)
    label = np.empty((n, MOST), dtype=np.int32)
    edges = Edges(np.empty((n, 2), np.int64), np.empty((n, MOST), np.int8), np.empty(1, np.int64))
    points = SheetPoints(rows, found.phi, found.theta, found.index, found.count)
    line = SheetPlace(0, 0, np.ones(1, dtype=np.int64), np.array([n]))
    regions = label_points(points, line, 0, Forest(n).trees, label, edges)
    return (found, label) if regions == 1 else None


#: Ways that are tried between two islands, and pairs of islands that are tried in all.
WAYS, PAIRS = 4, 1000


def branches(nodes: Integers, links: Integers) -> Integers:
    """Connected component of every node."""
    one, two = np.searchsorted(nodes, links).T
    graph = coo_array((np.ones(len(links)), (one, two)), shape=(nodes.size, nodes.size))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def separate(nodes: Integers, links: Integers, size: Integers) -> Integers:
    """Components without the links that would put two equilibria of a point into one.

    Where a component is twice over a region these two nodes lose all their links. Regions with most nodes
    come first, the smallest of them first: between two folds that meet in a cusp.
    """
    region = nodes // RANKS
    links = links[links[:, 0] // RANKS != links[:, 1] // RANKS]
    while True:
        group = branches(nodes, links)
        keys, inverse, times = np.unique(
            np.stack([region, group], axis=1), axis=0, return_inverse=True, return_counts=True
        )
        twice = times > 1
        if not twice.any():
            return group
        regions = np.unique(keys[twice, 0])
        many = np.array([np.count_nonzero(region == r) for r in regions])
        area = np.array([size[nodes[region == r]].max() for r in regions])
        worst = regions[np.lexsort((regions, area, -many))[0]]
        alone = nodes[twice[inverse.ravel()] & (region == worst)]
        links = links[~np.isin(links, alone).any(axis=1)]


def join_islands(ground: Ground, forest: Forest, borders: Borders) -> None:
    """Join regions with equally many equilibria that are one through a channel narrower than the grid."""
    point, label, angles = borders.ends()
    if len(ground.axes) < 2 or not point.size:
        return
    grid = tuple(len(values) for values in ground.axes.values())
    place = np.stack(np.unravel_index(point, grid), axis=1).astype(np.float64)
    known = np.count_nonzero(label >= 0, axis=1)
    for count in (MOST, 4):
        here = np.flatnonzero((known == count) & ~np.isnan(angles[:, 0, :count]).any(axis=1))
        if np.unique(region_of(label[here])).size < 2:
            continue
        pairs = here[cKDTree(place[here]).query_pairs(REACH, p=np.inf, output_type="ndarray")]
        regions = np.sort(region_of(label)[pairs], axis=1)
        apart = regions[:, 0] != regions[:, 1]
        pairs, regions = pairs[apart], regions[apart]
        far = np.abs(np.diff(place[pairs], axis=1)[:, 0]).max(axis=1)
        order = np.lexsort((pairs[:, 1], pairs[:, 0], far))
        tried: dict[tuple[int, int], int] = {}
        for one, two in pairs[order]:
            low, high = sorted(forest.root(int(label[k].max())) // RANKS for k in (one, two))
            roots = (low, high)
            if low == high or tried.get(roots, 0) >= WAYS or len(tried) >= PAIRS:
                continue
            tried[roots] = tried.get(roots, 0) + 1
            found = continued(ground, place[one], place[two], count)
            if found is not None:
                solution, labels = found
                start = slots(solution.phi[0], solution.theta[0], angles[one], count)
                end = slots(solution.phi[-1], solution.theta[-1], angles[two], count)
                mine, other = np.empty(RANKS, dtype=np.int64), np.empty(RANKS, dtype=np.int64)
                mine[labels[0, :count]] = label[one, start]
                other[labels[-1, :count]] = label[two, end]
                forest.unite(mine[:count], other[:count])


def slots(phi: Floats, theta: Floats, angles: Floats, count: int) -> Integers:
    """Slot of the stored equilibria (2, 6) for each of the ones found again at the same point."""
    gap = np.abs(np.exp(1j * phi[:count, None]) - np.exp(1j * angles[0, None, :count]))
    gap += np.abs(np.exp(1j * theta[:count, None]) - np.exp(1j * angles[1, None, :count]))
    return np.argmin(gap, axis=1)


@dataclass(frozen=True, eq=False)
class Sheets:
    """The sheets of a map.

    Minima come first, then saddles, then maxima; in each of them the sheet of most points first.
    """

    labels: list[Labels]  #: an array (points, 6) for every piece of the map, -1 where there is none
    morse_index: Codes  #: (sheets,)
    branch: NDArray[np.int32]  #: (sheets,): sheets of one branch continue one another
    breaks: NDArray[np.int32]  #: (breaks, axes + 2): indices of the edge's second end, its axis, the sheet


class SheetBuilder:
    """Labels a grid in consecutive pieces and joins the labels to sheets in the end.

    Args:
        scene: gives every parameter that is no axis.
        axes: the grid, checked.
    """

    def __init__(self, scene: Scene, axes: Mapping[str, Floats]) -> None:
        self.scene, self.axes = scene, axes
        self._grid = tuple(len(values) for values in axes.values())
        self._forest, self._borders = Forest(math.prod(self._grid)), list[Borders]()
        self._labels, self._done = list[Labels](), 0
        self._tail: tuple[NDArray[np.generic], ...] | None = None

    def add(self, coefficients: Floats, phi: Floats, theta: Floats, index: Codes, count: Codes) -> None:
        """Label the next points, at least one plane of the first axis or all."""
        lengths = np.array(self._grid, dtype=np.int64)
        strides = np.append(np.cumprod(lengths[:0:-1])[::-1], 1).astype(np.int64)
        n = len(count)
        arrays: tuple[NDArray[np.generic], ...] = (coefficients, phi, theta, index, count)
        label = np.empty((n, MOST), dtype=np.int32)
        ghosts = 0
        if self._tail is not None:
            ghosts = len(self._tail[0])
            arrays = tuple(
                np.concatenate([old, new]) for old, new in zip(self._tail[:-1], arrays, strict=True)
            )
            label = np.concatenate([self._tail[-1], label])
        forest = self._forest
        borders = np.empty((n * len(lengths), 2), dtype=np.int64)
        partners = np.empty((n * len(lengths), MOST), dtype=np.int8)
        filled = np.zeros(1, dtype=np.int64)
        own: Any = arrays
        points, edges = SheetPoints(*own), Edges(borders, partners, filled)
        place = SheetPlace(ghosts, self._done - ghosts, strides, lengths)
        forest.regions = label_points(points, place, forest.regions, forest.trees, label, edges)
        rows, axis = borders[: filled[0]].T
        ends = np.stack([rows - strides[axis], rows], axis=1)
        found = (
            ends + (self._done - ghosts), axis.copy(), partners[: filled[0]].copy(), label[ends],
            np.stack([points.phi[ends], points.theta[ends]], axis=2),
        )  # fmt: skip
        self._borders.append(Borders(*found))
        plane = int(strides[0])
        self._tail = (*(array[-plane:].copy() for array in arrays), label[-plane:].copy())
        self._labels.append(label[ghosts:].copy() if ghosts else label)
        self._done += n

    def finish(self) -> Sheets:
        """The sheets of all that was added."""
        pieces, self._labels = self._labels, []
        forest, borders = self._forest, Borders(*map(np.concatenate, zip(*self._borders, strict=True)))
        borders.resolve(forest)
        join_islands(Ground(self.scene, self.axes), forest, borders)
        borders.resolve(forest)
        size = np.zeros(forest.regions * RANKS + 1, dtype=np.int64)
        for piece in pieces:
            forest.resolve(piece)
            size += np.bincount(piece.ravel() + 1, minlength=size.size)
        size = size[1:]
        nodes = np.flatnonzero(size)
        morse = forest.trees.morse.ravel()
        links = borders.links()
        branch_of = branches(nodes, links)
        group_of = separate(nodes, links, size)
        groups = np.unique(group_of)
        place = np.searchsorted(groups, group_of)
        points = np.bincount(place, weights=size[nodes]).astype(np.int64)
        first = nodes[np.unique(place, return_index=True)[1]]
        order = np.lexsort((first, -points, morse[first]))
        rank = np.empty(groups.size, dtype=np.int32)
        rank[order] = np.arange(groups.size, dtype=np.int32)
        number = np.full(forest.regions * RANKS + 1, -1, dtype=np.int32)
        number[nodes] = rank[place]
        for piece in pieces:
            piece[:] = number[piece]
        node_branch = np.empty(groups.size, dtype=np.int64)
        node_branch[rank[place]] = branch_of
        _, firsts, branch = np.unique(node_branch, return_index=True, return_inverse=True)
        in_order = np.argsort(np.argsort(firsts))[branch]
        point, axis, sheet = borders.breaks(number)
        breaks = np.stack([*np.unravel_index(point, self._grid), axis, sheet], axis=1).astype(np.int32)
        return Sheets(pieces, morse[first][order], in_order.astype(np.int32), breaks)
