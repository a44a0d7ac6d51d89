"""Motions with a known end, in extended precision, made by ``data/make_hardcases.py``."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib import resources
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.scene import Scene

Floats = NDArray[np.float64]

#: Relative error that rounding explains, of motions that are not chaotic.
ROUNDED = 1e-10


class Goal(NamedTuple):
    """A motion whose end is known, of a reference to better than double precision."""

    scene: Scene
    start: Floats  #: (4,): rad, rad/s
    t_end: float  #: s
    expected: Floats  #: (4,), state at that time
    rounded: float = ROUNDED  #: error that rounding explains, of the largest entry

    def error(self, state: Floats) -> float:
        """Largest difference from the known end, relative to its largest entry, 1 at least."""
        return float(np.abs(state - self.expected).max() / max(1.0, np.abs(self.expected).max()))


@cache
def _content() -> dict[str, Any]:
    return tomllib.loads(resources.files(__package__).joinpath("references.toml").read_text(encoding="utf-8"))


def motion(name: str, rounded: float = ROUNDED) -> Goal:
    """The reference of this name; its scene is the paper's with a few changes."""
    entry = _content()[name]
    end = np.array([float(x) for x in entry["state"]])
    return Goal(
        Scene(c2=1100 / 3).replace(**entry["scene"]), np.array(entry["start"]), entry["t"], end, rounded
    )


class Boundary(NamedTuple):
    """Where a line of starts at rest, theta = 0, crosses a basin boundary, and where motions end."""

    scene: Scene
    phi: float  #: rad, rounded; to 1e-16
    below: Floats  #: phi, theta [rad] at the end of motions that start at smaller phi, (2,)
    above: Floats  #: the same for greater phi


def boundary() -> Boundary:
    """The crossing found by bisection in extended precision."""
    entry = _content()["boundary"]
    below, above = (np.array(end) for end in entry["ends"])
    return Boundary(Scene(c2=1100 / 3).replace(**entry["scene"]), float(entry["phi"]), below, above)
