"""Small motion about the configurations of many trajectories, each with parameters of its own."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.jit import inlined
from fastmech.mechanism.coefficients import Coefficients
from fastmech.mechanism.reduced import potential_gradient
from fastmech.stability.linearize import (
    SmallMotion,
    fill_state_matrix,
    polynomial,
    small_motion,
    small_motion_at,
)

Floats = NDArray[np.float64]

#: Angle [rad] after which a motion has left a configuration.
NEAR = 1.0


class LocalMotion(NamedTuple):
    """The small motion where trajectories are, and how long they are there; each of shape (n,)."""

    p3: Floats  #: lambda^4 + p3 lambda^3 + p2 lambda^2 + p1 lambda + p0 is the characteristic polynomial
    p2: Floats
    p1: Floats
    p0: Floats
    time: Floats  #: see :func:`local_motion` [s]


def local_motion(c: Coefficients, states: Floats) -> LocalMotion:
    """The motion linearized at rest in the configurations of states (n, 4), and the time spent there.

    ``c`` are reduced coefficients, numbers or one a configuration; their force is taken as constant. The time
    is that in which motions leave where they are by :data:`NEAR`, from their rates and the acceleration at
    rest, as the motion that starts so goes on at first; inf at rest in an equilibrium.
    """
    phi, theta, rate_1, rate_2 = np.ascontiguousarray(states.T)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        at = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
        motion = small_motion_at(*at, *_of_motion(c))
        time = time_near(*at, rate_1, rate_2, motion, c.lift, c.spring, c.gravity, c.force)
        p3, p2, p1, p0 = (np.asarray(p) for p in polynomial(motion))
        return LocalMotion(p3, p2, p1, p0, time)


@inlined
def time_near(
    s1: Any,
    c1: Any,
    s2: Any,
    c2: Any,
    rate_1: Any,
    rate_2: Any,
    motion: SmallMotion,
    lift: Any,
    spring: Any,
    gravity: Any,
    force: Any,
) -> Any:
    """The time [s] that :func:`local_motion` tells of, from sines, cosines and rates [rad/s]."""
    c12 = c1 * c2 - s1 * s2
    u1, u2 = potential_gradient(s1, c1, s2, c2, c12, lift, spring, gravity, force)
    pull_1, pull_2 = motion.s12 * u2 - u1, motion.s12 * u1 - motion.m11 * u2
    acceleration = np.maximum(np.abs(pull_1), np.abs(pull_2)) / motion.determinant
    speed = np.maximum(np.abs(rate_1), np.abs(rate_2))
    return 2.0 * NEAR / (speed + np.sqrt(speed * speed + 2.0 * NEAR * acceleration))


def part(c: Coefficients, members: Any) -> Coefficients:
    """The coefficients of some of the trajectories."""
    values: Any = (value[members] if np.ndim(value) else value for value in map(np.asarray, c))
    return Coefficients(*values)


def _of_motion(c: Coefficients) -> Any:
    """The coefficients that small motion depends on, in the order of :func:`small_motion`."""
    return c.mass, c.slider, c.lift, c.spring, c.gravity, c.force, c.damping


@inlined
def bound_of(p3: Any, p2: Any, p0: Any) -> Any:
    """Bound [1/s] on the magnitudes of small motion's eigenvalues from its characteristic polynomial.

    With x* M x = 1 an eigenvector x has lambda^2 + b lambda + k = 0: b = x* B x lies between 0 and p3, the
    one eigenvalue of M^-1 B that is not 0, k = x* K x between the two of M^-1 K, with w^2 - p2 w + p0 = 0.
    """
    half = 0.5 * p2
    stiff = np.abs(half) + np.sqrt(np.maximum(half * half - p0, 0.0))
    return 0.5 * (p3 + np.sqrt(p3 * p3 + 4.0 * stiff))


def eigenvalue_bound(motion: LocalMotion) -> Floats:
    """:func:`bound_of` small motions, shape (n,)."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.asarray(bound_of(motion.p3, motion.p2, motion.p0))


def state_matrices(c: Coefficients, phi: Any, theta: Any) -> Floats:
    """Matrices of the motion linearized at rest in configurations (n,), shape (4, 4, n)."""
    out = np.empty((4, 4, phi.size))
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        fill_state_matrix(small_motion(phi, theta, *_of_motion(c)), out)
    return out


def eigenvalues(matrices: Floats) -> NDArray[np.complex128]:
    """Eigenvalues [1/s] of state matrices (4, 4, n), shape (n, 4)."""
    return np.asarray(np.linalg.eigvals(np.moveaxis(matrices, -1, 0)), dtype=np.complex128)
