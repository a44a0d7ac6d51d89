"""What is explored: a scene of the paper's mechanism or any mechanism, its parameters, ranges and drawing."""

from __future__ import annotations

import copy
import math
import runpy
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech import mechanisms
from fastmech.errors import InputError, shown
from fastmech.models.drawing import Drawing, drawing
from fastmech.models.mechanism import MOST_COORDINATES, Mechanism
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.request import request_of_text
from fastmech.scene import Scene, nearest, read_toml
from fastmech.store.read import open_results

Floats = NDArray[np.float64]

#: Ends of the range of a rate [rad/s or m/s], and of a length that has none [m].
RATE, LENGTH = 5.0, 2.0


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
        self._points: dict[str, Any] = {}
        self.dt = 0.01  #: step of motions [s], the one of requests
        if isinstance(system, Scene):
            # Two forms, because a force that fades has another mean than one that stays.
            self._base = mechanisms.slider_pendulum()
            self._still = self._base.replace(alpha=0.0, F0=1.0)
        else:
            self._base = self._still = system

    @property
    def state(self) -> tuple[str, ...]:
        """Names of coordinates, then rates."""
        return self._base.state

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return self.state[: len(self.state) // 2]

    def at(self, parameters: Mapping[str, float]) -> Scene | Mechanism:
        """The scene or mechanism with other values of some parameters.

        Raises:
            InputError: a parameter is unknown or has a value that it cannot have.
        """
        return self.system.replace(**parameters) if parameters else self.system

    def still(self, parameters: Mapping[str, float]) -> Mechanism:
        """The mechanism under the load at which it rests, for drawings and energies.

        A scene's force that fades is none.
        """
        values = {name: value for name, (value, *_) in self.at(parameters).described().items()}
        if not self.is_scene:
            made = copy.copy(self._still)
            made.parameters = made.parameters | values
            return made
        made = copy.copy(self._still)
        made.parameters = values | {"F0": values["F0"] if not values["alpha"] else 0.0, "alpha": 0.0}
        return made

    def drawn(self, parameters: Mapping[str, float], q: ArrayLike) -> Drawing:
        """What is drawn at positions (m, n); a scene's force as it is at the beginning."""
        made = self.still(parameters)
        if self.is_scene:
            made.parameters |= {"F0": self.at(parameters).described()["F0"][0]}
        return drawing(made, q)

    @cached_property
    def _energy(self) -> Any:
        import sympy

        expression = self._still.energy()
        if expression is None:
            return None
        names = [*self.state, *self._still.parameters]
        return sympy.lambdify(
            [sympy.Symbol(name, real=True) for name in names], expression, "numpy", cse=True
        )

    def energy(self, parameters: Mapping[str, float], states: Floats) -> Floats | None:
        """T + U [J] of states (..., 2 n) under the load at which it rests; None without a potential."""
        if self._energy is None:
            return None
        values = self.still(parameters).parameters.values()
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
        shape = tuple(values.size for values in axes.values())
        made = np.empty((*shape, len(self.state)))
        for k, name in enumerate(self.state):
            made[..., k] = fixed.get(name, 0.0)
        for k, (name, values) in enumerate(axes.items()):
            made[..., self.state.index(name)] = values[:, None] if k == 0 else values
        return made

    def point(self, name: str, parameters: Mapping[str, float], q: ArrayLike) -> tuple[Floats, Floats]:
        """Place (2,) [m] of a named point at a position (n,), and its derivatives (2, n).

        Raises:
            InputError: there is no such point, or the position has another number of coordinates.
        """
        import sympy

        made = self.still(parameters)
        if name not in made.points:
            raise InputError(f"point = {shown(name)}: must be one of {', '.join(made.points) or 'no points'}")
        at = np.asarray(q, dtype=np.float64)
        if at.shape != (len(self.coordinates),):
            raise InputError(f"q: has {at.size} numbers, must have {len(self.coordinates)}")
        if name not in self._points:
            place = made.points[name]
            coordinates = [sympy.Symbol(one, real=True) for one in self.coordinates]
            symbols = [*coordinates, *(sympy.Symbol(one, real=True) for one in made.parameters)]
            self._points[name] = sympy.lambdify(symbols, [list(place), place.jacobian(coordinates)], "numpy")
        place, slopes = self._points[name](*at, *made.parameters.values())
        return np.array(place, dtype=np.float64), np.array(slopes, dtype=np.float64)

    def about(self) -> dict[str, Any]:
        """What a page must know: parameters and states with units and ranges."""
        usual = Scene() if self.is_scene else self.system
        first = usual.described()
        parameters = {}
        for name, (value, unit, text) in self.system.described().items():
            low, high = _range(first[name][0], value, self.is_scene and name == "F0")
            reset = first[name][0]
            parameters[name] = {
                "value": value, "reset": reset, "unit": unit, "about": text, "low": low, "high": high
            }  # fmt: skip
        states = {}
        for c in self._base.coordinates:
            low, high = (end if math.isfinite(end) else math.copysign(LENGTH, end) for end in (c.low, c.high))
            if c.periodic:
                low, high = -math.pi, math.pi
            unit = "m" if str(c.symbol) in self._base.lengths else "rad"
            states[str(c.symbol)] = {"unit": unit, "low": low, "high": high, "periodic": c.periodic}
        for name, told in list(states.items()):
            states[f"{name}_dot"] = {
                "unit": f"{told['unit']}/s", "low": -RATE, "high": RATE, "periodic": False
            }  # fmt: skip
        return {
            "name": self.name,
            "scene": self.is_scene,
            "parameters": parameters,
            "states": states,
            "coordinates": list(self.coordinates),
            "results": None if self.results is None else self.results.name,
        }

    def python(self, parameters: Mapping[str, float]) -> str:
        """The line that makes the system."""
        changed = {n: v for n, (v, *_) in self.at(parameters).described().items()}
        given = ", ".join(f"{name}={value!r}" for name, value in changed.items())
        if self.is_scene:
            return f"system = fm.Scene({given})"
        source = str(self.source)
        if ":" in source:
            file, _, name = source.rpartition(":")
            return (
                f"import runpy\n\nmade = runpy.run_path({file!r})[{name!r}]\n"
                "system = (made if isinstance(made, fm.Mechanism) else made())" + f".replace({given})"
            )
        made, _, number = source.rpartition("_") if source.startswith("pendulum_chain") else (source, "", "")
        return f"system = fm.mechanisms.{made}({number}).replace({given})"

    def request_head(self) -> list[str]:
        """Lines of a request before its scene."""
        if self.is_scene:
            return []
        if ":" in str(self.source):
            return [f"# fastmech run THIS.toml --mechanism {self.source}"]
        return [f'mechanism = "{self.source}"']


def _range(usual: float, value: float, either_side: bool) -> tuple[float, float]:
    """Ends of a slider: from zero to some times the usual value, wider where the value lies outside."""
    size = max(abs(usual), abs(value)) or 1.0
    high = float(f"{2.5 * size:.1g}")
    return (-high, high) if either_side or min(usual, value) < 0.0 else (0.0, high)


def open_device(what: str | None) -> Device:
    """What the command's argument stands for.

    ``None``: Table 1; ``SCENE.toml``: the scene or mechanism of a file; ``RESULT.h5``: that of a result;
    ``FILE.py:NAME``: a mechanism of one's own; else the name of a shipped mechanism.

    Raises:
        InputError: there is no such thing.
    """
    if what is None:
        return Device(Scene())
    if what.endswith((".h5", ".hdf5")):
        with open_results(what) as results:
            text = results.request
        request = request_of_text(text, what, scan_kinds())
        named = getattr(request.scene, "name", None)
        return Device(request.scene, named, Path(what))
    if what.endswith(".toml"):
        table = read_toml(what)
        if "mechanism" in table:
            device = open_device(str(table["mechanism"]))
            return Device(device.at(table.get("scene", {})), device.source)
        return Device(Scene.from_toml(what))
    file, colon, name = what.rpartition(":")
    if colon:
        if not Path(file).is_file():
            raise InputError(f"{what}: there is no file {file}")
        made = runpy.run_path(file).get(name)
        made = made() if callable(made) and not isinstance(made, Mechanism) else made
        if not isinstance(made, Mechanism):
            raise InputError(f"{what}: {name} must be a Mechanism, or a function that gives one")
        return Device(made, what)
    shipped = [one for one in mechanisms.__all__ if one != "pendulum_chain"]
    shipped += [f"pendulum_chain_{n}" for n in range(1, MOST_COORDINATES + 1)]
    if what not in shipped:
        raise InputError(
            f"{shown(what)}: must be SCENE.toml, RESULT.h5, FILE.py:NAME or a shipped mechanism:"
            f" {nearest(what, shipped)}"
        )
    if what.startswith("pendulum_chain"):
        return Device(mechanisms.pendulum_chain(int(what[-1])), what)
    return Device(getattr(mechanisms, what)(), what)
