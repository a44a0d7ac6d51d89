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
Regions are flooded from point to point. Continuing round a hole of a region may permute the equilibria; there
the region has a cut, on which the flood closes. The edges of that cut are listed with those between regions.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from heapq import heappop, heappush
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fastmech.arrays import Codes, Flags, Floats, Integers
from fastmech.ensembles.threads import in_parts
from fastmech.jit import INTEGERS, MATRIX, STATUSES, inlined, kernel, named_tuple
from fastmech.outcome import Outcome
from fastmech.scene import Scene
from fastmech.slider.atlas.axes import fold_margins, rows_at
from fastmech.slider.descent import slope
from fastmech.slider.solve import INDICES, NO_EQUILIBRIUM, apart, solve_rows
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
PARTNERS = types.Array(types.int8, 3, "C")
TORN = types.Array(types.boolean, 2, "C")


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
        j, first, second = nearest(
            phi[q, i], theta[q, i], index[q, i], phi[p], theta[p], indices=index[p], count=count[p]
        )
        if j < 0:
            continue
        steady = PLAIN * first < min(regular[q, i], regular[p, j])
        if not (steady and first < LEAP and second > PLAIN * first):
            x, y, reached = follow(coefficients[q], coefficients[p], between, phi[q, i], theta[q, i])
            if not reached:
                continue
            j, first, second = nearest(x, y, index[q, i], phi[p], theta[p], indices=index[p], count=count[p])
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

    ghosts: int  #: first points, which are those before the others
    offset: int  #: position of point 0 in the whole grid
    strides: NDArray[np.int64]  #: of the grid's axes, in points
    lengths: NDArray[np.int64]  #: the same


POINTS = named_tuple([MATRIX, MATRIX, MATRIX, INDICES, STATUSES], SheetPoints)
PLACE = named_tuple([types.int64, types.int64, INTEGERS, INTEGERS], SheetPlace)


@inlined
def is_whole(before: Codes, after: Codes, partner: Codes) -> bool:
    """Whether all equilibria of neighbours, given by their Morse indices, continue one another."""
    pairs, known, others, surplus = 0, 0, 0, 0
    for i in range(MOST):
        pairs += partner[i] >= 0
        known += before[i] >= 0
        others += after[i] >= 0
        surplus += (before[i] != NO_EQUILIBRIUM) - (after[i] != NO_EQUILIBRIUM)
    return bool(pairs > 0 and pairs == known and pairs == others and surplus == 0)


