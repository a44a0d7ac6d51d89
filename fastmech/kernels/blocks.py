"""The lane loop of the equations of motion: branch-free, over contiguous rows of a small block.

``lagrange_block`` and ``canonical_block`` are what every block right-hand side of the mechanism calls with
the terms it has. Lanes whose angles exceed the range of the fast trigonometry are done again, one by one,
with the library's functions: a lane's result never depends on its neighbours.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fastmech.jit import inlined
from fastmech.kernels.sincos import REDUCTION_LIMIT, sincos
from fastmech.mechanism.equations import canonical_rates, lagrange_accelerations

Block = NDArray[np.float64]


@inlined
def lagrange_block(Y: Block, dY: Block, p: Block, force: float | None, damping: float | None) -> None:
    """Derivatives of lanes ``Y`` = (phi, theta, phi', theta') into ``dY``; both (4, lanes).

    ``p`` are the reduced coefficients, ``force`` the reduced force now; ``None`` leaves a term out.
    """
    mass, slider, lift, spring, gravity = p[0], p[1], p[2], p[3], p[4]
    beyond = 0
    for i in range(Y.shape[1]):
        phi, theta, phi_dot, theta_dot = Y[0, i], Y[1, i], Y[2, i], Y[3, i]
        s1, c1 = sincos(phi)
        s2, c2 = sincos(theta)
        dY[0, i] = phi_dot
        dY[1, i] = theta_dot
        dY[2, i], dY[3, i] = lagrange_accelerations(
            s1, c1, s2, c2, phi_dot, theta_dot, mass, slider, lift, spring, gravity, force, damping
        )
        beyond |= (abs(phi) > REDUCTION_LIMIT) | (abs(theta) > REDUCTION_LIMIT)
    if beyond:
        for i in range(Y.shape[1]):
            phi, theta = Y[0, i], Y[1, i]
            if abs(phi) > REDUCTION_LIMIT or abs(theta) > REDUCTION_LIMIT:
                s1, c1, s2, c2 = math.sin(phi), math.cos(phi), math.sin(theta), math.cos(theta)
                dY[2, i], dY[3, i] = lagrange_accelerations(
                    s1, c1, s2, c2, Y[2, i], Y[3, i], mass, slider, lift, spring, gravity, force, damping
                )


@inlined
def canonical_block(Y: Block, dY: Block, p: Block, force: float | None, damping: float | None) -> None:
    """Derivatives of lanes ``Y`` = (phi, theta, p_phi, p_theta), momenta over m2 l^2, into ``dY``."""
    mass, slider, lift, spring, gravity = p[0], p[1], p[2], p[3], p[4]
    beyond = 0
    for i in range(Y.shape[1]):
        phi, theta = Y[0, i], Y[1, i]
        s1, c1 = sincos(phi)
        s2, c2 = sincos(theta)
        dY[0, i], dY[1, i], dY[2, i], dY[3, i] = canonical_rates(
            s1, c1, s2, c2, Y[2, i], Y[3, i], mass, slider, lift, spring, gravity, force, damping
        )
        beyond |= (abs(phi) > REDUCTION_LIMIT) | (abs(theta) > REDUCTION_LIMIT)
    if beyond:
        for i in range(Y.shape[1]):
            phi, theta = Y[0, i], Y[1, i]
            if abs(phi) > REDUCTION_LIMIT or abs(theta) > REDUCTION_LIMIT:
                s1, c1, s2, c2 = math.sin(phi), math.cos(phi), math.sin(theta), math.cos(theta)
                dY[0, i], dY[1, i], dY[2, i], dY[3, i] = canonical_rates(
                    s1, c1, s2, c2, Y[2, i], Y[3, i], mass, slider, lift, spring, gravity, force, damping
                )


@inlined
def decayed(p: Block, t: float) -> float:
    """Reduced force at time ``t``: once for a whole block."""
    return float(p[5] * math.exp(-p[7] * t))
