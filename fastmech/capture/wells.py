"""Wells of a mechanism and their barriers, proved on cells of its domain.

The barrier of a well is the least energy at which its component of {U < E} meets another well, a copy of
itself some turns away, or an end of a range. The first two happen at saddles with one falling direction and
nowhere else (Morse): a flood through cells, whose bounds are outward, tells an energy below which they cannot
happen, and so they happen no earlier than at the lowest such saddle above it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats, Integers
from fastmech.callee import callee
from fastmech.capture.cells import bound_cells, bound_states, convex_box, fill_component, first_exits
from fastmech.errors import InputError, shown
from fastmech.models.balance import balance_kernel, energy_kernel
from fastmech.models.equilibria import Place, RestingPlaces, domain_of, find_equilibria
from fastmech.models.mechanism import Mechanism

#: Cells along a coordinate, by the number of coordinates; odd, so that the middle of a range is inside one.
SIDES = {1: 8191, 2: 255, 3: 61, 4: 23}

#: Share of the range of U by which barriers are lowered: rounding of energies in compiled loops is far less.
ROUNDING = 1e-11

#: The mark of a cell with several minima, or with what is not decided.
SEVERAL = 127

#: A minimum is in a cell if it is so near to it, in widths.
NEAR = 1e-6


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


@dataclass(frozen=True, eq=False, repr=False)
class Wells:
    """The wells of a mechanism: minima of U, loads at their means, and what parts them."""

    mechanism: Mechanism
    equilibria: RestingPlaces
    wells: tuple[int, ...]  #: which equilibria are minima, the deepest first
    barrier: Floats  #: energy [J] below which each well's component is proved to hold no other; (wells,)
    passes: tuple[
        int | None, ...
    ]  #: the saddle there; None: an end of a range, an undecided place, or no exit
    cells: Cells

    def __repr__(self) -> str:
        lines = []
        for well, barrier, saddle in zip(self.wells, self.barrier, self.passes, strict=True):
            depth = barrier - self.equilibria[well].energy
            over = f"over equilibrium {saddle}" if saddle is not None else "to an end or an undecided place"
            over = over if np.isfinite(depth) else "anywhere"
            lines.append(f"well {well} at {self.equilibria.place(well)}: {depth:.6g} J {over}")
        return "\n".join(lines)

    @cached_property
    def radius(self) -> Floats:
        """Half widths of boxes about each well in which U is proved convex (wells, n); 0: of none."""
        forces = callee(balance_kernel(self.mechanism.statics()))
        radius = np.tile(8.0 * self.cells.widths, (len(self.wells), 1))
        for half, well in zip(radius, self.wells, strict=True):
            convex_box(
                forces,
                self.cells.domain,
                values_of(self.mechanism),
                self.equilibria[well].position.copy(),
                half,
            )
        return radius

    def table(self, levels: Floats) -> Floats:
        """Wells and turns by cell, see :func:`~.cells.fill_component`, by paths below wells' levels."""
        found = np.zeros(len(self.cells.bounds))
        high = np.ascontiguousarray(self.cells.bounds[:, 1])
        for row, well in enumerate(self.wells):
            start, first = self.cells.place(self.equilibria[well].position)
            fill_component(
                high, self.cells.counts, self.cells.periodic, start, first, levels[row], row, found
            )
        return found


