"""Which kernel a scene is given: only the terms that it has."""

from __future__ import annotations

from typing import Any

from fastmech.kernels import canonical, lagrange
from fastmech.scene import Scene

FORMULATIONS = {"lagrange": lagrange, "hamilton": canonical}


def terms(scene: Scene) -> str:
    """Name of the combination of terms of ``scene``: free, damped, constant, damped_constant, ..."""
    force = "" if scene.F0 == 0 else "constant" if scene.alpha == 0 else "decaying"
    damper = "damped" if scene.beta > 0 else ""
    return "_".join(term for term in (damper, force) if term) or "free"


def right_hand_side(scene: Scene, formulation: str = "lagrange") -> Any:
    """Block right-hand side of ``scene`` in a formulation, ``"lagrange"`` or ``"hamilton"``."""
    module = FORMULATIONS[formulation]
    return getattr(module, f"{module.__name__.rpartition('.')[2]}_{terms(scene)}")
