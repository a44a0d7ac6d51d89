"""The lane loop of the equations of motion: branch-free, over contiguous rows of a small block.

``lagrange_block`` and ``canonical_block`` are what every block right-hand side of the mechanism calls with
the terms it has. Every lane has its own parameters, rows of ``mechanism.coefficients.Coefficients``: loading
them costs nothing beside the arithmetic. Lanes whose angles exceed the range of the fast trigonometry are
done again, one by one, with the library's functions: a lane's result never depends on its neighbours.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.jit import inlined
from fastmech.kernels.bits import NO_LANE, noted
from fastmech.kernels.sincos import reduction_limit, sincos
from fastmech.mechanism.equations import canonical_rates, lagrange_accelerations

Block = NDArray[np.float64]

#: Widths of blocks are multiples of this: whole vectors of any processor, in either precision.
VECTOR_LANES = 16

#: Rows of the parameters that belong to terms which a scene may lack.
FORCE, DAMPING, DECAY = 5, 6, 7


@inlined
def is_beyond(Y: Block, i: int) -> bool:
    """Whether a lane's angles exceed the range of the fast trigonometry; false for NaN."""
    limit = reduction_limit(Y[0, i])
    return (abs(Y[0, i]) > limit) | (abs(Y[1, i]) > limit)


@inlined
def lane_damping(p: Block, i: int, damping: int | None) -> Any:
    """A lane's damping, ``None`` in a kernel without damper."""
    if damping is None:
        return None
    return p[damping, i]


@inlined
def lane_force(p: Block, i: int, force: int | None, decay: int | None, decayed: Block) -> Any:
    """A lane's reduced force now, ``None`` in a kernel without force; ``decayed`` holds exp(-alpha t)."""
    if force is None:
        return None
    if decay is None:
        return p[force, i]
    return p[force, i] * decayed[0, i]


@inlined
def write_decay(t: float, p: Block, decay: int | None, decayed: Block) -> None:
    """Write exp(-alpha t) of every lane into the first row of ``decayed``: one call where all agree."""
    if decay is not None:
        differs = 0
        for i in range(p.shape[1]):
            differs |= p[decay, i] != p[decay, 0]
        if differs:
            for i in range(p.shape[1]):
                decayed[0, i] = math.exp(-p[decay, i] * t)
        else:
            decayed[0] = math.exp(-p[decay, 0] * t)


@inlined
def lagrange_block(
    t: float, Y: Block, dY: Block, p: Block, force: int | None, damping: int | None, decay: int | None
) -> None:
    """Derivatives of lanes ``Y`` = (phi, theta, phi', theta') into ``dY``; both (4, lanes), ``p`` (8, lanes).

    ``force``, ``damping`` and ``decay`` are the rows of these parameters; ``None`` leaves the term out of the
    compiled code. The first row of ``dY`` serves as scratch for the force's decay.
    """
    write_decay(t, p, decay, dY)
    beyond = NO_LANE
    for i in range(Y.shape[1]):
        s1, c1 = sincos(Y[0, i])
        s2, c2 = sincos(Y[1, i])
        phi_dot, theta_dot = Y[2, i], Y[3, i]
        push, damp = lane_force(p, i, force, decay, dY), lane_damping(p, i, damping)
        beyond = noted(beyond, is_beyond(Y, i))
        dY[0, i] = phi_dot
        dY[1, i] = theta_dot
        dY[2, i], dY[3, i] = lagrange_accelerations(
            s1, c1, s2, c2, phi_dot, theta_dot, p[0, i], p[1, i], p[2, i], p[3, i], p[4, i], push, damp
        )
    if beyond:
        for i in range(Y.shape[1]):
            if is_beyond(Y, i):
                s1, c1, s2, c2 = np.sin(Y[0, i]), np.cos(Y[0, i]), np.sin(Y[1, i]), np.cos(Y[1, i])
                write_decay(t, p[:, i : i + 1], decay, dY[:, i : i + 1])
                push, damp = lane_force(p, i, force, decay, dY), lane_damping(p, i, damping)
                dY[0, i] = Y[2, i]
                dY[2, i], dY[3, i] = lagrange_accelerations(
                    s1, c1, s2, c2, Y[2, i], Y[3, i], p[0, i], p[1, i], p[2, i], p[3, i], p[4, i], push, damp
                )


@inlined
def canonical_block(
    t: float, Y: Block, dY: Block, p: Block, force: int | None, damping: int | None, decay: int | None
) -> None:
    """Derivatives of lanes ``Y`` = (phi, theta, p_phi, p_theta), momenta over m2 l^2, into ``dY``.

    Arguments as those of ``lagrange_block``.
    """
    write_decay(t, p, decay, dY)
    beyond = NO_LANE
    for i in range(Y.shape[1]):
        s1, c1 = sincos(Y[0, i])
        s2, c2 = sincos(Y[1, i])
        push, damp = lane_force(p, i, force, decay, dY), lane_damping(p, i, damping)
        beyond = noted(beyond, is_beyond(Y, i))
        dY[0, i], dY[1, i], dY[2, i], dY[3, i] = canonical_rates(
            s1, c1, s2, c2, Y[2, i], Y[3, i], p[0, i], p[1, i], p[2, i], p[3, i], p[4, i], push, damp
        )
    if beyond:
        for i in range(Y.shape[1]):
            if is_beyond(Y, i):
                s1, c1, s2, c2 = np.sin(Y[0, i]), np.cos(Y[0, i]), np.sin(Y[1, i]), np.cos(Y[1, i])
                write_decay(t, p[:, i : i + 1], decay, dY[:, i : i + 1])
                push, damp = lane_force(p, i, force, decay, dY), lane_damping(p, i, damping)
                dY[0, i], dY[1, i], dY[2, i], dY[3, i] = canonical_rates(
                    s1, c1, s2, c2, Y[2, i], Y[3, i], p[0, i], p[1, i], p[2, i], p[3, i], p[4, i], push, damp
                )
