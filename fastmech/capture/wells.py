"""Wells of a mechanism and their barriers, proved on cells of its domain.

The barrier of a well is the least energy at which its component of {U < E} meets another well, a copy of
itself some turns away, or an end of a range. Either it grows over a saddle with one falling direction
(Morse): the lowest that joins it to something else, as ways down from both its sides prove. Where they do
not, a flood through cells, whose bounds are outward, tells an energy below which it meets nothing, and so it
grows no earlier than at the lowest such saddle above that. Or it comes to an end by itself, at a place from
which U falls inwards and nowhere along the end: no earlier than at the least U on parts of ends with such
places that the flood has reached at that U, which are cut until it is known to rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from heapq import heapify, heappop, heappush
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats, Integers
from fastmech.callee import callee
from fastmech.capture.cells import Cells, bound_cells, bound_states, convex_box, first_exit
from fastmech.capture.passes import WaysDown
from fastmech.errors import InputError, shown
from fastmech.models.equilibria import RestingPlaces, domain_of, find_equilibria
from fastmech.models.mechanism import Mechanism
from fastmech.objects import Printed

#: Cells along a coordinate, by the number of coordinates; odd, so that the middle of a range is inside one.
SIDES = {1: 8191, 2: 255, 3: 61, 4: 23}

#: Pieces along a coordinate into which parts of ends are cut, by the number of coordinates, and cuts at most.
PIECES, CUTS = {1: 1, 2: 16, 3: 6, 4: 4}, 2000

#: Share of the range of U by which barriers are lowered: rounding of energies in compiled loops is far less.
ROUNDING = 1e-11

#: The mark of a cell with several minima, or with what is not decided.
SEVERAL = 127

#: A minimum is in a cell if it is so near to it, in widths.
NEAR = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class Wells(Printed):
    """The wells of a potential, and what parts them."""

    equilibria: Any
    wells: tuple[int, ...]  #: which equilibria are minima, the deepest first
    barrier: Floats  #: energy [J] below which each well's component is proved to hold no other; (wells,)
    passes: tuple[int | None, ...]
    """The saddle there, proved to lead out; None: one that is not, an end of a range, what is not decided, or
    no exit."""

    def told(self) -> str:
        """Each well, how deep it is, and the way out of it."""
        lines = []
        saddles = {e.energy: k for k, e in enumerate(self.equilibria) if e.morse_index == 1}
        for well, barrier, saddle in zip(self.wells, self.barrier, self.passes, strict=True):
            depth = barrier - self.equilibria[well].energy
            over = f"over equilibrium {saddle}" if saddle is not None else "to an end or what is not decided"
            if saddle is None and barrier in saddles:
                over = f"to equilibrium {saddles[barrier]}, which is not proved to lead out"
            over = over if np.isfinite(depth) else "anywhere"
            least = "at least " * self.bounded(well)
            lines.append(f"{self.named(well)}: {least}{depth:.6g} J {over}")
        return "\n".join(lines)

    def bounded(self, k: int) -> bool:
        """Whether the barrier of a well, by its equilibrium's number, may be higher than is proved."""
        row = self.wells.index(k)
        return self.passes[row] is None and bool(np.isfinite(self.barrier[row]))

    def named(self, k: int) -> str:
        """An equilibrium's number among the wells, as pictures have it, and in the list, and where it is."""
        number = sum(e.morse_index == 0 for e in self.equilibria[:k])
        listed = "" if number == k else f" (equilibrium {k})"
        return f"well {number}{listed} at {self.equilibria.place(k)}"


