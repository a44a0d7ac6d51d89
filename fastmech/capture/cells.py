"""Cells of the domain of coordinates: bounds of the potential over each, and floods through them.

A set {U < E} is open: a path in it can be moved off the corners and edges of cells, so that it passes from
cell to cell through faces. Where it can go at most is told by the least U of cells, where it can surely go by
the greatest.
"""

from __future__ import annotations

from heapq import heappop, heappush
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.arrays import Floats, Integers
from fastmech.intervals.arithmetic import mul, sub
from fastmech.intervals.search import ENERGY, FORCES, positive_eigenvalues
from fastmech.jit import CUBE, EXACT, INTEGERS, MATRIX, VECTOR, kernel

#: Turns of a coordinate, either way, that a cell's number can hold, and numbers of wells before them.
MOST_TURNS, WELL_DIGITS = 4, 128

#: Cells are taken this much larger than they are: positions are assigned to them with rounding.
ENLARGED = 1e-9

#: Halvings of a box about a minimum at most, and the share of the proved one that is used.
HALVINGS, WITHIN = 40, 0.999

_FLAGS = types.Array(types.int8, 1, "C")


@kernel(types.void(ENERGY, FORCES, MATRIX, MATRIX, INTEGERS, MATRIX, types.int64), **EXACT)
def bound_cells(energy: Any, forces: Any, domain: Any, p: Any, counts: Any, bounds: Any, end: int) -> None:
    """Write the least and the greatest U of every cell into ``bounds`` (cells, 2).

    Both by the enclosure over the cell and by the mean-value form, which is the closer one in small cells.
    Over parts of an end the greatest is -inf where no component of {U < E} can come to it first, by itself:
    near a place from which U falls along the end or out of it, the component holds lower places of the end.

    Args:
        energy: see :data:`fastmech.intervals.search.ENERGY_SIGNATURE`; rates are zero here.
        forces: enclosures of -dU/dq.
        domain: lowest and highest value of each coordinate (n, 2 or more).
        p: parameters (count, 2).
        counts: cells along each coordinate (n,).
        bounds: what is written, cells in C order.
        end: k for the high end of the k-th range, from 1, of which the domain is a part; -k for the low end.
    """
    n = len(counts)
    box, still, middle = np.zeros((n, 2)), np.zeros((n, 2)), np.zeros((n, 2))
    f, J, found = np.zeros((n, 2)), np.zeros((n, n, 2)), np.zeros(2)
    for cell in range(len(bounds)):
        rest = cell
        for i in range(n - 1, -1, -1):
            k = rest % counts[i]
            rest //= counts[i]
            width = (domain[i, 1] - domain[i, 0]) / counts[i]
            box[i, 0] = domain[i, 0] + (k - ENLARGED) * width
            box[i, 1] = domain[i, 0] + (k + 1.0 + ENLARGED) * width
            middle[i, 0] = middle[i, 1] = 0.5 * box[i, 0] + 0.5 * box[i, 1]
        energy(box, still, p, found)
        low, high = found[0], found[1]
        energy(middle, still, p, found)
        value = (found[0], found[1])
        forces(box, p, f, J)
        for i in range(n):
            away = sub((box[i, 0], box[i, 1]), (middle[i, 0], middle[i, 0]))
            value = sub(value, mul((f[i, 0], f[i, 1]), away))
        bounds[cell, 0], bounds[cell, 1] = max(low, value[0]), min(high, value[1])
        for i in range(n):
            if end != 0 and ((f[i, 0] > 0.0 and end != -1 - i) or (f[i, 1] < 0.0 and end != 1 + i)):
                bounds[cell, 1] = -np.inf


