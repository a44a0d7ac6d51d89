"""Right-hand sides of the mechanism: Lagrange's (13) and the canonical equations (14), by their terms.

States are (phi, theta, phi', theta') and (phi, theta, p_phi, p_theta), momenta over m2 l^2; parameters are
the lanes' reduced coefficients (:class:`fastmech.slider.coefficients.Coefficients`). Every combination of
terms is a kernel of its own: an ensemble is given the one of the terms that its scenes have.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import Any

import numpy as np

from fastmech.jit import inlined
from fastmech.kernels.blocks import Rates, block_kernel
from fastmech.kernels.exponential import exp
from fastmech.kernels.sincos import cos, reduction_limit, sin, sincos, turned
from fastmech.slider.coefficients import Coefficients
from fastmech.slider.reduced import canonical_rates, lagrange_accelerations

#: Rows of the parameters that belong to terms which a scene may lack.
FORCE, DAMPING, DECAY = 5, 6, 7


@inlined
def force_now(t: float, force: Any, decay: Any) -> Any:
    """The reduced force at a time, ``None`` without force; without ``decay`` it is constant."""
    if force is None:
        return None
    if decay is None:
        return force
    return force * exp(-decay * t)


@inlined
def lagrange_rates(trig, velocities, c, push, damping):  # type: ignore[no-untyped-def]
    """Rates of (phi, theta, phi', theta')."""
    a, b = lagrange_accelerations(trig, velocities, c, push, damping)
    return velocities[0], velocities[1], a, b


def _functions(equation: Any, module: str, precision: str) -> dict[str, Any]:
    """The functions of :class:`Rates`; ``equation`` takes sines and cosines, velocities, coefficients.

    Of those, ``c`` are mass, slider, lift, spring and gravity, ``loads`` force, damping and decay.
    """

    @inlined
    def rates(t, phi, theta, u, w, c, loads):  # type: ignore[no-untyped-def]
        force, damping, decay = loads
        trig = sin(phi), cos(phi), sin(theta), cos(theta)
        return equation(trig, (u, w), c, force_now(t, force, decay), damping)

    @inlined
    def rates_within(t, phi, theta, u, w, c, loads):  # type: ignore[no-untyped-def]
        force, damping, decay = loads
        limit = reduction_limit(phi)
        beyond = phi * phi + theta * theta > limit * limit
        s1, c1 = sincos(phi)
        s2, c2 = sincos(theta)
        found = equation((s1, c1, s2, c2), (u, w), c, force_now(t, force, decay), damping)
        return beyond, found, (s1, c1, phi, s2, c2, theta)

    @inlined
    def rates_near(t, phi, theta, u, w, c, loads, kept):  # type: ignore[no-untyped-def]
        force, damping, decay = loads
        s1, c1 = turned(kept[0], kept[1], phi - kept[2])
        s2, c2 = turned(kept[3], kept[4], theta - kept[5])
        return equation((s1, c1, s2, c2), (u, w), c, force_now(t, force, decay), damping)

    return {"rates": rates, "rates_within": rates_within, "rates_near": rates_near}


#: Formulations, and what gives the rates of each.
FORMULATIONS: dict[str, Callable[..., Any]] = {"lagrange": lagrange_rates, "hamilton": canonical_rates}


def terms(coefficients: Coefficients) -> str:
    """Name of the combination of terms: free, damped, constant, damped_constant, ...

    Coefficients may be arrays over trajectories: a term is there if any trajectory has it.
    """
    present = []
    if np.any(coefficients.damping):
        present.append("damped")
    if np.any(coefficients.force):
        present.append("decaying" if np.any(coefficients.decay) else "constant")
    return "_".join(present) or "free"


@cache
def with_terms(formulation: str, names: str) -> Any:
    """Block right-hand side of a formulation with a combination of terms, see :func:`terms`."""
    force = FORCE if "constant" in names or "decaying" in names else None
    damping, decay = (DAMPING if "damped" in names else None), (DECAY if "decaying" in names else None)
    functions = partial(_functions, FORMULATIONS[formulation])
    own = (0, 1, 2, 3, 4), (force, damping, decay)
    name = f"{formulation}_{names}"
    return block_kernel(Rates(name, 4, own, functions, ranged=True, near=True, looked_at=2))


def right_hand_side(coefficients: Coefficients, formulation: str = "lagrange") -> Any:
    """Block right-hand side of a formulation, ``"lagrange"`` or ``"hamilton"``, with these terms."""
    return with_terms(formulation, terms(coefficients))
