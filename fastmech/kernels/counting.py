"""Lagrange's equations that count how often they are asked: what an implicit method really costs.

Two parameters follow the eight coefficients: calls of the right-hand side and of the Jacobian, of the block's
first lane.
"""

from __future__ import annotations

from fastmech.jit import JACOBIAN_SIGNATURE, RHS_SIGNATURE, kernel
from fastmech.kernels.blocks import Block
from fastmech.kernels.jacobians import lagrange_jacobian
from fastmech.kernels.select import with_terms

_LAGRANGE = with_terms("lagrange", "damped_decaying")

#: Rows of the parameters that count.
CALLS, JACOBIANS = 8, 9


@kernel(RHS_SIGNATURE)
def counting_lagrange(t: float, Y: Block, dY: Block, p: Block) -> None:
    """As the kernel with damper and decaying force; counts a call."""
    p[CALLS, 0] += 1.0
    _LAGRANGE(t, Y, dY, p)


@kernel(JACOBIAN_SIGNATURE)
def counting_jacobian(t: float, Y: Block, J: Block, p: Block) -> None:
    """As :func:`fastmech.kernels.jacobians.lagrange_jacobian`; counts a call."""
    p[JACOBIANS, 0] += 1.0
    lagrange_jacobian(t, Y, J, p)
