"""Sheets: each equilibrium's identity across a map.

The equilibria over a plane of parameters are a smooth surface, and along the folds its tangent plane stands
upright. Cut along the folds it falls into **branches**: what can be continued without meeting a fold, all of
one Morse index. A branch may pass over a point more than once. Between the two folds that meet in a cusp
there are two minima that are one and the same when continued round the cusp. A **sheet** is a part of a
branch with at most one equilibrium at a point:

- Regions (see ``fastmech.atlas.regions``) continue one another across folds by what survives there.
- Where a branch is twice over a region, these two are sheets of their own there, and the branch's other
  sheets end at the region's border. So nothing jumps at a fold, and neither of the two is preferred.

Hence neighbouring points with the same sheet number have the same equilibrium, continued along the straight
line between them, except on the edges that are listed as **breaks**: where two folds pass between
neighbours, or where going round a hole of the map exchanges two equilibria.

Towards a cusp two folds come together like a horn, and the grid's points between them fall apart into
islands. Whether two islands are one region is decided by walking from one to the other between the folds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fastmech.arrays import Codes, Floats, Integers
from fastmech.atlas.axes import coefficient_columns
from fastmech.atlas.margin import margins
from fastmech.atlas.regions import RANKS, Edges, Forest, Labels, Place, Points, label_points
from fastmech.equilibria.outcome import Outcome
from fastmech.equilibria.search import MOST
from fastmech.equilibria.solve import Solution, solve_rows
from fastmech.scene import Scene


def _none(*shape: int, dtype: type = np.int64) -> list[NDArray[np.generic]]:
    return [np.empty((0, *shape), dtype=dtype)]


@dataclass
class Borders:
    """Edges and what is at their ends, the first end (index 0) and the second one along the axis (1).

    Every field is a list of arrays, an item of the first dimension for each edge.
    """

    point: list[Any] = field(
        default_factory=lambda: _none(2)
    )  #: (edges, 2), numbers of the points in the grid
    axis: list[Any] = field(default_factory=_none)  #: (edges,)
    partner: list[Any] = field(
        default_factory=lambda: _none(MOST, dtype=np.int8)
    )  #: (edges, 6), see ``match``
    label: list[Any] = field(default_factory=lambda: _none(2, MOST, dtype=np.int32))  #: (edges, 2, 6)
    angles: list[Any] = field(default_factory=lambda: _none(2, 2, MOST, dtype=np.float64))  #: phi and theta

    def add(
        self,
        offset: int,
        second: Integers,
        first: Integers,
        axis: Integers,
        partner: Codes,
        label: Labels,
        phi: Floats,
        theta: Floats,
    ) -> None:
        """Keep edges between rows of ``label``, ``phi`` and ``theta``; row 0 is point ``offset``."""
        ends = np.stack([first, second], axis=1)
        self.point.append(ends + offset)
        self.axis.append(axis)
        self.partner.append(partner.copy())
        self.label.append(label[ends])
        self.angles.append(np.stack([phi[ends], theta[ends]], axis=2))

    def joined(self) -> Borders:
        """The same in one array each."""
        return Borders(**{name: [np.concatenate(arrays)] for name, arrays in vars(self).items()})

    def resolve(self, forest: Forest) -> None:
        """Replace labels by those at the roots of the trees of regions."""
        for label in self.label:
            forest.resolve(label.reshape(-1, MOST))

    def links(self) -> Integers:
        """Pairs of labels (n, 2) that continue one another across an edge, each once."""
        edge, slot = np.nonzero(self.partner[0] >= 0)
        one = self.label[0][edge, 0, slot]
        two = self.label[0][edge, 1, self.partner[0][edge, slot]]
        pairs = np.sort(np.stack([one, two], axis=1)[(one >= 0) & (two >= 0)], axis=1)
        return np.unique(pairs.astype(np.int64), axis=0).reshape(-1, 2)

    def breaks(self, number: Labels) -> tuple[Integers, Integers, Integers]:
        """Second end, axis and sheet where a sheet is at both ends of an edge but does not continue."""
        sheet = number[self.label[0]]
        same = (sheet[:, 0, :, None] == sheet[:, 1, None, :]) & (sheet[:, 0, :, None] >= 0)
        linked = self.partner[0][:, :, None] == np.arange(MOST)
        edge, slot, _ = np.nonzero(same & ~linked)
        return self.point[0][edge, 1], self.axis[0][edge], sheet[edge, 0, slot].astype(np.int64)

    def ends(self) -> tuple[Integers, Labels, Floats]:
        """Points of the grid at the edges' ends, each once, with their labels and angles (n, 2, 6)."""
        point, first = np.unique(self.point[0].ravel(), return_index=True)
        label = self.label[0].reshape(-1, MOST)[first]
        return point, label, self.angles[0].reshape(-1, 2, MOST)[first]


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
        columns = coefficient_columns(self.scene, values)
        rows = [np.broadcast_to(np.asarray(column, dtype=np.float64), len(places)) for column in columns]
        return np.where(inside[:, None], np.stack(rows, axis=1), np.nan)

    def depth(self, places: Floats, sign: float) -> Floats:
        """How deep (..., axes) is within the channel: the margin to the fold, times its sign [rad]."""
        flat = margins(np.ascontiguousarray(self.coefficients(places.reshape(-1, places.shape[-1]))))[0]
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