@kernel(types.void(POINTS, PLACE, PARTNERS, TORN))
def match_points(points: SheetPoints, place: SheetPlace, partner: Codes, torn: Flags) -> None:
    """Write how the equilibria of points that are no ghosts continue those of the points before them.

    ``partner`` (n, axes, 6): the slot to which each slot of the point before along an axis continues, -1:
    none. ``torn`` (n, axes): whether there is such a point and not everything continues.
    """
    coefficients, phi, theta, index, count = points
    between, regular = np.empty(coefficients.shape[1]), np.empty((len(count), MOST))
    for p in range(len(count)):
        for i in range(count[p]):
            if index[p, i] >= 0:
                regular[p, i] = trust(coefficients[p], phi[p, i], theta[p, i])
    for p in range(place.ghosts, len(count)):
        row = p - place.ghosts
        for axis in range(place.strides.shape[0]):
            torn[row, axis] = False
            for i in range(MOST):
                partner[row, axis, i] = -1
            if ((place.offset + p) // place.strides[axis]) % place.lengths[axis] > 0:
                q = p - place.strides[axis]
                match(points, regular, q, p, between, partner=partner[row, axis])
                torn[row, axis] = not is_whole(index[q], index[p], partner[row, axis])


@kernel(types.int64(INDICES, PARTNERS, PLACE, LABELS, TORN))
def flood(index: Codes, partner: Codes, place: SheetPlace, label: Labels, torn: Flags) -> int:
    """Label the points of a grid (n, 6), none of which has a label yet, region by region.

    Edges of regions' cuts become ``torn``, too.

    Returns:
        The number of regions.
    """
    n, axes, regions = index.shape[0], place.strides.shape[0], 0
    settled = np.zeros(n, dtype=np.bool_)
    for first in range(n):
        if settled[first]:
            continue
        settled[first], known = True, 0
        for i in range(MOST):
            if index[first, i] >= 0:
                label[first, i] = regions * RANKS + i
                known = 1
        regions += known
        front = [first] * known  # a heap: in the order of memory, so that cuts are short
        while front:
            p = heappop(front)
            for axis in range(axes):
                stride, length = place.strides[axis], place.lengths[axis]
                for side in (-1, 1):
                    q = p + side * stride
                    second = max(p, q)
                    outside = not 0 <= (p // stride) % length + side < length
                    if outside or settled[q] or torn[second, axis]:
                        continue
                    for i in range(MOST):
                        j = partner[second, axis, i]
                        if j >= 0 and side < 0:
                            label[q, i] = label[p, j]
                        elif j >= 0:
                            label[q, j] = label[p, i]
                    settled[q] = True
                    heappush(front, q)
    for p in range(n):
        for axis in range(axes):
            if (p // place.strides[axis]) % place.lengths[axis] > 0:
                for i in range(MOST):
                    j = partner[p, axis, i]
                    torn[p, axis] |= j >= 0 and label[p, j] != label[p - place.strides[axis], i]
    return regions


class Borders(NamedTuple):
    """Edges and what is at their ends, the first end (index 0) and the second one along the axis (1)."""

    point: Integers  #: (edges, 2), numbers of the points in the grid
    axis: Integers  #: (edges,)
    partner: Codes  #: (edges, 6), see ``match``
    label: Labels  #: (edges, 2, 6)

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

    def ends(self) -> tuple[Integers, Labels]:
        """Points of the grid at the edges' ends, each once, with their labels (n, 6)."""
        point, first = np.unique(self.point.ravel(), return_index=True)
        return point, self.label.reshape(-1, MOST)[first]


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
        flat = np.empty(places[..., 0].size)
        fold_margins(self.coefficients(places.reshape(-1, places.shape[-1])), flat)
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


def continued(ground: Ground, start: Floats, end: Floats, count: int) -> Labels | None:
    """Labels of the equilibria at both ends of a way (2, count): equal ones continue; None: no way.

    The equilibria of a point come in the same order whoever solves it.
    """
    places = way(ground, start, end, count)
    if places is None:
        return None
    rows = ground.coefficients(places)
    found = solve_rows(rows)
    if not ((found.outcome == Outcome.COMPLETE) & (found.count == count)).all():
        return None
    points = SheetPoints(rows, found.phi, found.theta, found.index, found.count)
    line = SheetPlace(0, 0, np.ones(1, dtype=np.int64), np.array([len(rows)]))
    partner, torn = np.empty((len(rows), 1, MOST), np.int8), np.empty((len(rows), 1), np.bool_)
    match_points(points, line, partner, torn)
    label = np.full((len(rows), MOST), NO_LABEL, dtype=np.int32)
    return label[[0, -1], :count] if flood(found.index, partner, line, label, torn) == 1 else None


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


def join_islands(ground: Ground, borders: Borders, same: Integers) -> None:
    """Join regions with equally many equilibria that are one through a channel narrower than the grid.

    ``same`` is every label's own number, and becomes that of the label that stands for it.
    """
    point, label = borders.ends()
    if len(ground.axes) < 2 or not point.size:
        return
    grid = tuple(len(values) for values in ground.axes.values())
    place = np.stack(np.unravel_index(point, grid), axis=1).astype(np.float64)
    for count in (MOST, 4):
        here = np.flatnonzero((label[:, :count] >= 0).all(axis=1) & (label[:, count:] < 0).all(axis=1))
        region = label[:, 0] // RANKS
        if np.unique(region[here]).size < 2:
            continue
        pairs = here[cKDTree(place[here]).query_pairs(REACH, p=np.inf, output_type="ndarray")]
        pairs = pairs[region[pairs[:, 0]] != region[pairs[:, 1]]]
        far = np.abs(np.diff(place[pairs], axis=1)[:, 0]).max(axis=1)
        tried: dict[tuple[int, int], int] = {}
        for one, two in pairs[np.lexsort((pairs[:, 1], pairs[:, 0], far))]:
            mine, other = same[label[one, :count]], same[label[two, :count]]
            low, high = sorted((int(mine[0]) // RANKS, int(other[0]) // RANKS))
            if low == high or tried.get((low, high), 0) >= WAYS or len(tried) >= PAIRS:
                continue
            tried[low, high] = tried.get((low, high), 0) + 1
            found = continued(ground, place[one], place[two], count)
            if found is not None:
                for slot, k in enumerate(found[1]):
                    same[same == other[slot]] = mine[np.flatnonzero(found[0] == k)[0]]


@dataclass(frozen=True, eq=False)
class Sheets:
    """The sheets of a map.

    Minima come first, then saddles, then maxima; in each of them the sheet of most points first.
    """

    labels: list[Labels]  #: an array (points, 6) for every piece of the map, -1 where there is none
    morse_index: Codes  #: (sheets,)
    branch: NDArray[np.int32]  #: (sheets,): sheets of one branch continue one another
    breaks: NDArray[np.int32]  #: (breaks, axes + 2): indices of the edge's second end, its axis, the sheet


#: Points that one task matches with those before them.
PART = 4096


class SheetBuilder:
    """Labels a grid in consecutive pieces and joins the labels to sheets in the end.

    Args:
        scene: gives every parameter that is no axis.
        axes: the grid, checked.
    """

    def __init__(self, scene: Scene, axes: Mapping[str, Floats]) -> None:
        self.scene, self.axes = scene, axes
        lengths = np.array([len(values) for values in axes.values()], dtype=np.int64)
        strides = np.append(np.cumprod(lengths[:0:-1])[::-1], 1).astype(np.int64)
        self._place, self._done = SheetPlace(0, 0, strides, lengths), 0
        self._pieces = list[tuple[Codes, Codes, Flags]]()  # Morse indices, partners, torn edges
        self._tail: SheetPoints | None = None  # the last plane

    def add(self, points: SheetPoints, threads: int | None = 1) -> None:
        """Take the next points, at least one plane of the first axis or all."""
        n, index, plane = len(points.count), points.index.copy(), int(self._place.strides[0])
        if self._tail is not None:
            both: Any = zip(self._tail, points, strict=True)
            points = SheetPoints(*map(np.concatenate, both))
        ghosts = len(points.count) - n
        partner = np.empty((n, len(self.axes), MOST), np.int8)
        torn = np.empty((n, len(self.axes)), np.bool_)

        def match_some(rows: slice) -> None:
            first, end = max(rows.start + ghosts - plane, 0), rows.stop + ghosts
            before = rows.start + ghosts - first
            place = self._place._replace(ghosts=before, offset=self._done - ghosts + first)
            some: Any = (array[first:end] for array in points)
            match_points(SheetPoints(*some), place, partner[rows], torn[rows])

        in_parts(match_some, n, threads, max(PART, 2 * plane))
        self._pieces.append((index, partner, torn))
        tail: Any = (array[-plane:].copy() for array in points)
        self._tail = SheetPoints(*tail)
        self._done += n

    def finish(self) -> Sheets:
        """The sheets of all that was added."""
        ends = np.cumsum([len(piece[0]) for piece in self._pieces])
        index, partner, torn = (np.concatenate(each) for each in zip(*self._pieces, strict=True))
        self._pieces.clear()
        label = np.full(index.shape, NO_LABEL, dtype=np.int32)
        same = np.arange(flood(index, partner, self._place, label, torn) * RANKS)
        filled = label >= 0
        morse, size = np.empty(same.size, dtype=np.int8), np.bincount(label[filled], minlength=same.size)
        morse[label[filled]] = index[filled]
        point, axis = np.nonzero(torn)
        both = np.stack([point - self._place.strides[axis], point], axis=1)
        borders = Borders(both, axis, partner[point, axis], label[both])
        join_islands(Ground(self.scene, self.axes), borders, same)
        borders = borders._replace(label=np.append(same, NO_LABEL)[borders.label])
        size = np.bincount(same, weights=size, minlength=same.size).astype(np.int64)
        nodes = np.flatnonzero(size)
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
        number = np.full(same.size + 1, -1, dtype=np.int32)
        number[nodes] = rank[place]
        number[:-1] = number[same]
        node_branch = np.empty(groups.size, dtype=np.int64)
        node_branch[rank[place]] = branch_of
        _, firsts, branch = np.unique(node_branch, return_index=True, return_inverse=True)
        in_order = np.argsort(np.argsort(firsts))[branch]
        point, axis, sheet = borders.breaks(number)
        where = np.unravel_index(point, tuple(self._place.lengths))
        breaks = np.stack([*where, axis, sheet], axis=1).astype(np.int32)
        np.take(number, label, out=label, mode="wrap")
        return Sheets(np.split(label, ends[:-1]), morse[first][order], in_order.astype(np.int32), breaks)
