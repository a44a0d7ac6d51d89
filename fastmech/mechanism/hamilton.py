"""Hamilton's description in SI units: momenta, Hamiltonian and canonical equations, paper (14)-(16).

Angles ``q`` and momenta ``p`` have shape (..., 2); momenta are in kg m2/s.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.mechanism.coefficients import force, reduce
from fastmech.mechanism.equations import canonical_rates
from fastmech.mechanism.lagrange import metric, potential_energy, unit
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


def canonical_equations(scene: Scene, q: ArrayLike, p: ArrayLike, t: ArrayLike) -> Array:
    """(phi', theta', p_phi', p_theta'), paper (14) with dH/dq where it prints dH/dp twice; shape (..., 4)."""
    q = np.asarray(q, dtype=np.float64)
    p = np.asarray(p, dtype=np.float64) / unit(scene)
    c = reduce(scene)
    now = force(scene, t) / (scene.m2 * scene.l)
    s1, c1, s2, c2 = np.sin(q[..., 0]), np.cos(q[..., 0]), np.sin(q[..., 1]), np.cos(q[..., 1])
    derivatives = canonical_rates(
        s1, c1, s2, c2, p[..., 0], p[..., 1], c.mass, c.slider, c.lift, c.spring, c.gravity, now, c.damping
    )
    scale = np.array([1.0, 1.0, unit(scene), unit(scene)])
    return np.stack(np.broadcast_arrays(*derivatives), axis=-1) * scale
