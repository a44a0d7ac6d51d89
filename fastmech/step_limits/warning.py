"""What is wrong with a step before the run begins, in one line with the number that would do."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.integrators.methods import find_method
from fastmech.mechanism.coefficients import reduce
from fastmech.scene import Scene
from fastmech.stability.linearize import SmallMotion, fill_state_matrix, small_motion
from fastmech.step_limits.impulse import impulse_limit, impulse_ratio
from fastmech.step_limits.predict import stable_step

Floats = NDArray[np.float64]

#: Configurations a side of the grid over both angles at which the small motion is looked at.
SIDE = 24

#: Angle [rad] within which eigenvalues of the same direction are told by their largest alone.
DIRECTION = 0.03

#: Steps up to this many times the scene's limit are let pass: a motion crosses the few configurations that
#: set the limit, and what grows there for a moment dies out again.
CROSSED = 3.0

#: Angle [rad] by which a body may turn in one step.
TURN = 1.0


def configuration_eigenvalues(scene: Scene, force: float) -> NDArray[np.complex128]:
    """Eigenvalues [1/s] of the motion linearized at rest all over the torus, shape (SIDE^2, 4).

    Away from an equilibrium they are what a motion that passes sees for a moment. Where the stiffness pushes
    (eigenvalues with positive real part) there is nothing for a step to keep stable.
    """
    c = reduce(scene)._replace(force=force / (scene.m2 * scene.l))
    angles = np.linspace(-np.pi, np.pi, SIDE, endpoint=False) + np.pi / SIDE
    phi: Any
    theta: Any
    phi, theta = (grid.ravel() for grid in np.meshgrid(angles, angles))
    motions = small_motion(
        phi,
        theta,
        c.mass,
        c.slider,
        c.lift,
        c.spring,
        c.gravity,
        c.force,
        c.damping,
    )
    columns = [np.broadcast_to(value, phi.shape) for value in motions]
    matrices = np.empty((phi.size, 4, 4))
    for matrix, values in zip(matrices, np.stack(columns, axis=1), strict=True):
        fill_state_matrix(SmallMotion(*values), matrix)
    return np.asarray(np.linalg.eigvals(matrices), dtype=np.complex128)


@cache
def step_limit(scene: Scene, method: str) -> float:
    """Largest step [s] that is stable at every configuration of a scene, force at full strength and gone.

    Raises:
        InputError: no such method.
    """
    forces = {scene.F0, 0.0 if scene.alpha > 0.0 else scene.F0}
    values = np.concatenate([configuration_eigenvalues(scene, force).ravel() for force in sorted(forces)])
    # The region is star-shaped enough: of eigenvalues with a common direction the largest sets the limit.
    # Conjugate eigenvalues say the same.
    values = np.where(values.imag < 0.0, values.conj(), values)
    directions = np.round(np.angle(values) / DIRECTION)
    largest = [
        values[directions == d][np.argmax(np.abs(values[directions == d]))] for d in np.unique(directions)
    ]
    return stable_step(find_method(method), np.array(largest))


def step_warning(scene: Scene, dt: float, method: str, starts: ArrayLike | None = None) -> str | None:
    """One line if a step cannot be right for a scene, else ``None``.

    It is too long where a motion that dies out grows instead, where the decaying force's impulse comes out
    wrong, or where a body turns by more than 1 rad in it.

    Args:
        scene: the mechanism.
        dt: step [s].
        method: a name from :data:`fastmech.integrators.methods.METHODS`.
        starts: states phi, theta [rad], phi', theta' [rad/s], shape (n, 4); their rates count if given.

    Raises:
        InputError: no such method.
    """
    formula = find_method(method)
    stable = step_limit(scene, method)
    limits = [(CROSSED * stable, stable, "motions that die out would grow")]
    if scene.alpha > 0.0 and scene.F0 != 0.0:
        ratio = impulse_ratio(formula, dt * scene.alpha)
        reason = f"the decaying force would give {ratio:.3g} times its impulse"
        decay = impulse_limit(formula) / scene.alpha
        limits.append((decay, decay, reason))
    if starts is not None:
        rates = np.abs(np.asarray(starts, dtype=np.float64)[..., 2:])
        fastest = float(np.max(rates[np.isfinite(rates)], initial=0.0))
        if fastest > 0.0:
            limits.append(
                (
                    TURN / fastest,
                    TURN / fastest,
                    f"at {fastest:.3g} rad/s it would turn {dt * fastest:.3g} rad a step",
                )
            )
    limit, good, reason = min(limits)
    if dt <= limit:
        return None
    return f"dt = {dt:g} s: too long for {method} here, {reason}; dt = {_below(good):g} s would do"


def _below(limit: float) -> float:
    """The limit less a tenth, to two digits."""
    return float(f"{0.9 * limit:.1e}")
