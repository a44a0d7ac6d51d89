"""What is explored: a scene or any mechanism, its parameters and ranges; there before SymPy and Numba are."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fastmech.arrays import Floats
from fastmech.errors import InputError
from fastmech.scene import Scene, nearest

if TYPE_CHECKING:
    from fastmech.models.mechanism import Mechanism


#: End of the range of a length that has none [m].
LENGTH = 2.0


class Device:
    """A mechanism with parameters that the page changes, as it is first shown, with a result file.

    ``source``: name of a shipped mechanism, or ``FILE.py:NAME``; of a scene None.
    """

    def __init__(self, system: Any, source: str | None = None, results: Path | None = None) -> None:
        self.system, self.source, self.results = system, source, results
        self.is_scene = isinstance(system, Scene)
        self.name = "slider_pendulum" if self.is_scene else system.name
        self.state = system.state  #: coordinates, then rates
        self.coordinates = self.state[: len(self.state) // 2]
        self.dt = 0.01  #: step of motions [s] that is tried first, the one of requests
        self._last: tuple[Any, Any] = {}, system

    def at(self, parameters: Mapping[str, float]) -> Any:
        """The scene or mechanism with other values of some parameters.

        Raises:
            InputError: a parameter is unknown or has a value that it cannot have.
        """
        last = self._last
        if last[0] != parameters:  # a copy of the last one shares its functions
            made = last[1].replace(**self.system.parameters | parameters)
            last = self._last = dict(parameters), made
        return last[1]

    def mechanism(self, parameters: Mapping[str, float], *, still: bool = False) -> Mechanism:
        """The mechanism of pictures and energies; ``still``: a scene's force that fades is none."""
        made = self.at(parameters)
        if not isinstance(made, Scene):
            return made
        values = made.parameters
        if still and values["alpha"]:
            values |= {"F0": 0.0, "alpha": 0.0}
        form = self._forms[values["alpha"] != 0.0]
        made = object.__new__(type(form))
        vars(made).update(vars(form), parameters=values)  # with its functions, which a copy makes again
        return made

    @cached_property
    def _forms(self) -> Any:
        """A scene's mechanism with a force that stays, and with one that fades: their equations differ."""
        from fastmech.mechanisms.slider_pendulum import slider_pendulum

        forms = tuple(slider_pendulum().replace(F0=1.0, alpha=alpha) for alpha in (0.0, 1.0))
        for form in forms:
            form.places([[0.0, 0.0]])  # makes its functions
        return forms

    def energy(self, parameters: Mapping[str, float], states: Floats) -> Floats | None:
        """T + U [J] of states (..., 2 n) under the load at which it rests; None without a potential."""
        made = self.mechanism(parameters, still=True)
        if "bounding" not in made.derived.functions:
            return None
        found: Floats = made.evaluate("bounding", np.moveaxis(states, -1, 0))[0]
        return found

    def states(self, axes: Mapping[str, Floats], others: Mapping[str, float]) -> Floats:
        """States (n1, n2, 2 n) over two of their components, zero but for ``others``.

        Raises:
            InputError: a component is unknown.
        """
        for name in (*axes, *others):
            if name not in self.state:
                raise InputError(f"axes.{name}: unknown name; {nearest(name, list(self.state))}")
        given = dict(others) | dict(zip(axes, np.meshgrid(*axes.values(), indexing="ij"), strict=True))
        return np.stack(np.broadcast_arrays(*(given.get(name, 0.0) for name in self.state)), axis=-1)

    def _allows(self, name: str, value: float) -> bool:
        """Whether a parameter can have a value."""
        with suppress(InputError):
            return self.system.replace(**{name: value}) is not None
        return False

    def about(self) -> dict[str, Any]:
        """What a page must know: parameters and coordinates with units and ranges."""
        first = (Scene() if self.is_scene else self.system).described()
        parameters = {}
        for name, (value, unit, text) in self.system.described().items():
            own = {"value": value, "reset": first[name][0], "unit": unit, "about": text}
            parameters[name] = own | {"zero": self._allows(name, 0.0), "negative": self._allows(name, -1.0)}
        states = {}
        for k, name in enumerate(self.coordinates):
            low, high, periodic = -math.pi, math.pi, True
            if not self.is_scene:
                _, *ends, periodic = self.system.coordinates[k]
                if not periodic:
                    low, high = (e if math.isfinite(e) else math.copysign(LENGTH, e) for e in ends)
            unit = "m" if name in self.system.lengths else "rad"
            states[name] = {"unit": unit, "low": low, "high": high, "periodic": periodic}
        told = {"name": self.name, "scene": self.is_scene, "source": self.source}
        told |= {"rates": self.state[len(states) :], "results": self.results and self.results.name}
        return told | {"parameters": parameters, "states": states}
