"""Lagrange's description in SI units: metric, Christoffel symbols, forces, accelerations, paper (8)-(13).

Angles ``q`` have shape (..., 2), states ``y`` (..., 4): phi, theta [rad], phi', theta' [rad/s].
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Floats
from fastmech.scene import Scene
from fastmech.slider import reduced
from fastmech.slider.coefficients import force, reduce
from fastmech.slider.reduced import lagrange_accelerations


def unit(scene: Scene) -> float:
    """m2 l^2 [kg m2]: what reduced quantities are multiplied by."""
    return scene.m2 * scene.l**2


def metric(scene: Scene, q: ArrayLike) -> Floats:
    """Metric tensor a_(alpha beta) [kg m2], paper (11); shape (..., 2, 2)."""
    phi, theta = _split(q, 2)
    coefficients = reduce(scene)
    k, _ = reduced.slider_ratio(np.sin(phi), np.cos(phi))
    a11 = reduced.metric_11(coefficients.mass, coefficients.slider, k)
    s12 = np.sin(phi + theta)
    return unit(scene) * _symmetric(a11, s12, np.ones_like(s12))


def christoffel(scene: Scene, q: ArrayLike) -> Floats:
    """Christoffel symbols of the first kind Gamma[..., gamma, alpha, beta] [kg m2], paper (12).

    ``Gamma[..., 0, 1, 1]`` is the paper's Gamma_22,1: the index behind the comma comes first.
    Gamma_11,1 is half of da11/dphi; the paper's print of it differs (see the paper report).
    """
    phi, theta = _split(q, 2)
    k, dk = reduced.slider_ratio(np.sin(phi), np.cos(phi))
    gamma = np.zeros((*np.shape(phi), 2, 2, 2))
    gamma[..., 0, 0, 0] = reduce(scene).slider * k * dk
    gamma[..., 0, 1, 1] = gamma[..., 1, 0, 0] = np.cos(phi + theta)
    return unit(scene) * gamma


def kinetic_energy(scene: Scene, y: ArrayLike) -> Floats:
    """Kinetic energy T [J], paper (8), (9)."""
    rates = np.asarray(y, dtype=np.float64)[..., 2:]
    a = metric(scene, np.asarray(y, dtype=np.float64)[..., :2])
    return np.asarray(0.5 * np.einsum("...i,...ij,...j", rates, a, rates))


def potential_energy(scene: Scene, q: ArrayLike, constant_force: float = 0.0) -> Floats:
    """Potential energy Pi [J], paper (10), or U = Pi - F x2 where a constant force F [N] is given."""
    trig, s12, _ = _trigonometry(q)
    u = reduced.potential(trig, s12, *_loads(scene, constant_force))
    return np.asarray(unit(scene) * u + (scene.c1 + scene.c2) * scene.l**2)


def potential_gradient(scene: Scene, q: ArrayLike, constant_force: float = 0.0) -> Floats:
    """Gradient of Pi, or of U = Pi - F x2, with respect to (phi, theta) [J]; shape (..., 2)."""
    trig, _, c12 = _trigonometry(q)
    u = reduced.potential_gradient(trig, c12, *_loads(scene, constant_force))
    return unit(scene) * np.stack(u, axis=-1)


def potential_hessian(scene: Scene, q: ArrayLike, constant_force: float = 0.0) -> Floats:
    """Hessian c_(alpha beta) of Pi, or of U = Pi - F x2 [J], paper (19); shape (..., 2, 2)."""
    trig, s12, _ = _trigonometry(q)
    u = reduced.potential_hessian(trig, s12, *_loads(scene, constant_force))
    return unit(scene) * _symmetric(*u)


def linear(scene: Scene, q: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Metric, the damper's coefficients and Hessian of U [kg m2, N m s, J], each (..., 2, 2)."""
    phi = np.asarray(q, dtype=np.float64)[..., 0]
    k, _ = reduced.slider_ratio(np.sin(phi), np.cos(phi))
    nothing = np.zeros_like(k)
    damping = _symmetric(scene.beta * (scene.l * k) ** 2, nothing, nothing)
    return metric(scene, q), damping, potential_hessian(scene, q, scene.F0)


def generalized_forces(scene: Scene, y: ArrayLike, t: ArrayLike) -> Floats:
    """Generalized forces Q_alpha [N m] of weight, springs, damper and force; shape (..., 2).

    The damper acts through the slider alone: -beta (dx3/dphi)^2 phi' on phi; the force through M2: F dx2/dq.
    """
    phi, theta, phi_dot, _ = _split(y, 4)
    l = scene.l
    k, _ = reduced.slider_ratio(np.sin(phi), np.cos(phi))
    push = force(scene, t) * l
    q1 = -scene.beta * (l * k) ** 2 * phi_dot - push * np.sin(phi)
    q2 = -push * np.cos(theta)
    return np.stack(np.broadcast_arrays(q1, q2), axis=-1) - potential_gradient(scene, np.asarray(y)[..., :2])


def angular_accelerations(scene: Scene, y: ArrayLike, t: ArrayLike) -> Floats:
    """phi'', theta'' [rad/s2] from paper (13); shape (..., 2). The arithmetic that compiled lanes run."""
    phi, theta, phi_dot, theta_dot = _split(y, 4)
    c = reduce(scene)
    now = force(scene, t) / (scene.m2 * scene.l)
    trig = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    pair = lagrange_accelerations(trig, (phi_dot, theta_dot), c[:5], now, c.damping)
    return np.stack(np.broadcast_arrays(*pair), axis=-1)


def _split(values: ArrayLike, n: int) -> tuple[Floats, ...]:
    array = np.asarray(values, dtype=np.float64)
    return tuple(array[..., i] for i in range(n))


def _symmetric(a11: Floats, a12: Floats, a22: Floats) -> Floats:
    return np.stack([np.stack([a11, a12], axis=-1), np.stack([a12, a22], axis=-1)], axis=-2)


def _trigonometry(q: ArrayLike) -> tuple[tuple[Floats, ...], Floats, Floats]:
    phi, theta = _split(q, 2)
    trig = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    return trig, np.sin(phi + theta), np.cos(phi + theta)


def _loads(scene: Scene, constant_force: float) -> tuple[tuple[float, float, float], float]:
    c = reduce(scene)
    return (c.lift, c.spring, c.gravity), constant_force / (scene.m2 * scene.l)


def momenta(scene: Scene, y: ArrayLike) -> Floats:
    """Generalized momenta p = dT/dq' of states ``y`` (..., 4), shape (..., 2) [kg m2/s]."""
    y = np.asarray(y, dtype=np.float64)
    return np.asarray(np.einsum("...ij,...j->...i", metric(scene, y[..., :2]), y[..., 2:]))