@kernel(types.void(MATRIX, VECTOR, INTEGERS, _FLAGS, _FLAGS, types.int64, VECTOR, VECTOR), **EXACT)
def first_exit(
    low: Any, passes: Any, counts: Any, periodic: Any, marks: Any, start: int, keys: Any, found: Any
) -> None:
    """A bound below the energy at which a well's component can first meet another well or an end of a range.

    Cells are flooded in the order of the least energy that reaches them, until the flood comes to another
    minimum's cell, to a cell that it holds with other turns or to one at an end, and to the next pass.

    Args:
        low: the least U of every cell, and on its parts of ends, infinite without one (cells, 2).
        passes: energies, with one of which the way may be open.
        counts: cells along each coordinate.
        periodic: 1 of coordinates that turn fully.
        marks: of every cell 0, or the number of the minimum in it, from 1 (127: of several).
        start: the minimum's cell.
        keys: where the energy is written from which on the flood reaches each cell; infinite before, but
            for the minimum's cell, of which it is given.
        found: where that bound is written (1,).
    """
    n, cells = len(counts), len(low)
    state, turns = np.zeros(cells, np.int8), np.zeros((cells, n), np.int8)
    found[0], last = np.inf, np.inf
    heap, state[start] = [(keys[start], start)], 1
    while heap:
        key, cell = heappop(heap)
        if key > last:
            break
        state[cell], keys[cell] = 2, key
        met = marks[cell] != 0 and (marks[cell] != marks[start] or marks[cell] == 127)
        rest, stride = cell, 1
        for i in range(n - 1, -1, -1):
            k = rest % counts[i]
            rest //= counts[i]
            for side in (-1, 1):
                turned = 0
                near = k + side
                if near < 0 or near >= counts[i]:
                    if periodic[i] == 0:
                        continue
                    turned = side
                    near -= side * counts[i]
                other = cell + (near - k) * stride
                if state[other] == 0:
                    for j in range(n):
                        turns[other, j] = turns[cell, j]
                    turns[other, i] += turned
                    met |= abs(turns[other, i]) > MOST_TURNS
                    state[other] = 1
                    heappush(heap, (max(key, low[other, 0]), other))
                elif state[other] == 2:
                    for j in range(n):
                        met |= turns[other, j] != turns[cell, j] + (turned if j == i else 0)
            stride *= counts[i]
        energy = key if met else max(key, low[cell, 1])
        if energy < found[0]:
            found[0], last = energy, np.inf
            for level in passes:
                if energy <= level < last:
                    last = level


@kernel(
    types.void(VECTOR, INTEGERS, _FLAGS, types.int64, INTEGERS, types.float64, types.int64, VECTOR), **EXACT
)
def fill_component(
    high: Any, counts: Any, periodic: Any, start: int, first: Any, level: float, well: int, table: Any
) -> None:
    """Write a well's number, and its turns, into the cells from which a path below ``level`` leads to it.

    ``table`` holds 0 where nothing is proved, else 1 + well + 128 (turns + 4, to the base of 9, the last
    coordinate's last): those of the well from its listed place for a position in the domain. ``first`` are
    the turns that bring the listed place into the domain, with the other sign.
    """
    n, cells = len(counts), len(high)
    if not high[start] < level:
        return
    queue, turns = np.empty(cells, np.int64), np.zeros((cells, n), np.int8)
    queue[0], begin, end = start, 0, 1
    code = 0
    for j in range(n):
        turns[start, j] = first[j]
        code = code * (2 * MOST_TURNS + 1) + MOST_TURNS - first[j]
    table[start] = 1.0 + well + WELL_DIGITS * code
    while begin < end:
        cell = queue[begin]
        begin += 1
        rest, stride = cell, 1
        for i in range(n - 1, -1, -1):
            k = rest % counts[i]
            rest //= counts[i]
            for side in (-1, 1):
                turned = 0
                near = k + side
                if near < 0 or near >= counts[i]:
                    if periodic[i] == 0:
                        continue
                    turned = side
                    near -= side * counts[i]
                other = cell + (near - k) * stride
                if table[other] != 0.0 or not high[other] < level:
                    continue
                if abs(turns[cell, i] + turned) > MOST_TURNS:
                    continue
                code = 0
                for j in range(n):
                    turns[other, j] = turns[cell, j] + (turned if j == i else 0)
                    code = code * (2 * MOST_TURNS + 1) + MOST_TURNS - int(turns[other, j])
                table[other] = 1.0 + well + WELL_DIGITS * code
                queue[end] = other
                end += 1
            stride *= counts[i]


