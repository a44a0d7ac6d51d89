"""Arguments of the public functions about equilibria, checked at the boundary."""

from __future__ import annotations

import math
from numbers import Real
from typing import Any

from fastmech.errors import InputError
from fastmech.scene import Scene

#: What an equilibrium has: its place, its proof and its force.
ENTRIES = ("phi", "theta", "morse_index", "radius", "force")


def require_scene(scene: Any) -> None:
    """Refuse what is no scene.

    Raises:
        InputError: it is something else.
    """
    if not isinstance(scene, Scene):
        raise InputError(f"scene = {_told(scene)}: must be a Scene")


def require_rest(scene: Any, equilibrium: Any) -> None:
    """Refuse what is no scene with one of its equilibria.

    Raises:
        InputError: one of them is something else, or a coordinate is not finite.
    """
    require_scene(scene)
    for name in ENTRIES:
        if not isinstance(getattr(equilibrium, name, None), Real):
            raise InputError(f"equilibrium = {_told(equilibrium)}: must be one of fastmech.find_equilibria")
    for name in ("phi", "theta", "force"):
        value = float(getattr(equilibrium, name))
        if not math.isfinite(value):
            raise InputError(f"equilibrium.{name} = {value:g}: must be finite")


def _told(value: Any) -> str:
    """A value in one line."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."
