"""Small motion about the configurations of many trajectories, each with parameters of its own."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.mechanism.coefficients import Coefficients
from fastmech.mechanism.reduced import metric_11, metric_determinant, potential_gradient, slider_ratio
from fastmech.stability.linearize import SmallMotion, fill_state_matrix, small_motion

Floats = NDArray[np.float64]

#: Angle [rad] after which a motion has left a configuration.
NEAR = 1.0


def state_matrices(c: Coefficients, phi: Any, theta: Any) -> Floats:
    """Matrices of the motion linearized at rest in configurations (n,), shape (4, 4, n).

    ``c`` are reduced coefficients, numbers or one a configuration; their force is taken as constant.
    """
    out = np.empty((4, 4, phi.size))
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        values: Any = (c.mass, c.slider, c.lift, c.spring, c.gravity, c.force, c.damping)
        fill_state_matrix(SmallMotion(*small_motion(phi, theta, *values)), out)
    return out


def eigenvalues(matrices: Floats) -> NDArray[np.complex128]:
    """Eigenvalues [1/s] of state matrices (4, 4, n), shape (n, 4)."""
    return np.asarray(np.linalg.eigvals(np.moveaxis(matrices, -1, 0)), dtype=np.complex128)


def eigenvalue_bound(matrices: Floats) -> Floats:
    """Bound [1/s] on the eigenvalues' magnitudes of state matrices (4, 4, n), shape (n,).

    x'' = -A x - B x' with x' measured in units of s has a norm of max(s, |A|/s + |B|); the best s makes both
    the same.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        norms = np.abs(matrices[2:])
        stiff, damped = (norms[:, part].sum(axis=1).max(axis=0) for part in (slice(2), slice(2, 4)))
        return np.asarray(0.5 * (damped + np.sqrt(damped * damped + 4.0 * stiff)))


def time_near(c: Coefficients, states: Floats) -> Floats:
    """Time [s] in which motions (n, 4) leave where they are by :data:`NEAR`; inf at rest in an equilibrium.

    From their rates and the acceleration at rest, as the motion that starts so goes on at first.
    """
    phi, theta = states[:, :2].T
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        s1, c1, s2, c2 = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
        s12, c12 = s1 * c2 + c1 * s2, c1 * c2 - s1 * s2
        u1, u2 = potential_gradient(s1, c1, s2, c2, c12, c.lift, c.spring, c.gravity, c.force)
        k = slider_ratio(s1, c1)[0]
        determinant = metric_determinant(c.mass, c.slider, k, c12)
        a1 = (s12 * u2 - u1) / determinant
        a2 = (s12 * u1 - metric_11(c.mass, c.slider, k) * u2) / determinant
        speed = np.abs(states[:, 2:]).max(axis=1)
        acceleration = np.maximum(np.abs(a1), np.abs(a2))
        return np.asarray(2.0 * NEAR / (speed + np.sqrt(speed * speed + 2.0 * NEAR * acceleration)))
