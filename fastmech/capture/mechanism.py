"""The capture certificate of any mechanism whose energy falls and whose loads fade.

The bounding energy is T + U with loads at what they come to, and all work that they can still do. A position
belongs to a well by the cells of :mod:`fastmech.capture.mechanism`, or by a box about the well in which U is
convex: the way straight to the minimum does not rise.

Wells of a mechanism and their barriers, proved on cells of its domain. The barrier of a well is the least
energy at which its component of {U < E} meets another well, a copy of itself some turns away, or an end of a
range. The first two happen at saddles with one falling direction and nowhere else (Morse): a flood through
cells, whose bounds are outward, tells an energy below which they cannot happen, and so they happen no earlier
than at the lowest such saddle above it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats, Integers
from fastmech.callee import callee
from fastmech.capture.cells import bound_cells, bound_states, convex_box, fill_component, first_exits
from fastmech.capture.certificate import (
    MOST_OCTAVES,
    PHASE,
    TURNING,
    CaptureCertificate,
    Early,
    Noted,
)
from fastmech.capture.observe import HEAD, RECORD, TABLE_ROWS
from fastmech.ensembles.ends import STOP_CODE
from fastmech.ensembles.problem import system_of
from fastmech.ensembles.run import CALL_STEPS_WITH_STOPS, Observation
from fastmech.errors import InputError, shown
from fastmech.generated import new_module, run_module
from fastmech.integrators.methods import Method
from fastmech.models.balance import balance_kernel, energy_kernel, range_of
from fastmech.models.equilibria import Place, RestingPlaces, domain_of, find_equilibria
from fastmech.models.mechanism import Mechanism, in_precision
from fastmech.objects import Printed

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
class Wells(Printed):
    """The wells of a mechanism: minima of U, loads at their means, and what parts them."""

    mechanism: Mechanism
    equilibria: RestingPlaces
    wells: tuple[int, ...]  #: which equilibria are minima, the deepest first
    barrier: Floats  #: energy [J] below which each well's component is proved to hold no other; (wells,)
    passes: tuple[
        int | None, ...
    ]  #: the saddle there; None: an end of a range, an undecided place, or no exit
    cells: Cells

    def told(self) -> str:
        """Each well, how deep it is, and the way out of it."""
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


def require_potential(mechanism: Mechanism) -> None:
    """Refuse what has no wells.

    Raises:
        InputError: its forces are not known to have a potential.
    """
    if mechanism.energy() is None:
        raise InputError(
            f"{mechanism.name}: has forces that are not known to come from a potential; wells and labels "
            "are for potentials, gravity, springs and loads in fixed directions"
        )


def prove_wells(mechanism: Mechanism) -> Wells:
    """The wells of a mechanism, loads at their means, with proved barriers.

    Raises:
        InputError: its forces are not known to have a potential, U changes with a full turn, a range is not
            finite, or no well is proved. Places of which it is not decided what equilibria they hold, such as
            a spring at length zero, count as further wells and as passes at the least U there.
    """
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


#: Places along each coordinate at which frequencies are looked up, by the number of coordinates.
LOOKED_AT = {1: 512, 2: 48, 3: 12, 4: 7}

#: By how much those along one coordinate lie off those along the one before, over their distance.
OFF = 0.6180339887498949

#: Times at which the work that loads can still do is tabulated.
TIMES = 2048

#: A load has faded when all that it can still do is less than this share of the range of U.
FADED = 1e-13

#: Seconds by which a load that fades has to have done so.
LONGEST = 1e6

#: Longest step times the fastest damping rate: the default method's region of stability ends at -6.1.
DAMPED = 4.0

#: Share of energies by which a motion may miss a bound: far above errors of steps that resolve it.
SLACK = 1e-2

#: Share of a load's time scale that a coarse step may take.
OF_LOAD = 0.25

_OBSERVER = '''"""Made by fastmech: looks at the bounding energy of lanes."""

import numpy as np

from fastmech.capture.observe import finish, work_left
from fastmech.jit import OBSERVER_SIGNATURE, inlined, kernel, rounded_to
from fastmech.kernels.exponential import exp
from fastmech.kernels.sincos import cos, reduction_limit, sin, sincos


@inlined
{function}

@kernel(OBSERVER_SIGNATURE)
def observe(t, Y, params, record):
    energy, level = record[{energy}], record[{level}]
    left, low = work_left(t, params, {count}), 0
    for i in range(Y.shape[1]):
        beyond, value = bounding_within({arguments})
        value = np.inf if beyond else value + left
        energy[i] = value
        low |= value < level[i]
    finish(t, Y, params, record, {count}, low)
'''


@dataclass(frozen=True, eq=False)
class MechanismCertificate(CaptureCertificate):
    """Wells of a mechanism, ready for observers; energies in J."""

    system: Mechanism
    tree: Wells
    joule = 1.0
    work: Floats  #: at most what loads can still do [J] from each time on (TIMES,)
    fades: float  #: [s]: after it, the last of these
    origin: float = 0.0

    def outside(self, states: Floats) -> NDArray[np.bool_]:
        """Which states (n, states) lie beyond the range of a coordinate (n,)."""
        low, high, period = self.tree.cells.domain.T
        q = states[:, : len(low)]
        return np.asarray((((q < low) | (q > high)) & (period == 0.0)).any(axis=1))

    @property
    def names(self) -> tuple[str, ...]:  # type: ignore[override]
        """Of the coordinates."""
        return self.system.state[: len(self.system.coordinates)]

    @property
    def units(self) -> tuple[str, ...]:  # type: ignore[override]
        """Of the coordinates."""
        return tuple("m" if name in self.system.lengths else "rad" for name in self.names)

    @property
    def periods(self) -> Floats:  # type: ignore[override]
        """See the base class."""
        return self.tree.cells.domain[:, 2]

    @property
    def decays(self) -> bool:  # type: ignore[override]
        """Whether a load still changes."""
        return bool(self.work[0] > 0.0)

    @property
    def levels(self) -> Floats:
        """Barriers, less what rounding of energies may take."""
        return self.tree.barrier - ROUNDING * self.amplitudes

    @cached_property
    def amplitudes(self) -> float:  # type: ignore[override]
        """The scale of U [J]."""
        return self.tree.cells.scale

    @property
    def energies(self) -> Floats:
        """U."""
        return self.tree.equilibria.energy

    @cached_property
    def _energy(self) -> Any:
        return energy_kernel(self.system)

    @cached_property
    def _coefficients(self) -> list[float]:
        own, _ = self.system.derived.functions["bounding_within"]
        known = self.system.coefficients()
        return [float(known[name]) for name in own]

    @cached_property
    def _observe(self) -> Any:
        own, text = self.system.derived.functions["bounding_within"]
        states = [f"Y[{k}, i]" for k in range(len(self.system.state))]
        numbers = [f"params[{k}]" for k in range(len(own))]
        begin = 2 + len(states)
        source = _OBSERVER.format(
            function=in_precision(text, "float64"),
            arguments=", ".join([*states, *numbers]),
            count=len(own),
            level=begin,
            energy=begin + 1,
        )
        return run_module(new_module("observer", source), source).observe

    def params(self, levels: Floats) -> Floats:
        """Coefficients, then what :mod:`fastmech.capture.observe` reads."""
        tree, n = self.tree, len(self.names)
        places = tree.equilibria.position[list(tree.wells)]
        head = np.array([0.0, n, len(tree.wells), self.fades, len(self.work), self.origin])
        assert len(head) == HEAD
        domain = tree.cells.domain
        rows = [domain[:, 0], 1.0 / tree.cells.widths, tree.cells.counts, domain[:, 2], domain[:, 1]]
        assert len(rows) == TABLE_ROWS
        cells = tree.table(self.levels)
        parts = [self._coefficients, head, *rows, places, tree.radius, levels, self.work, cells]
        return np.concatenate([np.ravel(np.asarray(part, dtype=np.float64)) for part in parts])

    def observation(
        self, params: Floats, interval: float, call_steps: int = CALL_STEPS_WITH_STOPS
    ) -> Observation:
        """See the base class."""
        own, n = params.copy(), len(self.names)
        first, wells = len(self._coefficients), len(self.tree.wells)
        own[first] = interval
        begin = first + HEAD + TABLE_ROWS * n + 2 * wells * n
        record = np.zeros(2 + 2 * n + RECORD + n)
        record[2 + 2 * n] = params[begin : begin + wells].max()
        return Observation(self._observe, own, record, stops=True, call_steps=call_steps)

    def noted(self, records: Floats) -> Noted:
        """See the base class."""
        begin = 2 + len(self.system.state)
        turns = records[begin + RECORD : begin + RECORD + len(self.names)]
        return Noted(
            records[STOP_CODE].astype(np.int8),
            turns.T.astype(np.int32),
            records[begin + 3],
            records[begin + 4],
        )

    @cached_property
    def motion(self) -> tuple[Any, Floats]:
        """Lagrange's equations."""
        mechanism = self.system.with_terms(())
        system, known = system_of(mechanism, "lagrange"), mechanism.coefficients()
        return system.kernel, np.array([known[name] for name in system.parameters], dtype=np.float64)

    @cached_property
    def _paces(self) -> tuple[float, Floats]:
        """Coarse step of slow motions [s], and the squared rates that an energy allows, by phase [1/J s2].

        A length's phase is a turn over its range.
        """
        domain, n = self.tree.cells.domain, len(self.names)
        # The coordinates' places differ: where angles differ by a part of a turn, springs may have no length.
        steps = [(np.arange(LOOKED_AT[n]) + (0.5 + k * OFF) % 1.0) / LOOKED_AT[n] for k in range(n)]
        grid = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, n)
        q = domain[:, 0] + grid * (domain[:, 1] - domain[:, 0])
        linear = self.system.linear(q)
        known = np.isfinite(np.concatenate([part.reshape(len(q), -1) for part in linear], axis=1)).all(axis=1)
        mass, damping, stiffness = (part[known] for part in linear)
        inverse = np.linalg.inv(mass)
        frequency = math.sqrt(float(np.abs(np.linalg.eigvals(inverse @ stiffness)).max(initial=1e-300)))
        rate = float(np.abs(np.linalg.eigvals(inverse @ damping)).max(initial=1e-300))
        waves = 2.0 * np.pi / (domain[:, 1] - domain[:, 0])
        allowed = 2.0 * np.abs(np.diagonal(inverse, axis1=1, axis2=2)).max(axis=0) * waves**2
        return min(PHASE / frequency, DAMPED / rate, *self._load_steps()), allowed

    def _load_steps(self) -> list[float]:
        """Steps that loads allow [s], while they act."""
        found = [math.inf]
        for load in self.system.loads:
            times = np.asarray(getattr(load, "times", ()))
            rate, duration = getattr(load, "rate", 0.0), getattr(load, "duration", 0.0)
            found += [OF_LOAD / rate] if rate else []
            found += [OF_LOAD * duration] if duration else []
            found += [OF_LOAD * float(np.diff(times).min())] if times.size else []
        return found

    def coarse_steps(self, starts: Floats) -> Floats:
        """In octaves below that of slow motions, by the energy of each start."""
        slow, allowed = self._paces
        low = self.tree.cells.bounds[:, 0]
        lowest = float(low[np.isfinite(low)].min())
        with np.errstate(all="ignore"):
            energy = self.system.evaluate("bounding", starts.T)[0] + self.work[0]
            fastest = np.sqrt(np.maximum(energy - lowest, 0.0) * allowed.max())
            octaves = np.ceil(np.log2(fastest * slow / TURNING) - 1e-9)
        return np.asarray(slow * 0.5 ** np.clip(np.nan_to_num(octaves), 0.0, MOST_OCTAVES))

    @property
    def shortest_step(self) -> float:
        """See the base class."""
        return float(0.5**MOST_OCTAVES * self._paces[0])

    def early(self, method: Method) -> Early | None:
        """What happens until loads have no more kinks, which no step may cross."""
        kinks = self.system.kinks(math.inf)
        if not kinks.size:
            return None
        rest = replace(self, origin=float(kinks[-1]))
        return Early(rest, rest.origin, self._paces[0])

    def impossible(self, starts: Floats, states: Floats, threads: int | None = 1) -> NDArray[np.bool_]:
        """Which have more energy than they began with and loads can have brought."""
        with np.errstate(all="ignore"):
            before, after = (self.system.evaluate("bounding", y.T)[0] for y in (starts, states))
        scale = np.abs(before) + self.amplitudes
        return np.asarray(~np.isfinite(after) | (after - before - self.work[0] > SLACK * scale))

    def change(self, states: Floats, apart: Floats, push: Floats | None = None) -> Floats:
        """By the interval enclosure of the energy over the box."""
        n = len(self.names)
        known = np.isfinite(states).all(axis=1) & np.isfinite(apart).all(axis=1)
        found = np.full(len(states), np.inf)
        low, high = states[known] - apart[known], states[known] + apart[known]
        boxes = np.stack([np.nextafter(low, -np.inf), np.nextafter(high, np.inf)], axis=-1)
        points = np.repeat(states[known][:, :, None], 2, axis=2)
        kernel, p = callee(self._energy), values_of(self.system)
        over, at = np.empty((len(boxes), 2)), np.empty((len(boxes), 2))
        for whole, bounds in ((boxes, over), (points, at)):
            q, v = (np.ascontiguousarray(part) for part in (whole[:, :n], whole[:, n:]))
            bound_states(kernel, p, q, v, bounds)
        found[known] = over[:, 1] - at[:, 0]
        return found

    @property
    def slow_step(self) -> float:
        """See the base class."""
        return self._paces[0]


