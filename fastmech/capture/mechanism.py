"""The capture certificate of any mechanism whose energy falls and whose loads fade.

The bounding energy is T + U with loads at what they come to, and all work that they can still do. A position
belongs to a well by the cells of :mod:`fastmech.capture.cells`, or by a box about the well in which U is
convex: the way straight to the minimum does not rise.
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
from fastmech.capture.cells import Cells, bound_states
from fastmech.capture.certificate import KINKED, MOST_OCTAVES, PHASE, TURNING, CaptureCertificate, Early
from fastmech.capture.wells import ROUNDING, ProvedWells, prove_wells, values_of
from fastmech.errors import InputError
from fastmech.generated import new_module, run_module
from fastmech.integrators.methods import Method
from fastmech.models.mechanism import Mechanism, in_precision

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

#: Share of a load's time scale that a coarse step may take.
OF_LOAD = 0.25

_OBSERVER = '''"""Made by fastmech: looks at the bounding energy of lanes."""

import numpy as np

from fastmech.capture.observe import finish, leave, work_left
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
{leaving}    finish(t, Y, params, record, {count}, low)
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
            leaving="" if all(self.periods) else f"    leave(t, Y, params, record, {len(own)})\n",
        )
        return run_module(new_module("observer", source), source).observe

    @property
    def _kinked(self) -> bool:
        """Whether forces have kinks, by their functions."""
        import sympy

        kinds = sympy.Max, sympy.Min, sympy.Abs, sympy.Piecewise, sympy.Heaviside, sympy.sign
        return any(force.has(*kinds) for force in self.system.equations.forces)

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
        phase = PHASE / KINKED if self._kinked else PHASE
        return min(phase / frequency, DAMPED / rate, *self._load_steps()), allowed

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
        return self.system._motion({}).impossible(starts, states, threads, gain=float(self.work[0]))

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


def require_falling(mechanism: Mechanism) -> None:
    """Refuse what is known, before wells are proved, to have no labels.

    Raises:
        InputError: it is not proved that dissipation feeds no energy in, dry friction stops motions anywhere,
            or a load never fades.
    """
    if not mechanism.passive:
        raise InputError(
            f"{mechanism.name}: it is not proved that its dissipation feeds no energy in, and so no label; "
            "give dampers, or a sum of squares of rates with factors that are not negative, and finite ranges"
        )
    if mechanism.dry:
        raise InputError(
            f"{mechanism.name}: dry friction stops it also where forces do not balance, and so no label; "
            "let friction fade with the rate: b * sqrt(q.dot**2 + e**2) in place of b * Abs(q.dot)"
        )
    for load in mechanism.loads:
        if not math.isfinite(load.work_left(0.0)):
            raise InputError(
                f"{mechanism.name}: the load {load!r} never fades; motion under it does not come to rest: no "
                "label is proved"
            )


def mechanism_certificate(mechanism: Mechanism) -> MechanismCertificate:
    """The capture certificate of a mechanism.

    Raises:
        InputError: as `require_falling`, its wells are not certain, or what a load can do has no bound.
    """
    require_falling(mechanism)
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
        turned = {c.symbol: c.symbol + 2 * sympy.pi for c in mechanism.coordinates if c.periodic}
        place = acting.place
        if place is None or place.subs(turned, simultaneous=True).expand() != place.expand():
            raise InputError(f"{name} can do any work along a motion that turns: no label is proved")
        low, high = range_of(mechanism, place, domain)
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
