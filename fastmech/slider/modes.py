"""Small motions of a scene where it can rest and where it passes: what limits a step by linear theory."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.scene import Scene
from fastmech.slider.coefficients import reduce
from fastmech.slider.lagrange import potential_energy, potential_gradient, potential_hessian
from fastmech.slider.linearize import fill_state_matrix, small_motion

#: Configurations a side of the grid over both angles at which the small motion is looked at.
SIDE = 24

#: Angle [rad] within which eigenvalues of the same direction are told by their largest alone.
DIRECTION = 0.03

#: Newton iterations from the grid to a minimum: a few are enough, flat minima take more.
DESCENTS = 40

#: Scenes whose limits are remembered.
KEPT = 4096


def configuration_eigenvalues(scene: Scene, force: float) -> NDArray[np.complex128]:
    """Eigenvalues [1/s] of the motion linearized at rest all over the torus, shape (SIDE^2, 4).

    Away from an equilibrium they are what a motion that passes sees for a moment. Where the stiffness pushes
    (eigenvalues with positive real part) there is nothing for a step to keep stable.
    """
    return local_eigenvalues(scene, force, *(grid.ravel() for grid in _grid()))


def _grid() -> list[Any]:
    angles = np.linspace(-np.pi, np.pi, SIDE, endpoint=False) + np.pi / SIDE
    return list(np.meshgrid(angles, angles, indexing="ij"))


def local_eigenvalues(scene: Scene, force: float, phi: Any, theta: Any) -> NDArray[np.complex128]:
    """Eigenvalues [1/s] of the motion linearized at rest in configurations (n,), shape (n, 4)."""
    c = reduce(scene)._replace(force=force / (scene.m2 * scene.l))
    matrices = np.empty((4, 4, phi.size))
    fill_state_matrix(small_motion(phi, theta, c), matrices)
    return np.asarray(np.linalg.eigvals(np.moveaxis(matrices, -1, 0)), dtype=np.complex128)


def resting_eigenvalues(scene: Scene, force: float) -> NDArray[np.complex128]:
    """Eigenvalues [1/s] at the minima of the potential energy under a constant force, shape (4 minima,).

    A minimum is looked for from every configuration of the grid that lies lower than its neighbours: quick,
    and enough for a warning; :func:`fastmech.slider.equilibria.find_equilibria` proves that none is missing.
    """
    grid = _grid()
    energy = potential_energy(scene, np.stack(grid, axis=-1), force)
    shifts = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    lowest = energy <= np.min([np.roll(energy, shift, (0, 1)) for shift in shifts], axis=0)
    phi, theta = _descended(scene, force, np.stack([angles[lowest] for angles in grid], axis=-1)).T
    return local_eigenvalues(scene, force, phi, theta).ravel()


def _descended(scene: Scene, force: float, q: Floats) -> Floats:
    """Where configurations ``q`` (n, 2) come to by Newton's method, with curvatures taken as positive.

    It goes down from everywhere (Nocedal, Wright, *Numerical Optimization*, section 3.4), at most a step of
    the grid at a time. (SciPy's minimizer would have to be imported before every first result.)
    """
    for _ in range(DESCENTS):
        curvature, axes = np.linalg.eigh(potential_hessian(scene, q, force))
        least = np.finfo(float).eps * np.abs(curvature).max(axis=-1, keepdims=True) + np.finfo(float).tiny
        slope = np.einsum("nij,ni->nj", axes, potential_gradient(scene, q, force))
        move = -np.einsum("nij,nj->ni", axes, slope / np.maximum(np.abs(curvature), least))
        length = np.abs(move).max(axis=-1, keepdims=True)
        q = q + move * np.minimum(1.0, (2.0 * np.pi / SIDE) / np.maximum(length, np.finfo(float).tiny))
    return q


@lru_cache(KEPT)
def scene_eigenvalues(scene: Scene) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Eigenvalues [1/s] at minima, and of those elsewhere what sets the limit."""
    forces = sorted({scene.F0, 0.0 if scene.alpha > 0.0 else scene.F0})
    resting = np.concatenate([resting_eigenvalues(scene, force) for force in forces])
    values = np.concatenate([configuration_eigenvalues(scene, force).ravel() for force in forces])
    # The region is star-shaped enough: of eigenvalues with a common direction the largest sets the limit.
    # Conjugate eigenvalues say the same.
    values = np.where(values.imag < 0.0, values.conj(), values)
    directions = np.round(np.angle(values) / DIRECTION)
    largest = [
        values[directions == d][np.argmax(np.abs(values[directions == d]))] for d in np.unique(directions)
    ]
    return resting, np.array(largest)
