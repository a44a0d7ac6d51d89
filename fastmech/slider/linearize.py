"""Small motion at an equilibrium, M x'' + B x' + K x = 0, reduced (over m2 l^2), and its undamped modes.

M is the metric (paper (11)), B = diag(beta k^2 l^2, 0) the slider's damper, K the Hessian of U (paper (19)).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.errors import InputError
from fastmech.jit import inlined
from fastmech.scene import Scene, require_scene
from fastmech.slider.coefficients import Coefficients, reduce
from fastmech.slider.equilibria import Equilibrium, require_one, under_force
from fastmech.slider.lagrange import potential_gradient, unit
from fastmech.slider.reduced import metric_11, metric_determinant, potential_hessian, slider_ratio

#: Share of the loads that may be left unbalanced: above rounding, below what another scene's loads leave; and
#: of a place that is not proved to be one of rest, as beside a fold.
NOT_AT_REST, NOT_PROVED = 1e-12, 1e-7


def require_rest(scene: Any, equilibrium: Any) -> None:
    """Refuse what is no scene with one of its equilibria.

    An equilibrium is the scene's if it balances under a force that the scene has at some time: F0 where
    alpha = 0, else one between F0 and none.

    Raises:
        InputError: one of them is something else, a coordinate is not finite, or the scene does not rest
            there.
    """
    require_scene(scene)
    require_one(equilibrium, Equilibrium)
    for name in ("phi", "theta", "force"):
        value = float(getattr(equilibrium, name))
        if not math.isfinite(value):
            raise InputError(f"equilibrium.{name} = {value:g}: must be finite")
    first, last = scene.F0, scene.F0 if scene.alpha == 0.0 else 0.0
    force = min(max(equilibrium.force, min(first, last)), max(first, last))
    c = reduce(scene, force)
    loads = abs(c.lift) + (c.mass + 2.0) * c.gravity + 2.0 * c.spring + 2.0 * abs(c.force)
    left = abs(potential_gradient(scene, (equilibrium.phi, equilibrium.theta), force)).max() / unit(scene)
    beside = abs(equilibrium.force - force) / (scene.m2 * scene.l)
    share = NOT_AT_REST if equilibrium.radius < math.inf else NOT_PROVED
    if not max(left, beside) <= share * loads:
        raise InputError(
            f"equilibrium = ({equilibrium.phi:g}, {equilibrium.theta:g}) rad, "
            f"F = {equilibrium.force:.12g} N: this scene (F0 = {scene.F0:.12g} N, "
            f"alpha = {scene.alpha:g} 1/s) does not rest there; "
            "take one of fastmech.find_equilibria(scene)"
        )


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
def small_motion(phi: Any, theta: Any, c: Any) -> SmallMotion:
    """Matrices of the small motion about (phi, theta); ``c`` are reduced coefficients, the force frozen."""
    mass, slider, lift, spring, gravity, force, damping, _ = c
    s1, c1, s2, c2 = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    s12, c12 = s1 * c2 + c1 * s2, c1 * c2 - s1 * s2
    k = slider_ratio(s1, c1)[0]
    k11, k12, k22 = potential_hessian((s1, c1, s2, c2), s12, (lift, spring, gravity), force)
    m11, determinant = metric_11(mass, slider, k), metric_determinant(mass, slider, k, c12)
    return SmallMotion(m11, s12, determinant, k, damping * k * k, k11=k11, k12=k12, k22=k22)


@inlined
def polynomial(s: SmallMotion) -> tuple[float, float, float, float]:
    """(p3, p2, p1, p0) of the characteristic polynomial lambda^4 + p3 lambda^3 + .. + p0 (paper, Table 4)."""
    p3 = s.b11 / s.determinant
    p2 = (s.k11 + s.m11 * s.k22 - 2.0 * s.s12 * s.k12) / s.determinant
    return p3, p2, p3 * s.k22, (s.k11 * s.k22 - s.k12 * s.k12) / s.determinant


def fill_state_matrix(s: SmallMotion, out: Floats) -> None:
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


def linearized(scene: Scene, equilibrium: Equilibrium) -> tuple[Coefficients, SmallMotion]:
    """Reduced coefficients with the equilibrium's frozen force, and its small motion.

    Raises:
        InputError: an argument is wrong, or the scene does not rest there.
    """
    require_rest(scene, equilibrium)
    c = reduce(scene, equilibrium.force)
    motion = small_motion(equilibrium.phi, equilibrium.theta, c)
    return c, SmallMotion(*(float(value) for value in motion))


def jacobian(scene: Scene, equilibrium: Equilibrium) -> Floats:
    """State matrix (4, 4) of (xi_phi, xi_theta, eta_phi, eta_theta), paper (21); raises as ``linearized``."""
    matrix = np.empty((4, 4))
    fill_state_matrix(linearized(scene, equilibrium)[1], matrix)
    return matrix


#: Names of the three measures that must be away from zero for the damper to reach both modes.
SIN_PHI = "sin phi"
SIN_PSI = "sin(phi+theta)"
UNLOADED = "U_theta,theta - C"

#: What it means when one of them vanishes.
MEANING = {
    SIN_PHI: "the slider is at dead centre (sin phi = 0), so small motions do not move the damper",
    SIN_PSI: "sin(phi+theta) = 0, so M2 swings without pulling at M1",
    UNLOADED: "U_theta,theta = C, so the rod M1M2 is unloaded and M2 swings without pulling at M1",
}


@inlined
def squares(s: SmallMotion) -> tuple[float, float]:
    """Squares of the undamped natural frequencies [1/s^2], rising; negative ones grow instead.

    They are the roots of det(K - w^2 M), found from the Hessian in the Cholesky coordinates of M.
    """
    # With M = L L^T, L = [[r, s12], [0, 1]] (upper), r = sqrt(det M): L^-1 K L^-T is symmetric.
    r = np.sqrt(s.determinant)
    h12 = (s.k12 - s.s12 * s.k22) / r
    h11 = (s.k11 - 2.0 * s.s12 * s.k12 + s.s12 * s.s12 * s.k22) / s.determinant
    mean, half = 0.5 * (h11 + s.k22), 0.5 * (h11 - s.k22)
    spread = np.hypot(half, h12)
    larger = mean + np.copysign(spread, mean)
    product = (s.k11 * s.k22 - s.k12 * s.k12) / s.determinant
    smaller = product / larger if larger != 0.0 else 0.0
    return min(larger, smaller), max(larger, smaller)


def reach(s: SmallMotion, spring: float) -> dict[str, float]:
    """Three measures in [0, 1] of how well the damper reaches the modes; a mode is missed where one is zero.

    A mode that the damper misses has phi at rest: either k = 0 (sin phi = 0), or (0, 1) is an eigenvector of
    (K, M), K12 = sin(phi+theta) K22, which by K12 = C sin(phi+theta) means one of the other two.
    """
    total = abs(s.k22) + spring
    return {
        # k = sin phi (1 + cos phi / sqrt(4 - sin^2 phi)) <= 4/3 and zero only with sin phi.
        SIN_PHI: 0.75 * abs(s.k),
        SIN_PSI: abs(s.s12),
        UNLOADED: abs(s.k22 - spring) / total if total > 0.0 else 0.0,
    }


@inlined
def slowest_decay(
    s: SmallMotion, spring: float, low: float, high: float, p: tuple[float, float, float, float]
) -> float:
    """Decay rate [1/s] of the mode that the damper reaches least, for a minimum of U; zero if it is missed.

    For where eigenvalues have no digits left: weak, missing or enormous damping. The characteristic
    polynomial is (x^2 + w1^2)(x^2 + w2^2) + p3 x (x^2 + K22) with w1^2 <= K22 <= w2^2. Roots near i w, to
    first order in p3 or in the gap |K22 - w^2|, with W the other frequency:

        rate = p3 gap (W^2 - w^2) / (2 ((W^2 - w^2)^2 + p3^2 w^2)).

    For large p3 the same with the product of both gaps and K22 for w^2, and a real root at -p0/(p3 K22). The
    product is (K12 - sin(phi+theta) K22)^2 / det M, which gives the smaller gap without cancellation.
    """
    p3, _, p1, p0 = p
    split = high - low
    if not split > 0.0 or p3 == 0.0:
        return 0.0
    product = (s.s12 * (spring - s.k22)) ** 2 / s.determinant
    if p3 * p3 > high:
        return min(p3 * product / (2.0 * (split * split + p3 * p3 * s.k22)), p0 / p1)
    below, above = s.k22 - low, high - s.k22
    if below < above:
        below = product / above
    else:
        above = product / below
    return min(
        p3 * below * split / (2.0 * (split * split + p3 * p3 * low)),
        p3 * above * split / (2.0 * (split * split + p3 * p3 * high)),
    )


#: Configurations a side of the grid over both angles at which the small motion is looked at.
SIDE = 24

#: Angle [rad] within which eigenvalues of the same direction are told by their largest alone.
DIRECTION = 0.03


def under_its_forces(scene: Scene) -> list[Scene]:
    """The scene with its force at full strength, and with what the force comes to."""
    forces = {scene.F0, scene.F0 if scene.alpha == 0.0 else 0.0}
    return [under_force(scene, force) for force in sorted(forces)]


def configuration_eigenvalues(scene: Scene, force: float) -> NDArray[np.complex128]:
    """Eigenvalues [1/s] of the motion linearized at rest all over the torus, shape (SIDE^2, 4).

    Where the stiffness pushes (eigenvalues with positive real part) there is nothing for a step to keep
    stable.
    """
    angles = np.linspace(-np.pi, np.pi, SIDE, endpoint=False) + np.pi / SIDE
    phi, theta = (grid.ravel() for grid in np.meshgrid(angles, angles, indexing="ij"))
    matrices = np.empty((4, 4, phi.size))
    fill_state_matrix(small_motion(phi, theta, reduce(scene, force)), matrices)
    return np.asarray(np.linalg.eigvals(np.moveaxis(matrices, -1, 0)), dtype=np.complex128)


def passing_eigenvalues(scenes: list[Scene]) -> NDArray[np.complex128]:
    """Of the eigenvalues [1/s] of scenes under constant forces those that set the limit of a step."""
    values = np.concatenate([configuration_eigenvalues(scene, scene.F0).ravel() for scene in scenes])
    # The region is star-shaped enough: of eigenvalues with a common direction the largest sets the limit.
    # Conjugate eigenvalues say the same.
    values = np.where(values.imag < 0.0, values.conj(), values)
    directions = np.round(np.angle(values) / DIRECTION)
    alike = (values[directions == d] for d in np.unique(directions))
    return np.array([some[np.argmax(np.abs(some))] for some in alike])