@dataclass(frozen=True, eq=False, repr=False)
class ProvedWells(Wells):
    """The wells of a mechanism: minima of U, loads at their means."""

    mechanism: Mechanism
    cells: Cells

    @cached_property
    def radius(self) -> Floats:
        """Half widths of boxes about each well in which U is proved convex (wells, n); 0: of none."""
        from fastmech.models.balance import balance_kernel  # SymPy: only where a mechanism is there

        forces = callee(balance_kernel(self.mechanism.statics()))
        radius = np.tile(8.0 * self.cells.widths, (len(self.wells), 1))
        domain, p = self.cells.domain, values_of(self.mechanism)
        for half, well in zip(radius, self.wells, strict=True):
            convex_box(forces, domain, p, self.equilibria[well].position.copy(), half)
        return radius


def require_potential(mechanism: Mechanism) -> None:
    """Refuse what has no wells.

    Raises:
        InputError: its forces are not known to have a potential.
    """
    if mechanism.energy() is None:
        raise InputError(
            f"{mechanism.name}: has forces that are not known to come from a potential; wells and labels "
            f"are for potentials, gravity, springs and loads in fixed directions{damping_as_force(mechanism)}"
        )


def damping_as_force(mechanism: Mechanism) -> str:
    """What to do where generalized forces of rates may be meant as dampers; empty without such forces."""
    told = "; damping given as a generalized force is not known as such: write it as dissipation= or a damper"
    return told * any(force.free_symbols & {*mechanism._rates} for force in mechanism._parts.forces)


def prove_wells(mechanism: Mechanism) -> ProvedWells:
    """The wells of a mechanism, loads at their means, with proved barriers.

    Raises:
        InputError: its forces are not known to have a potential, U changes with a full turn, a range is not
            finite, U is not defined everywhere, or no well is proved. Places of which it is not decided what
            equilibria they hold, such as where equilibria merge, count as further wells and as passes at the
            least U there, or where the flood comes to one. Peaks where a spring has length zero do not.
    """
    from fastmech.models.balance import balance_kernel, energy_kernel  # SymPy, as above

    require_potential(mechanism)
    equilibria = find_equilibria(mechanism)
    assert isinstance(equilibria, RestingPlaces)
    left = equilibria.certificate.places
    if not (equilibria.certificate.complete or left):
        raise InputError(f"{mechanism.name}: its wells are not certain: {equilibria.certificate.sentence}")
    domain, p = domain_of(mechanism.statics()), values_of(mechanism)
    n = len(domain)
    cells = Cells(domain, np.full(n, SIDES[n]), np.empty((SIDES[n] ** n, 2)))
    energies, forces = callee(energy_kernel(mechanism)), callee(balance_kernel(mechanism.statics()))
    bound_cells(energies, forces, domain, p, cells.counts, bounds=cells.bounds, end=0)
    ends = _Ends.of(cells, partial(bound_cells, energies, forces, p=p))
    boxes = np.array([[place.low, place.high] for place in left]).reshape(-1, 2, n)
    _require_defined(mechanism, cells, boxes.reshape(-1, n))
    energy = np.array([place.energy for place in equilibria])
    index = np.array([place.morse_index for place in equilibria])
    wells = np.flatnonzero(index == 0)
    if not wells.size:
        told = " that is proved" if left else ""
        raise InputError(f"{mechanism.name}: has no well{told}: {equilibria.certificate.sentence}")
    wells = wells[np.argsort(energy[wells], kind="stable")]
    marks = np.zeros(tuple(cells.counts), dtype=np.int8)
    for number, well in enumerate(wells, 1):
        here = _cells_of(cells, *[equilibria[int(well)].position] * 2)
        marks[here] = np.where(np.isin(marks[here], (0, number)), number, SEVERAL)
    for well in np.flatnonzero(index < 0):
        marks[_cells_of(cells, *[equilibria[int(well)].position] * 2)] = SEVERAL
    for place in left:
        marks[_cells_of(cells, place.low, place.high)] = SEVERAL
    # What is not decided may hold wells and passes, none lower than U there.
    boxes = boxes.transpose(0, 2, 1).copy()
    over = np.empty((len(boxes), 2))
    bound_states(energies, p, boxes, np.zeros_like(boxes), over)
    slack = ROUNDING * cells.scale
    ways = WaysDown(mechanism, equilibria, wells, domain, energies, forces=forces, p=p, slack=slack)
    passing = np.flatnonzero((index == 1) | (index < 0))
    joined = [ways.joined(int(place)) if index[place] == 1 else None for place in passing]
    undecided = [True] * len(over)
    levels, most = (np.concatenate([energy[passing], end]) for end in over.T)
    low = np.stack([cells.bounds[:, 0], ends.low(len(cells.bounds))], axis=1)
    barrier, passes, first = np.empty(len(wells)), list[int | None](), np.empty(1)
    for row, well in enumerate(wells):
        start, _ = cells.place(equilibria[int(well)].position)
        flooded, keys = (cells.counts, cells.periodic, marks.ravel()), np.full(len(low), np.inf)
        keys[start] = energy[well] - slack
        # A saddle that is proved to join others, or the well to itself, is no way out of it.
        ways_out = [
            way is None or (way[0] != way[1] and well in (way[0].well, way[1].well)) for way in joined
        ]
        may_open = np.array([*ways_out, *undecided], dtype=np.bool_)
        first_exit(low, most[may_open] + slack, *flooded, start=start, keys=keys, found=first)
        met = may_open & (most >= first - slack) & (first < np.inf)
        above = np.where(met, np.maximum(levels, first - slack), np.inf)
        lowest = int(np.argmin(above)) if above.size else 0
        out = float(above[lowest]) if above.size else np.inf
        barrier[row] = max(min(out, end := ends.least(keys, out, slack)), float(energy[well]))
        sure = out < end and lowest < len(passing) and joined[lowest] is not None
        passes.append(int(passing[lowest]) if sure else None)
    return ProvedWells(equilibria, tuple(wells.tolist()), barrier, tuple(passes), mechanism, cells=cells)


