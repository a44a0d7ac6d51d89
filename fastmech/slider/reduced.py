"""The mechanism's physics, once: reduced metric, potential, equations of motion (13), (14) for accelerations.

Every function takes sines and cosines of the angles (``s1, c1`` of phi, ``s2, c2`` of theta, ``trig`` all
four; ``s12, c12`` of phi + theta) and reduced coefficients (``loads`` are lift, spring and gravity); all are
plain arithmetic on floats or arrays, so compiled lanes and NumPy analysis run the same source. Quantities are
those of the paper divided by m2 l^2; in the equations of motion ``c`` are mass, slider, lift, spring and
gravity, ``force`` the one at this instant. A term that is ``None`` is not there: the compiler drops its code.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from fastmech.jit import inlined, multiply_add, rounded_to

#: A float in compiled lanes, an array in analysis.
Values: TypeAlias = Any

Pair: TypeAlias = tuple[Values, Values]


@inlined
def slider_ratio(s1: Values, c1: Values) -> tuple[Values, Values]:
    """k = -(dx3/dphi)/l and dk/dphi, from paper (6): k = sin phi (1 + cos phi / sqrt(4 - sin^2 phi))."""
    one, four = rounded_to(s1, 1.0), rounded_to(s1, 4.0)
    inverse_root = one / np.sqrt(four - s1 * s1)
    q = c1 * inverse_root
    k = s1 + s1 * q
    dk = c1 + q * c1 - s1 * s1 * inverse_root * (one - q * q)
    return k, dk


@inlined
def slider_products(s1: Values, c1: Values) -> tuple[Values, Values, Values]:
    """w^2, w k and w^4 k dk/dphi with w = sqrt(4 - sin^2 phi), of the k of :func:`slider_ratio`.

    Free of divisions: k = sin phi (w + cos phi) / w, and dk/dphi = (w^3 cos phi + w^4 - 12) / w^3.
    """
    ww = rounded_to(s1, 4.0) - s1 * s1
    w = np.sqrt(ww)
    wk = s1 * (w + c1)
    return ww, wk, wk * (ww * (c1 * w + ww) - rounded_to(s1, 12.0))


@inlined
def metric_11(mass: Values, slider: Values, k: Values) -> Values:
    """a11/(m2 l^2), paper (11); a12/(m2 l^2) = sin(phi + theta) and a22/(m2 l^2) = 1."""
    return mass + rounded_to(mass, 1.0) + slider * k * k


@inlined
def kinetic(a11: Values, s12: Values, phi_dot: Values, theta_dot: Values) -> Values:
    """T over m2 l^2 [1/s^2] from the metric, paper (8), (9): ``a11`` and ``s12`` = sin(phi + theta)."""
    own = a11 * (phi_dot * phi_dot) + theta_dot * theta_dot
    return rounded_to(a11, 0.5) * own + s12 * phi_dot * theta_dot


@inlined
def metric_determinant(mass: Values, slider: Values, k: Values, c12: Values) -> Values:
    """(a11 a22 - a12^2)/(m2 l^2)^2, written without cancellation; positive for every m1, m2 > 0."""
    return mass + c12 * c12 + slider * k * k


@inlined
def potential_gradient(trig: Values, c12: Values, loads: Values, force: Values | None) -> Pair:
    """Gradient of U = Pi - F x2 over m2 l^2 with respect to (phi, theta) [1/s^2], paper (17), (20)."""
    s1, c1, s2, c2 = trig
    lift, spring, gravity = loads
    pull = spring * c12
    u1 = lift * c1 - pull
    u2 = gravity * s2 - pull
    if force is not None:
        u1 = u1 + force * s1
        u2 = u2 + force * c2
    return u1, u2


@inlined
def potential_hessian(
    trig: Values, s12: Values, loads: Values, force: Values
) -> tuple[Values, Values, Values]:
    """(U_phi,phi, U_phi,theta, U_theta,theta) over m2 l^2 [1/s^2], paper (19)."""
    s1, c1, s2, c2 = trig
    lift, spring, gravity = loads
    u12 = spring * s12
    return force * c1 - lift * s1 + u12, u12, gravity * c2 - force * s2 + u12


@inlined
def potential(trig: Values, s12: Values, loads: Values, force: Values) -> Values:
    """U = Pi - F x2 over m2 l^2, less the constant (c1 + c2)/m2 [1/s^2], paper (10)."""
    s1, c1, s2, c2 = trig
    lift, spring, gravity = loads
    return lift * s1 - gravity * c2 - spring * s12 - force * (c1 - s2)


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
