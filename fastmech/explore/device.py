"""What is explored: a scene of the paper's mechanism or any mechanism, its parameters, ranges and drawing.

A page is there as soon as a scene is: SymPy and Numba are loaded when something is computed.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.errors import InputError
from fastmech.scene import STATE, Scene, nearest

if TYPE_CHECKING:
    from fastmech.models.drawing import Drawing
    from fastmech.models.mechanism import Mechanism

Floats = NDArray[np.float64]

#: End of the range of a length that has none [m].
LENGTH = 2.0


class Device:
    """A mechanism with parameters that the page changes.

    Args:
        system: as it is first shown.
        source: what stands for it in lines of Python and in requests: the name of a shipped mechanism, or
            ``FILE.py:NAME``; of a scene None.
        results: the result file that is shown with it.
    """

    def __init__(
        self, system: Scene | Mechanism, source: str | None = None, results: Path | None = None
    ) -> None:
        self.system, self.source, self.results = system, source, results
        self.is_scene = isinstance(system, Scene)
        self.name = "slider_pendulum" if isinstance(system, Scene) else system.name
        self.state = STATE if isinstance(system, Scene) else system.state  #: coordinates, then rates
        self.coordinates = self.state[: len(self.state) // 2]
        self.dt = 0.01  #: step of motions [s], the one of requests
        self._last: tuple[Any, Any] = {}, system

    def at(self, parameters: Mapping[str, float]) -> Any:
        """The scene or mechanism with other values of some parameters.

        Raises:
            InputError: a parameter is unknown or has a value that it cannot have.
        """
        last = self._last
        if last[0] != parameters:
            last = self._last = dict(parameters), self.system.replace(**parameters)
        return last[1]

    def mechanism(self, parameters: Mapping[str, float], *, still: bool = False) -> Mechanism:
        """The mechanism of pictures and energies; ``still``: a scene's force that fades is none."""
        made = self.at(parameters)
        if not isinstance(made, Scene):
            return made
        values = {name: float(value) for name, (value, *_) in made.described().items()}
        if still and values["alpha"]:
            values |= {"F0": 0.0, "alpha": 0.0}
        form = copy.copy(self._forms[values["alpha"] != 0.0])
        form.parameters = values
        return form

    @cached_property
    def _forms(self) -> Any:
        """A scene's mechanism with a force that stays, and with one that fades: their equations differ."""
        if not self.is_scene:
            return (self.system,)
        from fastmech.mechanisms.slider_pendulum import slider_pendulum

        forms = tuple(slider_pendulum().replace(F0=1.0, alpha=alpha) for alpha in (0.0, 1.0))
        for form in forms:
            form.places([[0.0, 0.0]])  # its functions, which copies share
        return forms

    def drawn(self, parameters: Mapping[str, float], q: ArrayLike) -> Drawing:
        """What is drawn at positions (m, n); a scene's force as it is at the beginning."""
        from fastmech.models.drawing import drawing

        made = self.mechanism(parameters, still=True)
        if self.is_scene:
            made.parameters["F0"] = self.at(parameters).F0
        return drawing(made, q)

    @cached_property
    def _energy(self) -> Any:
        import sympy

        form = self._forms[0]
        expression, names = form.energy(), [*self.state, *form.parameters]
        symbols = [sympy.Symbol(name, real=True) for name in names]
        return None if expression is None else sympy.lambdify(symbols, expression, "numpy", cse=True)

    def energy(self, parameters: Mapping[str, float], states: Floats) -> Floats | None:
        """T + U [J] of states (..., 2 n) under the load at which it rests; None without a potential."""
        if self._energy is None:
            return None
        values = self.mechanism(parameters, still=True).parameters.values()
        found = self._energy(*np.moveaxis(states, -1, 0), *values)
        return np.broadcast_to(np.asarray(found, dtype=np.float64), states.shape[:-1])

    def states(self, axes: Mapping[str, Floats], fixed: Mapping[str, float]) -> Floats:
        """States (n1, n2, 2 n) over two of their components, the first along the first axis.

        Raises:
            InputError: a component is unknown.
        """
        for name in (*axes, *fixed):
            if name not in self.state:
                raise InputError(f"axes.{name}: unknown name; {nearest(name, list(self.state))}")
        made = np.empty((*(values.size for values in axes.values()), len(self.state)))
        for k, name in enumerate(self.state):
            made[..., k] = fixed.get(name, 0.0)
        for k, (name, values) in enumerate(axes.items()):
            made[..., self.state.index(name)] = values[:, None] if k == 0 else values
        return made

    def about(self) -> dict[str, Any]:
        """What a page must know: parameters and coordinates with units and ranges."""
        first = (Scene() if self.is_scene else self.system).described()
        parameters = {
            name: {"value": value, "reset": first[name][0], "unit": unit, "about": text}
            for name, (value, unit, text) in self.system.described().items()
        }
        states = {}
        for k, name in enumerate(self.coordinates):
            low, high, periodic, unit = -math.pi, math.pi, True, "rad"
            if not isinstance(self.system, Scene):
                _, *ends, periodic = self.system.coordinates[k]
                if not periodic:
                    low, high = (e if math.isfinite(e) else math.copysign(LENGTH, e) for e in ends)
                unit = "m" if name in self.system.lengths else "rad"
            states[name] = {"unit": unit, "low": low, "high": high, "periodic": periodic}
        results = self.results and self.results.name
        told = {"name": self.name, "scene": self.is_scene, "rates": self.state[len(states) :]}
        return told | {"parameters": parameters, "states": states, "results": results}
