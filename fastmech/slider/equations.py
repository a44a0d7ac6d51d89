"""Equations of motion (13), (14), solved for the highest derivatives.

Reduced quantities throughout (see :mod:`fastmech.slider.reduced`): forces and momenta over m2 l^2. ``trig``
are sine and cosine of phi, then of theta; ``c`` mass, slider, lift, spring and gravity of ``Coefficients``.
``force`` is the reduced force at this instant; ``None`` for it or for ``damping`` leaves the term out of
the compiled code.
"""

from __future__ import annotations

from fastmech.jit import inlined, multiply_add
from fastmech.slider.reduced import (
    Pair,
    Values,
    metric_11,
    metric_determinant,
    potential_gradient,
    slider_products,
    slider_ratio,
)


@inlined
def rates_from_momenta(p1: Values, p2: Values, s12: Values, determinant: Values) -> Pair:
    """(phi', theta') from reduced momenta: q' = a^-1 p."""
    phi_dot = (p1 - s12 * p2) / determinant
    return phi_dot, p2 - s12 * phi_dot


@inlined
def momenta_from_rates(
    phi_dot: Values, theta_dot: Values, mass: Values, slider: Values, k: Values, s12: Values
) -> Pair:
    """Reduced generalized momenta p = a q', paper, section 3."""
    return metric_11(mass, slider, k) * phi_dot + s12 * theta_dot, s12 * phi_dot + theta_dot


@inlined
def lagrange_accelerations(
    trig: Values, velocities: Values, c: Values, force: Values | None, damping: Values | None
) -> Pair:
    """(phi'', theta'') [rad/s^2] from Lagrange's equations in covariant form, paper (13).

    The equation of phi is multiplied by w^4 = (4 - sin^2 phi)^2: one division is left where slider ratio,
    its derivative and determinant have three, and none waits for another.
    """
    s1, c1, s2, c2 = trig
    phi_dot, theta_dot = velocities
    mass, slider, lift, spring, gravity = c
    s12 = s1 * c2 + c1 * s2
    c12 = c1 * c2 - s1 * s2
    ww, wk, wwww_kdk = slider_products(s1, c1)
    u1, u2 = potential_gradient(trig, c12, (lift, spring, gravity), force)
    phi_dot_2 = phi_dot * phi_dot
    r2 = -u2 - c12 * phi_dot_2
    r1 = ww * (-u1 - c12 * (theta_dot * theta_dot) - s12 * r2)
    if damping is not None:
        r1 = multiply_add(-damping * (wk * wk), phi_dot, r1)
    determinant = ww * multiply_add(ww, mass + c12 * c12, slider * (wk * wk))
    phi_dot_dot = multiply_add(-slider * wwww_kdk, phi_dot_2, ww * r1) / determinant
    return phi_dot_dot, r2 - s12 * phi_dot_dot


@inlined
def canonical_rates(
    trig: Values, momenta: Values, c: Values, force: Values | None, damping: Values | None
) -> tuple[Values, Values, Values, Values]:
    """(phi', theta', p1', p2') from the canonical equations, paper (14), reduced momenta.

    q' = dH/dp, p' = -dH/dq + Q; at given momenta -dT/dq is +dT/dq at given rates, hence half the metric's
    derivative.
    """
    s1, c1, s2, c2 = trig
    mass, slider, lift, spring, gravity = c
    s12 = s1 * c2 + c1 * s2
    c12 = c1 * c2 - s1 * s2
    k, dk = slider_ratio(s1, c1)
    u1, u2 = potential_gradient(trig, c12, (lift, spring, gravity), force)
    determinant = metric_determinant(mass, slider, k, c12)
    phi_dot, theta_dot = rates_from_momenta(momenta[0], momenta[1], s12, determinant)
    coupling = c12 * phi_dot * theta_dot
    p1_dot = slider * k * dk * phi_dot * phi_dot + coupling - u1
    if damping is not None:
        p1_dot = p1_dot - damping * k * k * phi_dot
    return phi_dot, theta_dot, p1_dot, coupling - u2
