"""The edges of a grid across which not every equilibrium continues: what is kept of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.atlas.regions import RANKS, Forest, Labels
from fastmech.equilibria.search import MOST

Integers = NDArray[np.int64]
Codes = NDArray[np.int8]
Floats = NDArray[np.float64]


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

    def links(self) -> NDArray[np.int64]:
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


def region_of(label: Labels) -> NDArray[np.int64]:
    """Region of every row of labels (n, 6) with an equilibrium in the first slots, -1 where it has none."""
    return np.where((label >= 0).any(axis=1), label.max(axis=1) // RANKS, -1).astype(np.int64)
