"""Arguments of the public functions about equilibria, checked at the boundary."""

from __future__ import annotations

import math
from numbers import Real
from typing import Any

from fastmech.errors import InputError, shown
from fastmech.mechanism.coefficients import reduce
from fastmech.mechanism.lagrange import potential_gradient, unit
from fastmech.scene import require_scene as require_scene

#: What an equilibrium has: its place, its proof and its force.
ENTRIES = ("phi", "theta", "morse_index", "radius", "force")

#: Share of the loads that may be left unbalanced: above rounding, below what another scene's loads leave; and
#: of a place that is not proved to be one of rest, as beside a fold.
NOT_AT_REST, NOT_PROVED = 1e-12, 1e-7


def require_rest(scene: Any, equilibrium: Any) -> None:
    """Refuse what is no scene with one of its equilibria.

    An equilibrium is the scene's if it balances under a force that the scene has at some time: F0 where
    alpha = 0, else one between F0 and none.

    Raises:
        InputError: one of them is something else, a coordinate is not finite, or the scene does not rest
            there.
    """
    require_scene(scene)
    for name in ENTRIES:
        if not isinstance(getattr(equilibrium, name, None), Real):
            raise InputError(f"equilibrium = {shown(equilibrium)}: must be one of fastmech.find_equilibria")
    for name in ("phi", "theta", "force"):
        value = float(getattr(equilibrium, name))
        if not math.isfinite(value):
            raise InputError(f"equilibrium.{name} = {value:g}: must be finite")
    first, last = scene.F0, scene.F0 if scene.alpha == 0.0 else 0.0
    force = min(max(equilibrium.force, min(first, last)), max(first, last))
    c = reduce(scene)._replace(force=force / (scene.m2 * scene.l))
    loads = abs(c.lift) + (c.mass + 2.0) * c.gravity + 2.0 * c.spring + 2.0 * abs(c.force)
    left = abs(potential_gradient(scene, (equilibrium.phi, equilibrium.theta), force)).max() / unit(scene)
    beside = abs(equilibrium.force - force) / (scene.m2 * scene.l)
    share = NOT_AT_REST if equilibrium.radius < math.inf else NOT_PROVED
    if not max(left, beside) <= share * loads:
        raise InputError(
            f"equilibrium = ({equilibrium.phi:g}, {equilibrium.theta:g}) rad, F = {equilibrium.force:g} N: "
            f"this scene (F0 = {scene.F0:g} N, alpha = {scene.alpha:g} 1/s) does not rest there; "
            "take one of fastmech.find_equilibria(scene)"
        )
