"""How large a disturbance is: one norm for angles and rates together; random ones, and what confines them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg

from fastmech.arrays import Floats
from fastmech.equilibria.find import Equilibrium
from fastmech.mechanism.lagrange import kinetic_energy, metric, potential_energy, potential_hessian, unit
from fastmech.models.equilibria import RestingPlace
from fastmech.models.mechanism import Mechanism
from fastmech.scene import Scene


@dataclass(frozen=True)
class Size:
    """The kinetic-energy norm at an equilibrium, in radians of theta, or in the last coordinate's unit.

    ``size(xi, eta)^2 = (xi' a xi + eta' a eta / omega^2) / (m2 l^2)`` with the metric ``a`` at the
    equilibrium, the departures ``xi`` [rad] and ``eta`` [rad/s], and ``omega`` [rad/s] the square root of
    the largest generalized eigenvalue, in magnitude, of the Hessian and the metric: the highest natural
    frequency at a minimum. A departure of theta alone has its own angle as its size;
    ``size^2 omega^2 m2 l^2 / 2`` is the kinetic energy of the disturbance once its angles have turned to
    rates. Of a ``Mechanism`` the metric's last entry takes the place of m2 l^2, which it is for the paper's.
    """

    metric: Floats  #: a / (m2 l^2), shape (n, n)
    omega: float  #: rad/s

    @cached_property
    def to_ball(self) -> Floats:
        """Matrix (2 n, 2 n): ``disturbance @ to_ball`` is a point whose length is the disturbance's size."""
        lower = np.linalg.cholesky(self.metric)
        return scipy.linalg.block_diag(lower, lower / self.omega)

    def __call__(self, disturbance: Floats) -> Floats:
        """Sizes [rad] of disturbances (..., 2 n)."""
        with np.errstate(invalid="ignore", over="ignore"):  # what is not finite has no finite size
            return np.asarray(np.linalg.norm(disturbance @ self.to_ball, axis=-1))

    def from_ball(self, points: Floats) -> Floats:
        """Disturbances (..., 2 n) whose sizes are the lengths of ``points`` (..., 2 n)."""
        return np.asarray(points @ np.linalg.inv(self.to_ball))


def size_at(scene: Scene, phi: float, theta: float) -> Size:
    """The norm at the equilibrium (phi, theta) [rad] of a scene with a constant force."""
    q = (phi, theta)
    return _size(metric(scene, q), potential_hessian(scene, q, scene.F0), unit(scene))


def _size(a: Floats, hessian: Floats, inertia: float) -> Size:
    curvature = np.max(np.abs(scipy.linalg.eigvalsh(hessian, a)))
    # Without any stiffness (all curvature gone) there is no frequency; 1 rad/s keeps the norm defined.
    return Size(a / inertia, float(np.sqrt(curvature)) or 1.0)


def size_of(system: Scene | Mechanism, e: Equilibrium | RestingPlace) -> Size:
    """The norm at an equilibrium of a scene with a constant force, or of a mechanism."""
    if isinstance(system, Scene):
        return size_at(system, *e.position)
    linear = system.linear(e.position)
    return _size(linear.mass, 0.5 * (linear.stiffness + linear.stiffness.T), linear.mass[-1, -1])


def excess_energy(system: Scene | Mechanism, e: Equilibrium | RestingPlace, y: Floats) -> Floats:
    """T + U of states (n, states) above U at an equilibrium [J], loads at what they come to."""
    with np.errstate(all="ignore"):  # states that are not finite are nowhere at rest
        if isinstance(system, Mechanism):
            return np.asarray(system.evaluate("bounding", y.T)[0] - e.energy)
        return kinetic_energy(system, y) + potential_energy(system, y[:, :2], system.F0) - e.energy


def confining_energy(system: Scene | Mechanism, e: Equilibrium | RestingPlace, radius: float) -> float:
    """Energy [J] with which a motion about a minimum stays in the ball of the given radius [rad].

    With the lowest squared frequency s the energy is at least s m2 l^2 size^2 / 2 (the norm's omega is the
    highest frequency), to second order.
    """
    if isinstance(e, RestingPlace):
        assert isinstance(system, Mechanism)
        a = system.metric(e.position)
        stiffness, inertia = 0.5 * (e.stiffness + e.stiffness.T), float(a[-1, -1])
    else:
        assert isinstance(system, Scene)
        a, stiffness, inertia = metric(system, (e.phi, e.theta)), e.hessian, unit(system)
    return 0.5 * float(scipy.linalg.eigvalsh(stiffness, a)[0]) * inertia * radius * radius


def uniform_ball(rng: np.random.Generator, n: int, dim: int = 4) -> Floats:
    """Points uniform in the unit ball of ``dim`` dimensions, shape (n, dim)."""
    directions = unit_directions(rng, n, dim)
    return directions * rng.random((n, 1)) ** (1.0 / dim)


def unit_directions(rng: np.random.Generator, n: int, dim: int = 4) -> Floats:
    """Points uniform on the unit sphere of ``dim`` dimensions, shape (n, dim)."""
    normal = rng.standard_normal((n, dim))
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))
