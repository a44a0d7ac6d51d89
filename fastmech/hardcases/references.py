"""Final states of hard motions in extended precision, made by ``data/make_hardcases.py``."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib import resources
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.scene import Scene


class Motion(NamedTuple):
    """A motion whose end is known to better than double precision."""

    scene: Scene
    start: NDArray[np.float64]  #: (4,): rad, rad/s
    t: float  #: s
    state: NDArray[np.float64]  #: (4,) at that time


@cache
def _content() -> dict[str, Any]:
    return tomllib.loads(resources.files(__package__).joinpath("references.toml").read_text(encoding="utf-8"))


def motion(name: str) -> Motion:
    """The reference of this name; its scene is the paper's with a few changes."""
    entry = _content()[name]
    scene = Scene(c2=1100 / 3).replace(**entry["scene"])
    return Motion(scene, np.array(entry["start"]), entry["t"], np.array([float(x) for x in entry["state"]]))


class Boundary(NamedTuple):
    """Where a line of starts at rest, theta = 0, crosses a basin boundary, and where motions end."""

    scene: Scene
    phi: float  #: rad, rounded; to 1e-16
    below: NDArray[np.float64]  #: phi, theta [rad] at the end of motions that start at smaller phi, (2,)
    above: NDArray[np.float64]  #: the same for greater phi


def boundary() -> Boundary:
    """The crossing found by bisection in extended precision."""
    entry = _content()["boundary"]
    below, above = (np.array(end) for end in entry["ends"])
    return Boundary(Scene(c2=1100 / 3).replace(**entry["scene"]), float(entry["phi"]), below, above)
