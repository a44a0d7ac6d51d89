"""What mechanisms hand to the engine: their equations, and momenta for rates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fastmech.arrays import Floats, Integers
from fastmech.ensembles.system import System, numbers
from fastmech.generated import new_module, run_module
from fastmech.jit import inlined, rounded_to
from fastmech.kernels.blocks import Rates, identifier
from fastmech.kernels.exponential import exp
from fastmech.kernels.rebuilding import rebuilt
from fastmech.kernels.sincos import cos, reduction_limit, sin, sincos, turned
from fastmech.models.mechanism import Mechanism, in_precision

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

    def part(self, members: Integers) -> MechanismMotion:
        """Of some of the trajectories."""
        values = {name: column[members] for name, column in self.values.items()}
        return MechanismMotion(self.mechanism, values)

    def to_momenta(self, y: Floats) -> Floats:
        """Coordinates and momenta (..., n, dim) from coordinates and rates."""
        return self.mechanism.to_momenta(y, self.values)

    def to_rates(self, y: Floats) -> Floats:
        """The other way round."""
        return self.mechanism.to_rates(y, self.values)