class _Ends(NamedTuple):
    """Parts of cells on ends of ranges."""

    bound: Callable[..., None]  #: writes bounds of U over pieces of a box
    pieces: int  #: along each coordinate
    cells: Integers  #: of which cells they are part (parts,)
    ends: Integers  #: of which end, see :func:`fastmech.capture.cells.bound_cells` (parts,)
    boxes: Floats  #: (parts, n, 2)
    bounds: Floats  #: least and greatest U [J], which is -inf where no component comes by itself (parts, 2)

    @classmethod
    def of(cls, cells: Cells, bound: Callable[..., None]) -> _Ends:
        """All of them."""
        n, numbers = len(cells.counts), np.arange(len(cells.bounds)).reshape(cells.counts)
        own, ends = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
        boxes, bounds = [np.empty((0, n, 2))], [np.empty((0, 2))]
        for k in np.flatnonzero(cells.domain[:, 2] == 0.0):
            counts = np.where(np.arange(n) == k, 1, cells.counts)
            for side in (0, 1):
                face = cells.domain[:, :2].copy()
                face[k] = cells.domain[k, side]
                own.append(numbers.take(-side, axis=k).ravel())
                ends.append(np.full(counts.prod(), (2 * side - 1) * (k + 1)))
                boxes.append(_cut(face, counts))
                bounds.append(np.empty((counts.prod(), 2)))
                bound(face, counts=counts, bounds=bounds[-1], end=ends[-1][0])
        numbered = np.concatenate(own), np.concatenate(ends)
        return cls(bound, PIECES[n], *numbered, np.concatenate(boxes), bounds=np.concatenate(bounds))

    def low(self, cells: int) -> Floats:
        """The least U on a cell's parts of ends (cells,); infinite without one."""
        found = np.full(cells, np.inf)
        np.minimum.at(found, self.cells, self.bounds[:, 0])
        return found

    def least(self, keys: Floats, below: float, slack: float) -> float:
        """The least energy at which a component comes to an end by itself, from below, within ``slack``.

        ``keys`` are the energies from which on cells are reached; an energy that is not ``below`` is enough.
        """
        key = keys[self.cells]
        low, high = np.maximum(key, self.bounds[:, 0]), self.bounds[:, 1]
        some = np.flatnonzero((low <= below) & (key <= high))
        heap = [
            (float(low[k]), int(k), float(high[k]), float(key[k]), int(self.ends[k]), self.boxes[k])
            for k in some
        ]
        heapify(heap)
        made = len(self.cells)
        for _ in range(CUTS):
            if not heap or heap[0][0] >= below or heap[0][2] - heap[0][0] <= slack:
                break
            value, _, _, reached, end, box = heappop(heap)
            counts = np.where(box[:, 1] > box[:, 0], self.pieces, 1)
            bounds = np.empty((counts.prod(), 2))
            self.bound(box, counts=counts, bounds=bounds, end=end)
            for piece, (lower, upper) in zip(_cut(box, counts), bounds, strict=True):
                made += 1
                if reached <= upper:
                    heappush(heap, (max(value, lower), made, upper, reached, end, piece))
        return heap[0][0] if heap else np.inf


