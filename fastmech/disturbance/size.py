"""How large a disturbance is: one norm for angles and rates together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from fastmech.mechanism.lagrange import metric, potential_hessian, unit
from fastmech.scene import Scene

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Size:
    """The kinetic-energy norm at an equilibrium, in radians of theta.

    ``size(xi, eta)^2 = (xi' a xi + eta' a eta / omega^2) / (m2 l^2)`` with the metric ``a`` at the
    equilibrium, the departures ``xi`` [rad] and ``eta`` [rad/s], and ``omega`` [rad/s] the square root of
    the largest generalized eigenvalue, in magnitude, of the Hessian and the metric: the highest natural
    frequency at a minimum. A departure of theta alone has its own angle as its size; ``size^2 omega^2 m2 l^2 / 2``
    is the kinetic energy of the disturbance once its angles have turned to rates.
    """

    metric: Floats  #: a / (m2 l^2), shape (2, 2)
    omega: float  #: rad/s

    def __call__(self, disturbance: Floats) -> Floats:
        """Sizes [rad] of disturbances (..., 4)."""
        xi, eta = disturbance[..., :2], disturbance[..., 2:] / self.omega
        square = np.einsum("...i,ij,...j", xi, self.metric, xi)
        return np.asarray(np.sqrt(square + np.einsum("...i,ij,...j", eta, self.metric, eta)))

    def from_ball(self, points: Floats) -> Floats:
        """Disturbances (..., 4) whose sizes are the lengths of ``points`` (..., 4)."""
        lower = np.linalg.cholesky(self.metric)
        unscaled = np.linalg.solve(lower.T, np.stack([points[..., :2], points[..., 2:]], axis=-1))
        return np.concatenate([unscaled[..., 0], unscaled[..., 1] * self.omega], axis=-1)


def size_at(scene: Scene, phi: float, theta: float) -> Size:
    """The norm at the equilibrium (phi, theta) [rad] of a scene with a constant force."""
    q = (phi, theta)
    a = metric(scene, q)
    hessian = potential_hessian(scene, q, scene.F0)
    curvature = np.max(np.abs(scipy.linalg.eigvalsh(hessian, a)))
    # Without any stiffness (all curvature gone) there is no frequency; 1 rad/s keeps the norm defined.
    return Size(a / unit(scene), float(np.sqrt(curvature)) or 1.0)
