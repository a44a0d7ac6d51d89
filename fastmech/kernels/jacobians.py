"""Block Jacobians of both formulations, one kernel each: an implicit method reads one in several evaluations.

Terms that a scene lacks are zeros here. Rows ``r * 4 + c`` of ``J`` (16, lanes) hold d(y_r')/d(y_c).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fastmech.jit import JACOBIAN_SIGNATURE, inlined, kernel
from fastmech.kernels.blocks import Block
from fastmech.kernels.select import DAMPING, DECAY, FORCE, force_now
from fastmech.kernels.sincos import REDUCTION_LIMIT, sincos
from fastmech.mechanism.tangent import canonical_tangent, lagrange_tangent


@inlined
def _is_beyond(Y: Block, i: int) -> bool:
    """Whether a lane's angles exceed the range of the fast trigonometry; false for NaN."""
    return (abs(Y[0, i]) > REDUCTION_LIMIT) | (abs(Y[1, i]) > REDUCTION_LIMIT)


@inlined
def _lagrange_lane(t: float, trig: Any, Y: Block, J: Block, p: Block, i: int) -> None:
    """All rows of one lane; ``trig`` are sine and cosine of phi, then of theta."""
    s1, c1, s2, c2 = trig
    (J[8, i], J[12, i]), (J[9, i], J[13, i]), (J[10, i], J[14, i]), (J[11, i], J[15, i]) = lagrange_tangent(
        s1, c1, s2, c2, Y[2, i], Y[3, i], p[0, i], p[1, i], p[2, i], p[3, i], p[4, i],
        force_now(t, p[FORCE, i], p[DECAY, i]), p[DAMPING, i],
    )  # fmt: skip
    for row in range(8):
        J[row, i] = 1.0 if row in (2, 7) else 0.0


@inlined
def _canonical_lane(t: float, trig: Any, Y: Block, J: Block, p: Block, i: int) -> None:
    """All rows of one lane."""
    s1, c1, s2, c2 = trig
    (
        (J[0, i], J[4, i]), (J[1, i], J[5, i]), (J[2, i], J[6, i]), (J[3, i], J[7, i]),
        (J[8, i], J[12, i]), (J[9, i], J[13, i]), (J[10, i], J[14, i]), (J[11, i], J[15, i]),
    ) = canonical_tangent(
        s1, c1, s2, c2, Y[2, i], Y[3, i], p[0, i], p[1, i], p[2, i], p[3, i], p[4, i],
        force_now(t, p[FORCE, i], p[DECAY, i]), p[DAMPING, i],
    )  # fmt: skip


@kernel(JACOBIAN_SIGNATURE)
def lagrange_jacobian(t: float, Y: Block, J: Block, p: Block) -> None:
    """State (phi, theta, phi', theta'); ``Y`` (4, lanes), ``p`` (8, lanes)."""
    beyond = 0
    for i in range(Y.shape[1]):
        s1, c1 = sincos(Y[0, i])
        s2, c2 = sincos(Y[1, i])
        beyond |= _is_beyond(Y, i)
        _lagrange_lane(t, (s1, c1, s2, c2), Y, J, p, i)
    if beyond:
        for i in range(Y.shape[1]):
            if _is_beyond(Y, i):
                trig = np.sin(Y[0, i]), np.cos(Y[0, i]), np.sin(Y[1, i]), np.cos(Y[1, i])
                _lagrange_lane(t, trig, Y, J, p, i)


@kernel(JACOBIAN_SIGNATURE)
def canonical_jacobian(t: float, Y: Block, J: Block, p: Block) -> None:
    """State (phi, theta, p_phi, p_theta), momenta over m2 l^2; ``Y`` (4, lanes), ``p`` (8, lanes)."""
    beyond = 0
    for i in range(Y.shape[1]):
        s1, c1 = sincos(Y[0, i])
        s2, c2 = sincos(Y[1, i])
        beyond |= _is_beyond(Y, i)
        _canonical_lane(t, (s1, c1, s2, c2), Y, J, p, i)
    if beyond:
        for i in range(Y.shape[1]):
            if _is_beyond(Y, i):
                trig = np.sin(Y[0, i]), np.cos(Y[0, i]), np.sin(Y[1, i]), np.cos(Y[1, i])
                _canonical_lane(t, trig, Y, J, p, i)
