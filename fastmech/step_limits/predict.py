"""The largest stable step at an equilibrium, predicted from the eigenvalues of the small motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.arrays import Flags, Floats
from fastmech.integrators.methods import ImplicitRungeKutta, Method, find_method
from fastmech.models.equilibria import RestingPlace
from fastmech.models.mechanism import Mechanism
from fastmech.models.stability import state_matrix
from fastmech.scene import Scene
from fastmech.slider.linearize import Rest
from fastmech.step_limits.amplification import amplifies, first_crossing

#: Error of a mode's growth, a radian, that is let pass. A mode without damping sits on the edge of every
#: region of stability; one that decays by less than this a radian is as good as undamped.
GROWTH_PER_RADIAN = 1e-6

#: Real part, relative to the eigenvalue, that rounding explains.
UNDAMPED = 1e-12

#: Product of step and largest eigenvalue at which the search begins and ends.
NEAREST, FARTHEST = 1e-3, 1e6

#: Shares of a step at which it is tried: regions may have holes.
SHORTER = 0.8 ** np.arange(8.0)


def stable_step(method: Method, eigenvalues: ArrayLike, growth: float = 0.0) -> float:
    """Largest step [s] up to which no decaying mode grows by more than ``growth``; inf if A-stable.

    Growing modes set no limit. A mode that decays by less than :data:`GROWTH_PER_RADIAN` a radian may miss
    its decay by that much, as one without damping may.
    """
    values, slack = _decaying(eigenvalues)
    if not values.size or isinstance(method, ImplicitRungeKutta):
        return np.inf
    fastest = float(np.abs(values).max())

    def grow(h: Floats) -> Flags:
        factor = 1.0 + growth + h[:, None] * slack
        return np.asarray(amplifies(method, h[:, None] * values, factor).any(axis=1))

    return first_crossing(grow, NEAREST / fastest, FARTHEST / fastest)


def is_stable(method: Method, eigenvalues: ArrayLike, h: float, growth: float = 0.0) -> bool:
    """Whether no decaying mode grows with a step h [s], nor with some shorter ones: quicker to tell."""
    values, slack = _decaying(eigenvalues)
    if not values.size or isinstance(method, ImplicitRungeKutta):
        return True
    steps = h * SHORTER[:, None]
    return not amplifies(method, steps * values, 1.0 + growth + steps * slack).any()


def _decaying(eigenvalues: ArrayLike) -> tuple[NDArray[np.complex128], Floats]:
    """Eigenvalues of the modes that do not grow, and the growth [1/s] that each may have.

    Conjugate ones say the same: one of them stands for both.
    """
    values = np.asarray(eigenvalues, dtype=np.complex128)
    decays = (values.real <= UNDAMPED * np.abs(values)) & (values != 0.0)
    values = values[decays]
    values = np.unique(np.minimum(values.real, 0.0) + 1j * np.abs(values.imag))
    return values, np.maximum(values.real + GROWTH_PER_RADIAN * np.abs(values), 0.0)


def largest_stable_step(scene: Scene | Mechanism, equilibrium: Rest | RestingPlace, method: str) -> float:
    """Largest step [s] at which small motions about a stable equilibrium die out as they should.

    Args:
        scene: the mechanism; a scene's force is the equilibrium's, frozen, other loads are at their means.
        equilibrium: one of :func:`fastmech.find_equilibria`. Where it is unstable, the modes that decay set
            the limit.
        method: a name from :data:`fastmech.integrators.methods.METHODS`.

    Returns:
        inf for an A-stable method.

    Raises:
        InputError: an argument is wrong.
    """
    return stable_step(find_method(method), np.linalg.eigvals(state_matrix(scene, equilibrium)))
