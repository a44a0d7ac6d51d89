"""Sheets: each equilibrium's identity across a map.

A sheet is one equilibrium continued over parameters; it has at most one value at a point, and its Morse index
is the same everywhere. Sheets meet and end at folds. Regions (see ``fastmech.atlas.regions``) are joined
across folds by what survives there, the longest common border first, as long as no point gets a sheet twice.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fastmech.atlas.regions import RANKS, Labels, label_points, resolve_all
from fastmech.equilibria.search import MOST

Floats = NDArray[np.float64]
Codes = NDArray[np.int8]


@dataclass
class SheetBuilder:
    """Labels a grid in consecutive pieces and joins the labels to sheets in the end.

    Args:
        grid: lengths of the axes.
    """

    grid: tuple[int, ...]
    _labels: list[Labels] = field(default_factory=list)
    _parent: Labels = field(default_factory=lambda: np.zeros(0, dtype=np.int32))
    _rank: Codes = field(default_factory=lambda: np.zeros((0, RANKS), dtype=np.int8))
    _regions: int = 0
    _done: int = 0
    _links: dict[tuple[int, int], int] = field(default_factory=dict)
    _tail: tuple[NDArray[np.generic], ...] | None = None
    _index_of: dict[int, int] = field(default_factory=dict)

    def add(self, coefficients: Floats, phi: Floats, theta: Floats, index: Codes, count: Codes) -> None:
        """Label the next points, at least one plane of the first axis or all."""
        lengths = np.array(self.grid, dtype=np.int64)
        strides = np.array([int(np.prod(self.grid[k + 1 :])) for k in range(len(self.grid))], dtype=np.int64)
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
        room = self._regions + n
        if room > len(self._parent):
            self._parent = np.concatenate(
                [self._parent[: self._regions], np.empty(2 * n + 1024, dtype=np.int32)]
            )
            extra = np.empty((2 * n + 1024, RANKS), dtype=np.int8)
            self._rank = np.concatenate([self._rank[: self._regions], extra])
        loose = np.empty((n * len(self.grid) * MOST, 2), dtype=np.int32)
        filled = np.zeros(1, dtype=np.int64)
        self._regions = label_points(
            *arrays, ghosts, self._done - ghosts, strides, lengths, self._regions,
            self._parent, self._rank, label, loose, filled,
        )  # fmt: skip
        pairs, times = np.unique(loose[: filled[0]], axis=0, return_counts=True)
        for pair, number in zip(pairs, times, strict=True):
            key = (int(pair[0]), int(pair[1]))
            self._links[key] = self._links.get(key, 0) + int(number)
        plane = int(strides[0])
        self._tail = (*(array[-plane:].copy() for array in arrays), label[-plane:].copy())
        self._labels.append(label[ghosts:].copy() if ghosts else label)
        self._done += n
        new, first = np.unique(label[ghosts:], return_index=True)
        flat = index.ravel()
        for value, place in zip(new, first, strict=True):
            if value >= 0:
                self._index_of.setdefault(int(value), int(flat[place]))

    def finish(self) -> tuple[list[Labels], Codes]:
        """The sheets, an array (points, 6) for every ``add``, -1 where there is none; their Morse indices.

        Minima come first, then saddles, then maxima; in each of them the sheet of most points first.
        """
        pieces, self._labels = self._labels, []
        size = np.zeros(self._regions * RANKS + 1, dtype=np.int64)
        for piece in pieces:
            resolve_all(self._parent, self._rank, piece)
            size += np.bincount(piece.ravel() + 1, minlength=size.size)
        size = size[1:]
        index_of: dict[int, int] = {}
        for value, morse in self._index_of.items():
            index_of.setdefault(self._resolved(value), morse)
        groups = self._joined({node: {node // RANKS} for node in index_of})
        members: dict[int, list[int]] = {}
        for node, group in groups.items():
            members.setdefault(group, []).append(node)
        points = {group: sum(int(size[node]) for node in nodes) for group, nodes in members.items()}
        order = sorted(members, key=lambda group: (index_of[group], -points[group], group))
        number = np.full(self._regions * RANKS + 1, -1, dtype=np.int32)
        for rank, group in enumerate(order):
            number[members[group]] = rank
        for piece in pieces:
            piece[:] = number[piece]
        return pieces, np.array([index_of[group] for group in order], dtype=np.int8)

    def _resolved(self, label: int) -> int:
        region, k = divmod(label, RANKS)
        while self._parent[region] != region:
            region, k = int(self._parent[region]), int(self._rank[region, k])
        return region * RANKS + k

    def _joined(self, regions: dict[int, set[int]]) -> dict[int, int]:
        """Group of every label; ``regions`` says where a label is and is used up."""
        links: dict[tuple[int, int], int] = {}
        for (a, b), times in self._links.items():
            a, b = sorted((self._resolved(a), self._resolved(b)))
            links[a, b] = links.get((a, b), 0) + times
        group = {node: node for node in regions}

        def find(node: int) -> int:
            while group[node] != node:
                group[node] = group[group[node]]
                node = group[node]
            return node

        for (a, b), _ in sorted(links.items(), key=lambda item: (-item[1], item[0])):
            a, b = find(a), find(b)
            if a != b and regions[a].isdisjoint(regions[b]):
                group[b] = a
                regions[a] |= regions.pop(b)
        return {node: find(node) for node in group}