def prove_wells(mechanism: Mechanism) -> Wells:
    """The wells of a mechanism, loads at their means, with proved barriers.

    Raises:
        InputError: its forces are not known to have a potential, U changes with a full turn, a range is not
            finite, or no well is proved. Places of which it is not decided what equilibria they hold, such as
            a spring at length zero, count as further wells and as passes at the least U there.
    """
    if mechanism.energy() is None:
        raise InputError(
            f"{mechanism.name}: has forces that are not known to come from a potential; wells and labels "
            "are for potentials, gravity, springs and loads in fixed directions"
        )
    equilibria = find_equilibria(mechanism)
    assert isinstance(equilibria, RestingPlaces)
    left = equilibria.certificate.places
    if not (equilibria.certificate.complete or left):
        raise InputError(f"{mechanism.name}: its wells are not certain: {equilibria.certificate.sentence}")
    domain, p = domain_of(mechanism.statics()), values_of(mechanism)
    n = len(domain)
    cells = Cells(domain, np.full(n, SIDES[n]), np.empty((SIDES[n] ** n, 2)))
    energies, forces = callee(energy_kernel(mechanism)), callee(balance_kernel(mechanism.statics()))
    bound_cells(energies, forces, domain, p, cells.counts, cells.bounds)
    _require_periodic(mechanism, domain)
    energy = np.array([place.energy for place in equilibria])
    index = np.array([place.morse_index for place in equilibria])
    wells = np.flatnonzero(index == 0)
    if not wells.size:
        raise InputError(f"{mechanism.name}: has no well that is proved: {equilibria.certificate.sentence}")
    wells = wells[np.argsort(energy[wells], kind="stable")]
    marks = np.zeros(len(cells.bounds), dtype=np.int8)
    for number, well in enumerate(wells, 1):
        for cell in _cells_near(cells, equilibria[int(well)].position):
            marks[cell] = number if marks[cell] in (0, number) else SEVERAL
    for well in np.flatnonzero(index < 0):
        marks[list(_cells_near(cells, equilibria[int(well)].position))] = SEVERAL
    for place in left:
        _mark(cells, marks, place)
    # What is not decided may hold wells and passes, none lower than U there.
    boxes = np.array([[place.low, place.high] for place in left]).reshape(-1, 2, n).transpose(0, 2, 1).copy()
    over = np.empty((len(boxes), 2))
    bound_states(energies, p, boxes, np.zeros_like(boxes), over)
    passing = np.flatnonzero((index == 1) | (index < 0))
    levels = np.concatenate([energy[passing], over[:, 0]])
    low = np.ascontiguousarray(cells.bounds[:, 0])
    slack = ROUNDING * cells.scale
    barrier, passes, exits = np.empty(len(wells)), list[int | None](), np.empty(2)
    for row, well in enumerate(wells):
        start, _ = cells.place(equilibria[int(well)].position)
        first_exits(low, cells.counts, cells.periodic, marks, start, exits)
        above = np.where((levels >= exits[0] - slack) & (exits[0] < np.inf), levels, np.inf)
        lowest = int(np.argmin(above)) if above.size else 0
        out = float(above[lowest]) if above.size else np.inf
        barrier[row] = min(out, exits[1])
        passes.append(int(passing[lowest]) if out < exits[1] and lowest < len(passing) else None)
    return Wells(mechanism, equilibria, tuple(wells.tolist()), barrier, tuple(passes), cells)


def _mark(cells: Cells, marks: NDArray[np.int8], place: Place) -> None:
    """Mark the cells of a place of which it is not decided what it holds."""
    first = np.floor((place.low - cells.domain[:, 0]) / cells.widths - NEAR).astype(np.int64)
    last = np.floor((place.high - cells.domain[:, 0]) / cells.widths + NEAR).astype(np.int64)
    rows = []
    for begin, end, count, period in zip(first, last, cells.counts, cells.domain[:, 2], strict=True):
        row = np.arange(begin, min(end, begin + count - 1) + 1)
        rows.append(row % count if period else np.clip(row, 0, count - 1))
    marks.reshape(tuple(cells.counts))[np.ix_(*rows)] = SEVERAL


def values_of(mechanism: Mechanism) -> Floats:
    """Values of parameters as intervals (count, 2)."""
    return np.repeat(np.array(list(mechanism.parameters.values()), dtype=np.float64)[:, None], 2, axis=1)


def _cells_near(cells: Cells, q: Floats) -> set[int]:
    """Cells that hold a position (n,), or nearly."""
    n = len(q)
    corners = np.stack(np.meshgrid(*[(-NEAR, NEAR)] * n, indexing="ij"), axis=-1).reshape(-1, n)
    return {cells.place(q + corner * cells.widths)[0] for corner in corners}


def _require_periodic(mechanism: Mechanism, domain: Floats) -> None:
    """Refuse a U that another turn changes, as a constant torque's does.

    Raises:
        InputError: it does.
    """
    random, n = np.random.default_rng(0), len(domain)
    y = np.zeros((64, 2 * n))
    y[:, :n] = random.uniform(domain[:, 0], domain[:, 1], (64, n))
    before = mechanism.evaluate("bounding", y.T)[0]
    for k in np.flatnonzero(domain[:, 2]):
        turned = y.copy()
        turned[:, k] += 2.0 * np.pi
        after = mechanism.evaluate("bounding", turned.T)[0]
        if not np.allclose(before, after, rtol=0.0, atol=1e-6 * float(np.ptp(before) or 1.0)):
            name = shown(mechanism.state[int(k)])
            raise InputError(f"{mechanism.name}: its potential is another one after a full turn of {name}")
