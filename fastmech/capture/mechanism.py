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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.callee import callee
from fastmech.capture.cells import Cells, bound_cells, bound_states, convex_box, first_exits
from fastmech.capture.certificate import (
    MOST_OCTAVES,
    PHASE,
    TURNING,
    CaptureCertificate,
    Early,
    Wells,
)
from fastmech.errors import InputError, shown
from fastmech.generated import new_module, run_module
from fastmech.integrators.methods import Method
from fastmech.models.equilibria import RestingPlaces, domain_of, find_equilibria
from fastmech.models.mechanism import Mechanism, in_precision

#: Cells along a coordinate, by the number of coordinates; odd, so that the middle of a range is inside one.
SIDES = {1: 8191, 2: 255, 3: 61, 4: 23}

#: Share of the range of U by which barriers are lowered: rounding of energies in compiled loops is far less.
ROUNDING = 1e-11

#: The mark of a cell with several minima, or with what is not decided.
SEVERAL = 127

#: A minimum is in a cell if it is so near to it, in widths.
NEAR = 1e-6


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
        for half, well in zip(radius, self.wells, strict=True):
            convex_box(
                forces,
                self.cells.domain,
                values_of(self.mechanism),
                self.equilibria[well].position.copy(),
                half,
            )
        return radius


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


def prove_wells(mechanism: Mechanism) -> ProvedWells:
    """The wells of a mechanism, loads at their means, with proved barriers.

    Raises:
        InputError: its forces are not known to have a potential, U changes with a full turn, a range is not
            finite, or no well is proved. Places of which it is not decided what equilibria they hold, such as
            a spring at length zero, count as further wells and as passes at the least U there.
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
    bound_cells(energies, forces, domain, p, cells.counts, bounds=cells.bounds)
    _require_periodic(mechanism, domain)
    energy = np.array([place.energy for place in equilibria])
    index = np.array([place.morse_index for place in equilibria])
    wells = np.flatnonzero(index == 0)
    if not wells.size:
        raise InputError(f"{mechanism.name}: has no well that is proved: {equilibria.certificate.sentence}")
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
        first_exits(low, cells.counts, cells.periodic, marks.ravel(), start, found=exits)
        above = np.where((levels >= exits[0] - slack) & (exits[0] < np.inf), levels, np.inf)
        lowest = int(np.argmin(above)) if above.size else 0
        out = float(above[lowest]) if above.size else np.inf
        barrier[row] = min(out, exits[1])
        passes.append(int(passing[lowest]) if out < exits[1] and lowest < len(passing) else None)
    return ProvedWells(equilibria, tuple(wells.tolist()), barrier, tuple(passes), mechanism, cells=cells)


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
    tree: ProvedWells
    rounding = ROUNDING
    work: Floats  #: at most what loads can still do [J] from each time on (TIMES,)
    fades: float  #: [s]: after it, the last of these
    origin: float = 0.0

    @property
    def decays(self) -> bool:  # type: ignore[override]
        """Whether a load still changes."""
        return bool(self.work[0] > 0.0)

    @cached_property
    def amplitudes(self) -> float:  # type: ignore[override]
        """The scale of U [J]."""
        return self.tree.cells.scale

    @property
    def cells(self) -> Cells:
        """Bounds of U over the domain."""
        return self.tree.cells

    @cached_property
    def _energy(self) -> Any:
        from fastmech.models.balance import energy_kernel  # SymPy, as above

        return energy_kernel(self.system)

    @cached_property
    def coefficients(self) -> Floats:
        """What the bounding energy takes."""
        own, _ = self.system.derived.functions["bounding_within"]
        known = self.system.coefficients()
        return np.array([known[name] for name in own])

    @cached_property
    def observer(self) -> Any:
        """Written for the mechanism."""
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
        InputError: its wells are not certain, it is not proved that dissipation feeds no energy in, or a load
            never fades, or what it can do has no bound.
    """
    if not mechanism.passive:
        raise InputError(
            f"{mechanism.name}: it is not proved that its dissipation feeds no energy in, and so no label; "
            "give dampers, or a sum of squares of rates with factors that are not negative, and finite ranges"
        )
    tree = prove_wells(mechanism)
    work, fades = _work_left(mechanism, tree, FADED * tree.cells.scale)
    return MechanismCertificate(mechanism, tree, work, fades)


def _work_left(mechanism: Mechanism, tree: ProvedWells, least: float) -> tuple[Floats, float]:
    """What loads can still do at most [J] at times evenly spaced until they have faded, and that time [s]."""
    import sympy

    from fastmech.models.balance import range_of

    domain, changing = tree.cells.domain, []
    for load, acting in zip(mechanism.loads, mechanism.acting, strict=True):
        if load.to_come(0.0) == (0.0, 0.0):
            continue
        name = f"{mechanism.name}: the load {load!r}"
        if not math.isfinite(load.work_left(0.0)):
            raise InputError(f"{name} never fades; motion under it does not come to rest: no label is proved")
        turned = {c.symbol: c.symbol + 2 * sympy.pi for c in mechanism.coordinates if c.periodic}
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