def mechanism_certificate(mechanism: Mechanism) -> MechanismCertificate:
    """The capture certificate of a mechanism.

    Raises:
        InputError: its wells are not certain, or a load never fades, or what it can do has no bound.
    """
    tree = prove_wells(mechanism)
    work, fades = _work_left(mechanism, tree, FADED * tree.cells.scale)
    return MechanismCertificate(mechanism, tree, work, fades)


def _work_left(mechanism: Mechanism, tree: Wells, least: float) -> tuple[Floats, float]:
    """What loads can still do at most [J] at times evenly spaced until they have faded, and that time [s]."""
    domain, changing = tree.cells.domain, []
    for load, acting in zip(mechanism.loads, mechanism.acting, strict=True):
        if load.to_come(0.0) == (0.0, 0.0):
            continue
        name = f"{mechanism.name}: the load {load!r}"
        if not math.isfinite(load.work_left(0.0)):
            raise InputError(f"{name} never fades; motion under it does not come to rest: no label is proved")
        turned = {c.symbol: c.symbol + 2 * _pi() for c in mechanism.coordinates if c.periodic}
        if (
            acting.place is None
            or acting.place.subs(turned, simultaneous=True).expand() != acting.place.expand()
        ):
            raise InputError(f"{name} can do any work along a motion that turns: no label is proved")
        low, high = range_of(mechanism, acting.place, domain)
        if not math.isfinite(high - low):
            raise InputError(f"{name}: how far its point can move is not bounded")
        changing.append((load, high - low))

    def left(t: float) -> float:
        return sum(load.work_left(t, reach) for load, reach in changing)

    fades = 1e-3
    while left(fades) > least:
        fades *= 2.0
        if fades > LONGEST:
            raise InputError(f"{mechanism.name}: its loads have not faded after {LONGEST:g} s")
    if not changing:
        return np.zeros(1), 1.0
    times = np.linspace(0.0, fades, TIMES, endpoint=False)
    return np.array([*map(left, times), left(fades)]) * (1.0 + 1e-12), fades


def _pi() -> Any:
    import sympy

    return sympy.pi
