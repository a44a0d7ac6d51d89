"""The metric in which balls and shocks are measured: a matrix that turns departures into lengths.

Angles [rad] and rates [rad/s] have no common length by themselves. For the mechanism it is given by the
kinetic-energy norm at the equilibrium (:class:`fastmech.disturbance.motion.Size`); for a system of your own
it is a matrix that you state, the identity if all its states have one unit.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Floats
from fastmech.disturbance.motion import size_of
from fastmech.ensembles import checks
from fastmech.errors import InputError, shown, shown_name
from fastmech.models.equilibria import RestingPlace
from fastmech.models.mechanism import Mechanism
from fastmech.models.stability import require_own
from fastmech.scene import STATE, Scene, nearest
from fastmech.slider.equilibria import Equilibrium, held
from fastmech.slider.linearize import require_rest


def check_angles(field: str, name: str, values: ArrayLike, angles: Sequence[str] = STATE[:2]) -> None:
    """Refuse angles that must be degrees, beyond ``FEW_TURNS`` turns, of a state among ``angles``."""
    largest = float(np.abs(values).max())
    if name in angles and largest > 2.0 * np.pi * checks.FEW_TURNS:
        raise InputError(f"{field}: {checks.beyond_turns(largest)}")


def state_index(name: str, names: Sequence[str] = STATE) -> int:
    """Which of the states an axis of this name is."""
    if name not in names:
        raise InputError(f"axes.{shown_name(name)}: unknown name; {nearest(name, list(names))}")
    return names.index(name)


def kinetic_norm(scene: Scene | Mechanism, equilibrium: Equilibrium | RestingPlace) -> Floats:
    """Matrix N (states, states) of the kinetic-energy norm: ``|departure @ N|`` is a size [rad].

    ``size^2 = (xi' a xi + eta' a eta / omega^2) / (m2 l^2)`` for departures xi [rad] and eta [rad/s], with
    the metric ``a`` at the equilibrium, paper (11), and the highest natural frequency omega [rad/s]. The
    kinetic energy of a kick is ``size^2 omega^2 m2 l^2 / 2``. The force is the equilibrium's frozen one.

    Raises:
        InputError: an argument is wrong, or the scene does not rest there.
    """
    if isinstance(scene, Mechanism):
        require_own(scene, equilibrium)
        return size_of(scene, equilibrium).to_ball
    require_rest(scene, equilibrium)
    assert isinstance(equilibrium, Equilibrium)
    return size_of(held(scene, equilibrium), equilibrium).to_ball


def norm_on(norm: ArrayLike, dim: int, coordinates: Sequence[int] | None = None) -> Floats:
    """Lower triangular matrix L (k, k) of a norm on k of ``dim`` coordinates, the others not departed.

    ``|d @ L|`` is the length of a departure d (k,) along ``coordinates`` (all by default).

    Args:
        norm: matrix (dim, dim), not singular.
        dim: number of states.
        coordinates: indices of states.

    Raises:
        InputError: the norm is no such matrix, or the coordinates are not different indices of states.
    """
    matrix = checks.states("norm", norm, dim)
    if matrix.shape != (dim, dim) or not np.isfinite(matrix).all():
        raise InputError(f"norm: has shape {matrix.shape}, must be a finite matrix ({dim}, {dim})")
    if coordinates is not None:
        if not isinstance(coordinates, Sequence | np.ndarray):
            raise InputError(f"coordinates = {shown(coordinates)}: must be indices of states")
        chosen = [checks.whole_number("coordinates", k, least=0, most=dim - 1) for k in coordinates]
        if not chosen or len(set(chosen)) != len(chosen):
            raise InputError(f"coordinates = {list(coordinates)}: must be different indices, at least one")
        matrix = matrix[chosen]
    if np.linalg.matrix_rank(matrix) < len(matrix):
        raise InputError("norm: is singular; every departure needs a length greater than 0")
    return np.asarray(np.linalg.cholesky(matrix @ matrix.T))
