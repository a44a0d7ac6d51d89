"""What an ensemble integrates: a scene or a mechanism in one of two formulations, or a user's own system.

Either is a block right-hand side, the parameters of every trajectory, and how public states turn into the
integrated ones and back.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Floats, Integers
from fastmech.ensembles import checks
from fastmech.ensembles.fitting import KnownMotion
from fastmech.ensembles.lanes import Parameters
from fastmech.ensembles.run import NOTHING, Observation
from fastmech.ensembles.system import System, numbers
from fastmech.errors import InputError, shown
from fastmech.generated import new_module, run_module
from fastmech.integrators.methods import Method, with_inverse
from fastmech.jit import inlined, rounded_to
from fastmech.kernels.blocks import Rates, identifier
from fastmech.kernels.exponential import exp
from fastmech.kernels.rebuilding import rebuilt
from fastmech.kernels.sincos import cos, reduction_limit, sin, sincos, turned
from fastmech.models.mechanism import Mechanism, in_precision
from fastmech.scene import Scene, nearest

#: Of angles and rates, or of angles and momenta.
FORMULATIONS = ("lagrange", "hamilton")

#: What the text of a right-hand side calls.
_CALLED = {
    "np": np, "sin": sin, "cos": cos, "exp": exp, "sincos": sincos, "turned": turned,
    "reduction_limit": reduction_limit, "rounded_to": rounded_to, "float32": np.float32,
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
        return Rates(
            self._name,
            n,
            tuple(range(len(self.parameters))),
            self._functions,
            (self._prints, *self._texts.values()),
            ranged=packed,
            near=packed,
            looked_at=n // 2,
        )


_systems: dict[tuple[str, str, str], MechanismSystem] = {}


def system_of(mechanism: Mechanism, formulation: str) -> MechanismSystem:
    """The system of a mechanism, the same for other values of its parameters."""
    key = mechanism.name, mechanism.prints, formulation
    if key not in _systems:
        _systems[key] = MechanismSystem(mechanism, formulation)
    return _systems[key]


@dataclass(frozen=True)
class Problem:
    """A right-hand side with the parameters of n trajectories."""

    rhs: Any
    params: Parameters
    observation: Observation = NOTHING
    motion: KnownMotion | None = None  #: what a scene knows of it
    canonical: bool = False  #: momenta are integrated in place of rates
    system: System | None = None  #: of the user's own, or of a mechanism
    mechanism: Mechanism | None = None
    values: Mapping[str, Floats] = field(
        default_factory=dict
    )  #: of a mechanism's parameters, one a trajectory

    def method(self, method: Method) -> Method:
        """A method that knows how to solve its systems, if it has any and they are a scene's of Lagrange."""
        own = self.motion is not None and not self.canonical
        return with_inverse(method, self.motion.inverse) if own and self.motion else method

    def inward(self, y: Floats) -> Floats:
        """Integrated states from public ones (..., n, dim)."""
        if not self.canonical:
            return y
        if self.motion is not None:
            return self.motion.to_momenta(y)
        assert self.mechanism is not None
        return self.mechanism.to_momenta(y, self.values)

    def outward(self, y: Floats) -> Floats:
        """Public states from integrated ones (..., n, dim)."""
        if not self.canonical:
            return y
        if self.motion is not None:
            return self.motion.to_rates(y)
        assert self.mechanism is not None
        return self.mechanism.to_rates(y, self.values)

    @property
    def public(self) -> Problem:
        """The same with public states."""
        if self.canonical and self.mechanism is not None:
            return _of_mechanism(self.mechanism, self.values, "lagrange")
        if self.canonical and self.motion is not None:
            return replace(self, rhs=self.motion.right_hand_side("lagrange"), canonical=False)
        return self

    def part(self, members: Integers) -> Problem:
        """The same for some of the trajectories."""
        if self.params.shared:
            return self
        motion = None if self.motion is None else self.motion.part(members)
        values = {name: column[members] for name, column in self.values.items()}
        return replace(self, params=self.params.part(members), motion=motion, values=values)