@kernel(types.void(FORCES, MATRIX, MATRIX, VECTOR, VECTOR), **EXACT)
def convex_box(forces: Any, domain: Any, p: Any, q: Any, half: Any) -> None:
    """Halve a box about a minimum ``q`` (n,) until U is proved convex in it; zero where that fails.

    ``half`` (n,) are its half widths; ``forces``, ``domain`` and ``p`` as in :func:`bound_cells`.
    """
    n = len(q)
    box, f, J = np.zeros((n, 2)), np.zeros((n, 2)), np.zeros((n, n, 2))
    H, A, V = np.zeros((n, n, 2)), np.zeros((n, n)), np.zeros((n, n))
    for _ in range(HALVINGS):
        inside = True
        for i in range(n):
            box[i, 0], box[i, 1] = q[i] - half[i], q[i] + half[i]
            inside &= domain[i, 2] > 0.0 or (box[i, 0] >= domain[i, 0] and box[i, 1] <= domain[i, 1])
        if inside and forces(box, p, f, J):
            for i in range(n):
                for j in range(n):
                    H[i, j, 0], H[i, j, 1] = -J[i, j, 1], -J[i, j, 0]
            if positive_eigenvalues(H, A, V) == n:
                for i in range(n):
                    half[i] *= WITHIN
                return
        for i in range(n):
            half[i] *= 0.5
    for i in range(n):
        half[i] = 0.0


@kernel(types.void(ENERGY, MATRIX, CUBE, CUBE, MATRIX), **EXACT)
def bound_states(energy: Any, p: Any, q: Any, v: Any, bounds: Any) -> None:
    """The least and the greatest T + U (m, 2) over boxes of coordinates and rates (m, n, 2)."""
    for k in range(len(bounds)):
        energy(q[k], v[k], p, bounds[k])


class Cells(NamedTuple):
    """Bounds of the potential over cells of the domain."""

    domain: Floats  #: lowest and highest value of each coordinate and its period, 0 if it has none (n, 3)
    counts: Integers  #: cells along each coordinate (n,)
    bounds: Floats  #: least and greatest U [J] (cells, 2)

    @property
    def periodic(self) -> NDArray[np.int8]:
        """1 of coordinates that turn fully."""
        return (self.domain[:, 2] > 0.0).astype(np.int8)

    @property
    def widths(self) -> Floats:
        """Of cells, by coordinate."""
        return np.asarray((self.domain[:, 1] - self.domain[:, 0]) / self.counts)

    @property
    def scale(self) -> float:
        """How much U varies [J], or a tenth of its size where an offset is larger: the scale of rounding."""
        finite = self.bounds[np.isfinite(self.bounds).all(axis=1)]
        return float(max(np.ptp(finite), 0.1 * np.abs(finite).max())) if len(finite) else 0.0

    def place(self, q: Floats) -> tuple[int, Integers]:
        """The cell of a position (n,), and the turns by which the position lies off the domain."""
        period = self.domain[:, 2]
        turns = np.floor((q - self.domain[:, 0]) / np.where(period > 0.0, period, np.inf))
        k = np.floor((q - turns * period - self.domain[:, 0]) / self.widths).astype(np.int64)
        index = np.clip(k, 0, self.counts - 1)
        return int(np.ravel_multi_index(tuple(index), tuple(self.counts))), turns.astype(np.int64)

    def table(self, places: Floats, levels: Floats) -> Floats:
        """Wells at places (wells, n), and turns, by cell, see :func:`fill_component`; paths below levels."""
        found = np.zeros(len(self.bounds))
        high = np.ascontiguousarray(self.bounds[:, 1])
        for well, (place, level) in enumerate(zip(places, levels, strict=True)):
            own = self.counts, self.periodic, *self.place(place)
            fill_component(high, *own, level=level, well=well, table=found)
        return found
