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
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.atlas.borders import Borders
from fastmech.atlas.channels import Ground
from fastmech.atlas.joining import branches, join_islands, separate
from fastmech.atlas.regions import RANKS, Edges, Forest, Labels, Place, Points, label_points
from fastmech.equilibria.search import MOST
from fastmech.scene import Scene

Floats = NDArray[np.float64]
Codes = NDArray[np.int8]


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
