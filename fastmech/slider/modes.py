"""Small motions of a scene all over the torus: what a motion that passes sees for a moment."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastmech.scene import Scene
from fastmech.slider.coefficients import reduce
from fastmech.slider.linearize import fill_state_matrix, small_motion

#: Configurations a side of the grid over both angles at which the small motion is looked at.
SIDE = 24

#: Angle [rad] within which eigenvalues of the same direction are told by their largest alone.
DIRECTION = 0.03


def under_its_forces(scene: Scene) -> list[Scene]:
    """The scene with its force at full strength, and with what the force comes to."""
    forces = {scene.F0, scene.F0 if scene.alpha == 0.0 else 0.0}
    return [scene.replace(F0=force, alpha=0.0) for force in sorted(forces)]


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
    largest = [
        values[directions == d][np.argmax(np.abs(values[directions == d]))] for d in np.unique(directions)
    ]
    return np.array(largest)
