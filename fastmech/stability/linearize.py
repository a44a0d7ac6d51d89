"""The equations of small motion at an equilibrium, M x'' + B x' + K x = 0, reduced (over m2 l^2).

M is the metric (paper (11)), B = diag(beta k^2 l^2, 0) the slider's damper, K the Hessian of U (paper (19)).
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from fastmech.jit import inlined
from fastmech.mechanism.coefficients import Coefficients, reduce
from fastmech.mechanism.reduced import metric_11, metric_determinant, potential_hessian, slider_ratio
from fastmech.scene import Scene
from fastmech.stability.arguments import require_rest

FloatArray = NDArray[np.float64]


class Rest(Protocol):
    """What is needed of an equilibrium; ``fastmech.equilibria.find.Equilibrium`` has it."""

    @property
    def phi(self) -> float:
        """[rad]."""
        ...

    @property
    def theta(self) -> float:
        """[rad]."""
        ...

    @property
    def morse_index(self) -> int:
        """Negative eigenvalues of the Hessian, if proved."""
        ...

    @property
    def radius(self) -> float:
        """How far the true equilibrium may be [rad]; inf if unknown."""
        ...

    @property
    def force(self) -> float:
        """Frozen force [N]."""
        ...


class SmallMotion(NamedTuple):
    """Matrices of the small motion, reduced; M = [[m11, s12], [s12, 1]], B = [[b11, 0], [0, 0]]."""

    m11: float
    s12: float  #: sin(phi + theta), the coupling of the metric
    determinant: float  #: of M
    k: float  #: the slider's ratio -(dx3/dphi)/l
    b11: float  #: [1/s]
    k11: float  #: [1/s^2]
    k12: float
    k22: float


@inlined
def small_motion(
    phi: float,
    theta: float,
    mass: float,
    slider: float,
    lift: float,
    spring: float,
    gravity: float,
    force: float,
    damping: float,
) -> SmallMotion:
    """Matrices of the small motion about (phi, theta) from the reduced coefficients."""
    return small_motion_at(
        np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta),
        mass, slider, lift, spring, gravity, force, damping,
    )  # fmt: skip


@inlined
def small_motion_at(
    s1: float,
    c1: float,
    s2: float,
    c2: float,
    mass: float,
    slider: float,
    lift: float,
    spring: float,
    gravity: float,
    force: float,
    damping: float,
) -> SmallMotion:
    """The same from sines and cosines: ``s1, c1`` of phi, ``s2, c2`` of theta."""
    s12, c12 = s1 * c2 + c1 * s2, c1 * c2 - s1 * s2
    k = slider_ratio(s1, c1)[0]
    k11, k12, k22 = potential_hessian(s1, c1, s2, c2, s12, lift, spring, gravity, force)
    return SmallMotion(
        metric_11(mass, slider, k),
        s12,
        metric_determinant(mass, slider, k, c12),
        k,
        damping * k * k,
        k11,
        k12,
        k22,
    )


@inlined
def polynomial(s: SmallMotion) -> tuple[float, float, float, float]:
    """(p3, p2, p1, p0) of the characteristic polynomial lambda^4 + p3 lambda^3 + .. + p0 (paper, Table 4)."""
    p3 = s.b11 / s.determinant
    p2 = (s.k11 + s.m11 * s.k22 - 2.0 * s.s12 * s.k12) / s.determinant
    return p3, p2, p3 * s.k22, (s.k11 * s.k22 - s.k12 * s.k12) / s.determinant


@inlined
def fill_state_matrix(s: SmallMotion, out: FloatArray) -> None:
    """Write the 4 x 4 matrix that takes (xi_phi, xi_theta, eta_phi, eta_theta) to its rate, eta = xi'."""
    d = s.determinant
    out[:] = 0.0
    out[0, 2] = 1.0
    out[1, 3] = 1.0
    out[2, 0] = (s.s12 * s.k12 - s.k11) / d
    out[2, 1] = (s.s12 * s.k22 - s.k12) / d
    out[2, 2] = -s.b11 / d
    out[3, 0] = (s.s12 * s.k11 - s.m11 * s.k12) / d
    out[3, 1] = (s.s12 * s.k12 - s.m11 * s.k22) / d
    out[3, 2] = s.s12 * s.b11 / d


def linearized(scene: Scene, equilibrium: Rest) -> tuple[Coefficients, SmallMotion]:
    """Reduced coefficients with the equilibrium's frozen force, and its small motion.

    Raises:
        InputError: an argument is wrong, or the scene does not rest there.
    """
    require_rest(scene, equilibrium)
    c = reduce(scene)._replace(force=equilibrium.force / (scene.m2 * scene.l))
    motion = small_motion(
        equilibrium.phi, equilibrium.theta, c.mass, c.slider, c.lift, c.spring, c.gravity, c.force, c.damping
    )
    return c, SmallMotion(*(float(value) for value in motion))


def jacobian(scene: Scene, equilibrium: Rest) -> FloatArray:
    """State matrix (4, 4) of the linearized motion of (xi_phi, xi_theta, eta_phi, eta_theta), paper (21).

    Raises:
        InputError: as ``linearized``.
    """
    matrix = np.empty((4, 4))
    fill_state_matrix(linearized(scene, equilibrium)[1], matrix)
    return matrix
