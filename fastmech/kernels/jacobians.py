"""Block Jacobians of both formulations, one kernel each: an implicit method reads one in several evaluations.

Terms that a scene lacks are zeros here. Rows ``r * 4 + c`` of ``J`` (16, lanes) hold d(y_r')/d(y_c).
"""

from __future__ import annotations

import numpy as np

from fastmech.jit import JACOBIAN_SIGNATURE, inlined, kernel
from fastmech.kernels.blocks import DAMPING, DECAY, FORCE, Block, is_beyond, write_decay
from fastmech.kernels.sincos import sincos
from fastmech.mechanism.tangent import canonical_tangent, lagrange_tangent


@inlined
def _lagrange_lane(s1: float, c1: float, s2: float, c2: float, Y: Block, J: Block, p: Block, i: int) -> None:
    """Rows 8 to 15 of one lane; row 0 holds the force's decay."""
    (J[8, i], J[12, i]), (J[9, i], J[13, i]), (J[10, i], J[14, i]), (J[11, i], J[15, i]) = lagrange_tangent(
        s1,
        c1,
        s2,
        c2,
        Y[2, i],
        Y[3, i],
        p[0, i],
        p[1, i],
        p[2, i],
        p[3, i],
        p[4, i],
        p[FORCE, i] * J[0, i],
        p[DAMPING, i],
    )


@kernel(JACOBIAN_SIGNATURE)
def lagrange_jacobian(t: float, Y: Block, J: Block, p: Block) -> None:
    """State (phi, theta, phi', theta'); ``Y`` (4, lanes), ``p`` (8, lanes)."""
    write_decay(t, p, DECAY, J)
    beyond = 0
    for i in range(Y.shape[1]):
        s1, c1 = sincos(Y[0, i])
        s2, c2 = sincos(Y[1, i])
        beyond |= is_beyond(Y, i)
        _lagrange_lane(s1, c1, s2, c2, Y, J, p, i)
    if beyond:
        for i in range(Y.shape[1]):
            if is_beyond(Y, i):
                s1, c1, s2, c2 = np.sin(Y[0, i]), np.cos(Y[0, i]), np.sin(Y[1, i]), np.cos(Y[1, i])
                _lagrange_lane(s1, c1, s2, c2, Y, J, p, i)
    J[:8] = 0.0
    J[2] = 1.0
    J[7] = 1.0


@inlined
def _canonical_lane(
    s1: float, c1: float, s2: float, c2: float, decayed: float, Y: Block, J: Block, p: Block, i: int
) -> None:
    """All rows of one lane."""
    (
        (J[0, i], J[4, i]),
        (J[1, i], J[5, i]),
        (J[2, i], J[6, i]),
        (J[3, i], J[7, i]),
        (J[8, i], J[12, i]),
        (J[9, i], J[13, i]),
        (J[10, i], J[14, i]),
        (J[11, i], J[15, i]),
    ) = canonical_tangent(
        s1,
        c1,
        s2,
        c2,
        Y[2, i],
        Y[3, i],
        p[0, i],
        p[1, i],
        p[2, i],
        p[3, i],
        p[4, i],
        p[FORCE, i] * decayed,
        p[DAMPING, i],
    )


@kernel(JACOBIAN_SIGNATURE)
def canonical_jacobian(t: float, Y: Block, J: Block, p: Block) -> None:
    """State (phi, theta, p_phi, p_theta), momenta over m2 l^2; ``Y`` (4, lanes), ``p`` (8, lanes)."""
    write_decay(t, p, DECAY, J)
    beyond = 0
    for i in range(Y.shape[1]):
        s1, c1 = sincos(Y[0, i])
        s2, c2 = sincos(Y[1, i])
        beyond |= is_beyond(Y, i)
        _canonical_lane(s1, c1, s2, c2, J[0, i], Y, J, p, i)
    if beyond:
        for i in range(Y.shape[1]):
            if is_beyond(Y, i):
                s1, c1, s2, c2 = np.sin(Y[0, i]), np.cos(Y[0, i]), np.sin(Y[1, i]), np.cos(Y[1, i])
                write_decay(t, p[:, i : i + 1], DECAY, J[:, i : i + 1])
                _canonical_lane(s1, c1, s2, c2, J[0, i], Y, J, p, i)
