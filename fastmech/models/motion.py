"""What mechanisms hand to the engine: their equations, and momenta for rates."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fastmech.arrays import Flags, Floats, Integers
from fastmech.ensembles.fitting import SLACK
from fastmech.ensembles.system import System, numbers
from fastmech.ensembles.threads import in_parts
from fastmech.generated import new_module, run_module
from fastmech.jit import inlined
from fastmech.kernels.blocks import Rates, identifier
from fastmech.kernels.exponential import exp
from fastmech.kernels.rebuilding import rebuilt
from fastmech.kernels.sincos import cos, reduction_limit, sin, sincos, turned
from fastmech.loads import Constant
from fastmech.models.mechanism import Mechanism, in_precision

#: Shares of energies, and of a radian or a coordinate, that rounding may make: lanes may be of float32.
ROUNDED, SHIFTED = 1e-12, 1e-5

#: What the text of a right-hand side calls.
_CALLED = {
    "np": np, "sin": sin, "cos": cos, "exp": exp, "sincos": sincos, "turned": turned,
    "reduction_limit": reduction_limit, "float32": np.float32,
}  # fmt: skip


class MechanismSystem(System):
    """Equations of motion; parameters are their coefficients, whose values are a problem's matter."""

    _texts: dict[str, str]  #: functions of :class:`Rates` by name
    _of_time: dict[str, Any]  #: loads that are functions
    _name: str
    _prints: str

    def __init__(self, mechanism: Mechanism, formulation: str) -> None:
        begin, found = f"{formulation}_", mechanism.derived.functions.items()
        texts = {name.removeprefix(begin): text for name, text in found if name.startswith(begin)}
        vars(self).update(
            _name=identifier(f"{mechanism.name}_{formulation}"),
            _of_time=mechanism.functions_of_time(),
            _prints=mechanism.prints,
            _texts={name: text.replace(begin, "") for name, (_, text) in texts.items()},
        )
        # The right-hand side as a user would have written it, for what looks into it.
        text = in_precision(self._texts["rates"], "float64")
        module = new_module("mechanism", text, [mechanism.prints])
        vars(module).update(self._called(module.__name__, "float64") | {"exp": np.exp})
        own = dict.fromkeys(texts["rates"][0], 0.0)
        super().__init__(run_module(module, text).rates, mechanism.state, own)

    def __post_init__(self) -> None:
        """Nothing is left to check."""

    def _called(self, module: str, precision: str) -> dict[str, Any]:
        loads = {k: inlined(rebuilt(f, module, numbers(precision))) for k, f in self._of_time.items()}
        return _CALLED | loads | {"__name__": module}

    def _functions(self, module: str, precision: str) -> dict[str, Any]:
        place = self._called(module, precision)
        for text in self._texts.values():
            exec(in_precision(text, precision), place)
        return {name: inlined(place[name]) for name in self._texts}

    @property
    def parameter_order(self) -> list[str]:
        """As they are given."""
        return list(self.parameters)

    @cached_property
    def rates(self) -> Rates:
        """What the engine's loops are made from."""
        packed, n = "rates_within" in self._texts, len(self.state)
        own, prints = tuple(range(len(self.parameters))), (self._prints, *self._texts.values())
        return Rates(
            self._name, n, own, self._functions, prints, ranged=packed, near=packed, looked_at=n // 2
        )


_systems: dict[tuple[str, str, str], MechanismSystem] = {}


def system_of(mechanism: Mechanism, formulation: str) -> MechanismSystem:
    """The system of a mechanism, the same for other values of its parameters."""
    key = mechanism.name, mechanism.prints, formulation
    if key not in _systems:
        _systems[key] = MechanismSystem(mechanism, formulation)
    return _systems[key]


def _named(expressions: Iterable[Any]) -> set[str]:
    """Names of the symbols in them."""
    return {str(symbol) for one in expressions for symbol in getattr(one, "free_symbols", ())}


