"""Hamilton's description in SI units: momenta and Hamiltonian, paper (15)-(16).

Angles ``q`` and momenta ``p`` have shape (..., 2); momenta are in kg m2/s.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.mechanism.lagrange import metric, potential_energy
from fastmech.scene import Scene

Array = NDArray[np.float64]


def momenta(scene: Scene, y: ArrayLike) -> Array:
    """Generalized momenta p = dT/dq' of states ``y`` (..., 4)."""
    y = np.asarray(y, dtype=np.float64)
    return np.asarray(np.einsum("...ij,...j->...i", metric(scene, y[..., :2]), y[..., 2:]))


def rates(scene: Scene, q: ArrayLike, p: ArrayLike) -> Array:
    """(phi', theta') [rad/s] of angles and momenta: q' = a^-1 p."""
    p = np.asarray(p, dtype=np.float64)
    return np.asarray(np.linalg.solve(metric(scene, q), p[..., None])[..., 0])


def hamiltonian(scene: Scene, q: ArrayLike, p: ArrayLike) -> Array:
    """H = a^(alpha beta) p_alpha p_beta / 2 + Pi [J], paper (15)."""
    p = np.asarray(p, dtype=np.float64)
    return np.asarray(0.5 * np.einsum("...i,...i", p, rates(scene, q, p)) + potential_energy(scene, q))
