"""Equations of motion (13), (14), solved for the highest derivatives, and their derivatives by the state.

Reduced quantities throughout (see :mod:`fastmech.slider.reduced`): forces and momenta over m2 l^2. ``trig``
are sine and cosine of phi, then of theta; ``c`` mass, slider, lift, spring and gravity of ``Coefficients``.
``force`` is the reduced force at this instant; ``None`` for it or for ``damping`` leaves the term out of
the compiled code.

Derivatives of the equations of motion with respect to the state, reduced quantities (over m2 l^2). Both
follow from the metric and the forces of :mod:`fastmech.slider.reduced` by implicit differentiation: M a =
r gives M da = dr - dM a, so nothing but the derivatives of M and r is written down here. Arguments as those
of :mod:`fastmech.slider.equations`; ``force`` and ``damping`` are numbers, zero where absent.
"""

from __future__ import annotations

from fastmech.jit import inlined, multiply_add
from fastmech.slider.reduced import (
    Pair,
    Values,
    metric_11,
    metric_determinant,
    potential_gradient,
    potential_hessian,
    slider_curvature,
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
    trig: Values, phi_dot: Values, theta_dot: Values, c: Values, force: Values | None, damping: Values | None
) -> Pair:
    """(phi'', theta'') [rad/s^2] from Lagrange's equations in covariant form, paper (13).

    The equation of phi is multiplied by w^4 = (4 - sin^2 phi)^2: one division is left where slider ratio,
    its derivative and determinant have three, and none waits for another.
    """
    s1, c1, s2, c2 = trig
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
    trig: Values, p1: Values, p2: Values, c: Values, force: Values | None, damping: Values | None
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
    phi_dot, theta_dot = rates_from_momenta(p1, p2, s12, metric_determinant(mass, slider, k, c12))
    coupling = c12 * phi_dot * theta_dot
    p1_dot = slider * k * dk * phi_dot * phi_dot + coupling - u1
    if damping is not None:
        p1_dot = p1_dot - damping * k * k * phi_dot
    return phi_dot, theta_dot, p1_dot, coupling - u2


@inlined
def lagrange_tangent(
    trig: Values, phi_dot: Values, theta_dot: Values, c: Values, force: Values, damping: Values
) -> tuple[Pair, Pair, Pair, Pair]:
    """Derivatives of (phi'', theta'') of paper (13) by phi, theta, phi' and theta'."""
    s1, c1, s2, c2 = trig
    mass, slider, lift, spring, gravity = c
    s12 = s1 * c2 + c1 * s2
    c12 = c1 * c2 - s1 * s2
    k, dk = slider_ratio(s1, c1)
    ddk = slider_curvature(s1, c1)
    a1, a2 = lagrange_accelerations(trig, phi_dot, theta_dot, c, force, damping)
    u11, u12, u22 = potential_hessian(trig, s12, (lift, spring, gravity), force)
    det = metric_determinant(mass, slider, k, c12)
    centrifugal = s12 * phi_dot * phi_dot
    r1_phi = -u11 - slider * (dk * dk + k * ddk) * phi_dot * phi_dot + s12 * theta_dot * theta_dot
    r1_phi = r1_phi - 2.0 * damping * k * dk * phi_dot - 2.0 * slider * k * dk * a1 - c12 * a2
    r1_theta = -u12 + s12 * theta_dot * theta_dot - c12 * a2
    r2_phi, r2_theta = -u12 + centrifugal - c12 * a1, -u22 + centrifugal - c12 * a1
    r1_rate = -2.0 * slider * k * dk * phi_dot - damping * k * k
    return (
        rates_from_momenta(r1_phi, r2_phi, s12, det),
        rates_from_momenta(r1_theta, r2_theta, s12, det),
        rates_from_momenta(r1_rate, -2.0 * c12 * phi_dot, s12, det),
        rates_from_momenta(-2.0 * c12 * theta_dot, 0.0, s12, det),
    )


@inlined
def canonical_tangent(
    trig: Values, p1: Values, p2: Values, c: Values, force: Values, damping: Values
) -> tuple[Pair, Pair, Pair, Pair, Pair, Pair, Pair, Pair]:
    """Derivatives of (phi', theta') by phi, theta, p1 and p2, then of (p1', p2') by the same, paper (14)."""
    s1, c1, s2, c2 = trig
    mass, slider, lift, spring, gravity = c
    s12 = s1 * c2 + c1 * s2
    c12 = c1 * c2 - s1 * s2
    k, dk = slider_ratio(s1, c1)
    ddk = slider_curvature(s1, c1)
    w1, w2, _, _ = canonical_rates(trig, p1, p2, c, force, damping)
    u11, u12, u22 = potential_hessian(trig, s12, (lift, spring, gravity), force)
    det = metric_determinant(mass, slider, k, c12)
    half = slider * k * dk
    # Rates at constant momenta: M dw = dp - dM w.
    by_phi = rates_from_momenta(-2.0 * half * w1 - c12 * w2, -c12 * w1, s12, det)
    by_theta = rates_from_momenta(-c12 * w2, -c12 * w1, s12, det)
    by_p1 = 1.0 / det, -s12 / det
    by_p2 = -s12 / det, metric_11(mass, slider, k) / det
    # p1' and p2' depend on the angles themselves and on the rates: g = d(p1', p2')/d(w1, w2).
    g11 = 2.0 * half * w1 + c12 * w2 - damping * k * k
    g12, g21, g22 = c12 * w1, c12 * w2, c12 * w1
    bend = -s12 * w1 * w2
    e11 = slider * (dk * dk + k * ddk) * w1 * w1 + bend - u11 - 2.0 * damping * k * dk * w1
    return (
        by_phi,
        by_theta,
        by_p1,
        by_p2,
        (e11 + g11 * by_phi[0] + g12 * by_phi[1], bend - u12 + g21 * by_phi[0] + g22 * by_phi[1]),
        (
            bend - u12 + g11 * by_theta[0] + g12 * by_theta[1],
            bend - u22 + g21 * by_theta[0] + g22 * by_theta[1],
        ),
        (g11 * by_p1[0] + g12 * by_p1[1], g21 * by_p1[0] + g22 * by_p1[1]),
        (g11 * by_p2[0] + g12 * by_p2[1], g21 * by_p2[0] + g22 * by_p2[1]),
    )