class Case(NamedTuple):
    """A problem, from where its trajectories start, and when they are asked for."""

    problem: Problem
    starts: Floats  #: public states at t = 0, shape (n, dim)
    outputs: Floats  #: times [s], rising, not negative
    threads: int | None = None  #: to use; None: all processors

    def part(self, members: Integers) -> Case:
        """Some of the trajectories."""
        return self._replace(problem=self.problem.part(members), starts=self.starts[members])


def scene_problem(scene: Scene, n: int, own: Mapping[str, Floats], formulation: str) -> Problem:
    """A scene of which some parameters differ between the n trajectories: ``own``, see :func:`own_values`.

    Raises:
        InputError: values that no scene may have.
    """
    # What a scene allows of one parameter depends on no other.
    for extreme in (np.min, np.max) if n and own else ():
        scene.replace(**{name: float(extreme(column)) for name, column in own.items()})
    motion = scene.motion(own)
    rhs, params = motion.right_hand_side(formulation), Parameters(motion.columns)
    return Problem(rhs, params, motion=motion, canonical=formulation == "hamilton")


def extreme_scenes(scene: Scene, own: Mapping[str, Floats], problem: Problem) -> list[Scene]:
    """The scene, or those of the trajectories that a damper stops soonest and latest, and of the stiffest.

    ``own`` are the parameters that differ, (n,), of the scene's ``problem``. These three are what limits a
    step by parameters; a look at a scene takes as long as hundreds of trajectories.
    """
    motion = problem.motion
    if not own or motion is None or not motion.damping.size:
        return [scene]
    rows = {int(np.argmax(motion.damping)), int(np.argmin(motion.damping)), int(np.argmax(motion.frequency))}
    # The values have been checked, all of them.
    return [
        scene.replace(**{name: float(column[row]) for name, column in own.items()}) for row in sorted(rows)
    ]


def system_problem(system: System, n: int, parameters: Mapping[str, ArrayLike]) -> Problem:
    """A system whose ``parameters`` differ between the n trajectories.

    Raises:
        InputError: an unknown parameter or wrong values.
    """
    own = own_values(parameters, system.parameters, n)
    columns = (np.asarray(own.get(k, v), dtype=np.float64) for k, v in system.parameters.items())
    return Problem(system.kernel, Parameters(tuple(columns)), system.observation, system=system)


def mechanism_problem(mechanism: Mechanism, n: int, own: Mapping[str, Floats], formulation: str) -> Problem:
    """A mechanism of which some parameters differ between the n trajectories: ``own``.

    Raises:
        InputError: values that no such mechanism may have.
    """
    for extreme in (np.min, np.max) if n and own else ():
        mechanism.replace(**{name: float(extreme(column)) for name, column in own.items()})
    return _of_mechanism(mechanism.with_terms(own), own, formulation)


def _of_mechanism(mechanism: Mechanism, own: Mapping[str, Floats], formulation: str) -> Problem:
    system, known = system_of(mechanism, formulation), mechanism.coefficients(own)
    params = Parameters(tuple(np.asarray(known[name]) for name in system.parameters))
    values = {name: np.asarray(column) for name, column in own.items()}
    canonical = formulation == "hamilton"
    return Problem(
        system.kernel, params, canonical=canonical, system=system, mechanism=mechanism, values=values
    )


def own_values(parameters: Mapping[str, ArrayLike], known: Mapping[str, float], n: int) -> dict[str, Floats]:
    """Values of each trajectory (n,) by parameter.

    Raises:
        InputError: an unknown name, not n values, or values that are not finite.
    """
    if not isinstance(parameters, Mapping):
        raise InputError(f"parameters = {shown(parameters)}: must map names to values, one a start")
    own = {}
    for name, values in parameters.items():
        if name not in known:
            raise InputError(f"parameters.{name}: unknown name; {nearest(str(name), list(known))}")
        array = checks.reals(f"parameters.{name}", values, "real numbers")
        if array.shape != (n,):
            raise InputError(f"parameters.{name}: has shape {array.shape}, must be ({n},), one value a start")
        if not np.isfinite(array).all():
            raise InputError(f"parameters.{name}: must be finite")
        own[name] = array
    return own