@dataclass(frozen=True)
class MechanismMotion:
    """Motions of a mechanism; see :class:`fastmech.ensembles.fitting.Moving`."""

    mechanism: Mechanism
    values: Mapping[str, Floats]  #: of parameters, one a trajectory

    inverse, bounds = None, None

    def equations(self, formulation: str) -> tuple[Any, tuple[Floats, ...], System]:
        """Right-hand side, its parameters and the system that it stands for."""
        system = system_of(self.mechanism, formulation)
        known = self.mechanism.coefficients(self.values)
        return system.kernel, tuple(np.asarray(known[name]) for name in system.parameters), system

    @cached_property
    def _losing(self) -> Mapping[str, Floats]:
        """Values of parameters, one a trajectory, that its dissipation has."""
        return {k: v for k, v in self.values.items() if k in _named(self.mechanism.dissipation)}

    @cached_property
    def rests(self) -> float:
        """Time [s] from which on T + U is known not to grow, loads in the potential; inf: never."""
        m, own = self.mechanism, self._losing
        extremes = [m.replace(**{k: float(f(v)) for k, v in own.items()}) for f in (np.min, np.max) if own]
        falls = "bounding" in m.derived.functions and all(one.passive for one in extremes or [m])
        times = [0.0 if falls else math.inf]
        for load, (symbolic, *_) in zip(m.loads, m.acting, strict=True):
            differs = bool(_named(vars(symbolic).values()) & self.values.keys())
            if not isinstance(load, Constant) and (differs or load.to_come(0.0) != (0.0, 0.0)):
                times.append(math.inf if differs else max(load.kinks(), default=math.inf))
        return max(times)

    def impossible(self, start: Floats, final: Floats, threads: int | None = 1, gain: float = 0.0) -> Flags:
        """Which motions (n,) from states have an energy that they cannot have in any of others.

        Loads rest, or bring at most a ``gain`` [J]. Beyond a range it tells nothing where U, or whether
        dissipation feeds energy in, is not known.
        """
        m, broken = self.mechanism, np.zeros(len(start), dtype=np.bool_)
        ranged = {str(c.symbol) for c in m.coordinates if not c.periodic}
        known_beyond = not ranged & _named(m.dissipation)

        def tell(part: slice) -> None:
            before = self._bounding(start[part], part)
            for states in final if final.ndim > 2 else final[None]:
                after = self._bounding(states[part], part)
                rise = after - before - gain
                if not (m.damped or self._losing):
                    np.abs(rise, out=rise)
                found = ~np.isfinite(after)
                some = np.flatnonzero(rise > ROUNDED * np.abs(before))
                who = part.start + some
                found[some] |= self._beyond(start[who], states[who], rise[some], who)
                broken[part] |= found & (~m.outside(states[part]) | (known_beyond & np.isfinite(after)))

        in_parts(tell, len(start), threads)
        return broken

    def _beyond(self, start: Floats, final: Floats, rise: Floats, members: Integers) -> Flags:
        """Where energies rise by more than errors explain: a share of what is turned over between T and U.

        Turning points may show nothing of that. From there forces can do work over a radian, or a length in
        which a spring as stiff as the mechanism is there takes them up.
        """
        own, m, n = self._own(members), self.mechanism, len(self.mechanism.coordinates)
        before, after = (m.energies(y, own).kinetic for y in (start, final))
        allowed = SLACK * (before + after + np.abs(rise - after + before))
        broken = rise > allowed
        some = np.flatnonzero(broken)
        if some.size:
            own, positions = self._own(members[some]), np.stack([start[some, :n], final[some, :n]])
            linear = m.linear(positions, own)
            still = m.accelerations(self.rests, np.concatenate([positions, 0.0 * positions], axis=-1), own)
            forces = np.abs((linear.mass @ still[..., None])[..., 0])
            stiffness = np.abs(np.diagonal(linear.stiffness, axis1=-2, axis2=-1)).max(axis=0)
            turns = np.array([str(c.symbol) not in m.lengths for c in m.coordinates])
            ways = np.where(turns, 1.0, np.divide(forces, stiffness, out=0.0 * forces, where=stiffness > 0.0))
            shifts = SHIFTED * np.where(turns, 1.0, np.abs(positions).sum(axis=0))
            more = (forces * ways).sum(axis=(0, 2)) + (stiffness * shifts**2).sum(axis=1)
            broken[some] = rise[some] > allowed[some] + SLACK * more
        return broken

    def _bounding(self, states: Floats, members: Any) -> Floats:
        """T + U [J] of some trajectories' states, loads at rest."""
        return self.mechanism.evaluate("bounding", states.T, self._own(members))[0]

    def _own(self, members: Any) -> dict[str, Floats]:
        return {name: column[members] for name, column in self.values.items()}

    def part(self, members: Integers) -> MechanismMotion:
        """Of some of the trajectories."""
        return MechanismMotion(self.mechanism, self._own(members))

    def to_momenta(self, y: Floats) -> Floats:
        """Coordinates and momenta (..., n, dim) from coordinates and rates."""
        return self.mechanism.to_momenta(y, self.values)

    def to_rates(self, y: Floats) -> Floats:
        """The other way round."""
        return self.mechanism.to_rates(y, self.values)