def _cut(box: Floats, counts: Integers) -> Floats:
    """Pieces (pieces, n, 2) of a box, in C order."""
    width = (box[:, 1] - box[:, 0]) / counts
    low = box[:, 0] + width * np.stack(np.unravel_index(np.arange(counts.prod()), counts), axis=-1)
    return np.stack([low, low + width], axis=-1)


def _cells_of(cells: Cells, low: Floats, high: Floats) -> tuple[NDArray[np.intp], ...]:
    """Cells that a box has something of, or nearly, as :func:`numpy.ix_` gives them."""
    first, last = (
        np.floor((end - cells.domain[:, 0]) / cells.widths + near).astype(np.int64)
        for end, near in ((low, -NEAR), (high, NEAR))
    )
    rows = []
    for begin, end, count, period in zip(first, last, cells.counts, cells.domain[:, 2], strict=True):
        row = np.arange(begin, min(end, begin + count - 1) + 1)
        rows.append(row % count if period else np.clip(row, 0, count - 1))
    return np.ix_(*rows)


def values_of(mechanism: Mechanism) -> Floats:
    """Values of parameters as intervals (count, 2)."""
    return np.repeat(np.array(list(mechanism.parameters.values()), dtype=np.float64)[:, None], 2, axis=1)


def _require_defined(mechanism: Mechanism, cells: Cells, places: Floats) -> None:
    """Refuse a U that has no value or no bottom, or that another turn changes, as a constant torque's does.

    It is looked at in ``places`` (m, n) too: beside a pole it lies further below the rest than that varies.

    Raises:
        InputError: it does.
    """
    random, (domain, n) = np.random.default_rng(0), (cells.domain, len(cells.domain))
    y = np.zeros((64 + len(places), 2 * n))
    y[:, :n] = np.concatenate([random.uniform(domain[:, 0], domain[:, 1], (64, n)), places])
    before = mechanism.evaluate("bounding", y.T)[0]
    low = cells.bounds[np.isfinite(cells.bounds).all(axis=1), 0].min(initial=np.inf) - cells.scale
    for at in y[~(before >= low)]:
        where = ", ".join(f"{q} = {value:.3g}" for q, value in zip(mechanism.state, at[:n], strict=False))
        raise InputError(f"{mechanism.name}: its potential is not defined everywhere, as at {where}")
    y, before = y[:64], before[:64]
    for k in np.flatnonzero(domain[:, 2]):
        turned = y.copy()
        turned[:, k] += 2.0 * np.pi
        after = mechanism.evaluate("bounding", turned.T)[0]
        if not np.allclose(before, after, rtol=0.0, atol=1e-6 * float(np.ptp(before) or 1.0)):
            name = shown(mechanism.state[int(k)])
            raise InputError(f"{mechanism.name}: its potential is another one after a full turn of {name}")
