"""How large a disturbance is: one norm for angles and rates together; random ones, and what confines them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from fastmech.equilibria.find import Equilibrium
from fastmech.mechanism.lagrange import kinetic_energy, metric, potential_energy, potential_hessian, unit
from fastmech.scene import Scene

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Size:
    """The kinetic-energy norm at an equilibrium, in radians of theta.

    ``size(xi, eta)^2 = (xi' a xi + eta' a eta / omega^2) / (m2 l^2)`` with the metric ``a`` at the
    equilibrium, the departures ``xi`` [rad] and ``eta`` [rad/s], and ``omega`` [rad/s] the square root of
    the largest generalized eigenvalue, in magnitude, of the Hessian and the metric: the highest natural
    frequency at a minimum. A departure of theta alone has its own angle as its size;
    ``size^2 omega^2 m2 l^2 / 2`` is the kinetic energy of the disturbance once its angles have turned to
    rates.
    """

    metric: Floats  #: a / (m2 l^2), shape (2, 2)
    omega: float  #: rad/s

    @cached_property
    def to_ball(self) -> Floats:
        """Matrix (4, 4): ``disturbance @ to_ball`` is a point whose length is the disturbance's size."""
        lower = np.linalg.cholesky(self.metric)
        return scipy.linalg.block_diag(lower, lower / self.omega)

    def __call__(self, disturbance: Floats) -> Floats:
        """Sizes [rad] of disturbances (..., 4)."""
        with np.errstate(invalid="ignore", over="ignore"):  # what is not finite has no finite size
            return np.asarray(np.linalg.norm(disturbance @ self.to_ball, axis=-1))

    def from_ball(self, points: Floats) -> Floats:
        """Disturbances (..., 4) whose sizes are the lengths of ``points`` (..., 4)."""
        return np.asarray(points @ np.linalg.inv(self.to_ball))


def size_at(scene: Scene, phi: float, theta: float) -> Size:
    """The norm at the equilibrium (phi, theta) [rad] of a scene with a constant force."""
    q = (phi, theta)
    a = metric(scene, q)
    hessian = potential_hessian(scene, q, scene.F0)
    curvature = np.max(np.abs(scipy.linalg.eigvalsh(hessian, a)))
    # Without any stiffness (all curvature gone) there is no frequency; 1 rad/s keeps the norm defined.
    return Size(a / unit(scene), float(np.sqrt(curvature)) or 1.0)


def excess_energy(scene: Scene, e: Equilibrium, y: Floats) -> Floats:
    """T + U of states (n, 4) above U at an equilibrium [J]."""
    with np.errstate(invalid="ignore", over="ignore"):  # states that are not finite are nowhere at rest
        return kinetic_energy(scene, y) + potential_energy(scene, y[:, :2], scene.F0) - e.energy


def confining_energy(scene: Scene, e: Equilibrium, radius: float) -> float:
    """Energy [J] with which a motion about a minimum stays in the ball of the given radius [rad].

    With the lowest squared frequency s the energy is at least s m2 l^2 size^2 / 2 (the norm's omega is the
    highest frequency), to second order.
    """
    lowest = float(scipy.linalg.eigvalsh(e.hessian, metric(scene, (e.phi, e.theta)))[0])
    return 0.5 * lowest * unit(scene) * radius * radius


def uniform_ball(rng: np.random.Generator, n: int) -> Floats:
    """Points uniform in the unit ball of four dimensions, shape (n, 4)."""
    directions = unit_directions(rng, n)
    return directions * rng.random((n, 1)) ** 0.25


def unit_directions(rng: np.random.Generator, n: int) -> Floats:
    """Points uniform on the unit sphere of four dimensions, shape (n, 4)."""
    normal = rng.standard_normal((n, 4))
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))