def continued(ground: Ground, start: Floats, end: Floats, count: int) -> tuple[Solution, Labels] | None:
    """The equilibria all along a way, and their labels: equal ones continue one another; None: no way."""
    places = way(ground, start, end, count)
    if places is None:
        return None
    rows = np.ascontiguousarray(ground.coefficients(places))
    found = solve_rows(rows)
    if not ((found.outcome == Outcome.COMPLETE) & (found.count == count)).all():
        return None
    n = len(rows)
    label = np.empty((n, MOST), dtype=np.int32)
    forest = Forest()
    forest.make_room(n)
    edges = Edges(np.empty((n, 2), np.int64), np.empty((n, MOST), np.int8), np.empty(1, np.int64))
    points = Points(rows, found.phi, found.theta, found.index, found.count)
    line = Place(0, 0, np.ones(1, dtype=np.int64), np.array([n]))
    regions = label_points(points, line, 0, forest.trees, label, edges)
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


@dataclass
class SheetBuilder:
    """Labels a grid in consecutive pieces and joins the labels to sheets in the end.

    Args:
        scene: gives every parameter that is no axis.
        axes: the grid, checked.
    """

    scene: Scene
    axes: Mapping[str, Floats]
    _labels: list[Labels] = field(default_factory=list)
    _forest: Forest = field(default_factory=Forest)
    _borders: Borders = field(default_factory=Borders)
    _done: int = 0
    _tail: tuple[NDArray[np.generic], ...] | None = None

    def add(self, coefficients: Floats, phi: Floats, theta: Floats, index: Codes, count: Codes) -> None:
        """Label the next points, at least one plane of the first axis or all."""
        lengths = np.array([len(values) for values in self.axes.values()], dtype=np.int64)
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
        forest.make_room(n)
        borders = np.empty((n * len(lengths), 2), dtype=np.int64)
        partners = np.empty((n * len(lengths), MOST), dtype=np.int8)
        filled = np.zeros(1, dtype=np.int64)
        own: Any = arrays
        place, edges = Place(ghosts, self._done - ghosts, strides, lengths), Edges(borders, partners, filled)
        forest.regions = label_points(Points(*own), place, forest.regions, forest.trees, label, edges)
        rows, axis = borders[: filled[0]].T
        self._borders.add(
            self._done - ghosts,
            rows,
            rows - strides[axis],
            axis,
            partners[: filled[0]],
            label,
            np.asarray(arrays[1], dtype=np.float64),
            np.asarray(arrays[2], dtype=np.float64),
        )
        plane = int(strides[0])
        self._tail = (*(array[-plane:].copy() for array in arrays), label[-plane:].copy())
        self._labels.append(label[ghosts:].copy() if ghosts else label)
        self._done += n

    def finish(self) -> Sheets:
        """The sheets of all that was added."""
        pieces, self._labels = self._labels, []
        forest, borders = self._forest, self._borders.joined()
        borders.resolve(forest)
        join_islands(Ground(self.scene, self.axes), forest, borders)
        borders.resolve(forest)
        size = np.zeros(forest.regions * RANKS + 1, dtype=np.int64)
        for piece in pieces:
            forest.resolve(piece)
            size += np.bincount(piece.ravel() + 1, minlength=size.size)
        size = size[1:]
        nodes = np.flatnonzero(size)
        morse = forest.morse.ravel()
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
        return Sheets(
            pieces, morse[first][order], np.asarray(in_order, dtype=np.int32), self._breaks(borders, number)
        )

    def _breaks(self, borders: Borders, number: Labels) -> NDArray[np.int32]:
        point, axis, sheet = borders.breaks(number)
        grid = tuple(len(values) for values in self.axes.values())
        where = np.unravel_index(point, grid)
        return np.stack([*where, axis, sheet], axis=1).astype(np.int32)
