"""Block right-hand sides of Lagrange's equations (13), one for every combination of terms.

State (phi, theta, phi', theta'); ``p`` are the reduced coefficients. A scene is given the kernel of the terms
that it has, see :func:`fastmech.kernels.select.right_hand_side`.
"""

from __future__ import annotations

from fastmech.jit import RHS_SIGNATURE, kernel
from fastmech.kernels.blocks import Block, decayed, lagrange_block


@kernel(RHS_SIGNATURE)
def lagrange_free(t: float, Y: Block, dY: Block, p: Block) -> None:
    """No damper, no force."""
    lagrange_block(Y, dY, p, None, None)


@kernel(RHS_SIGNATURE)
def lagrange_damped(t: float, Y: Block, dY: Block, p: Block) -> None:
    """Damper, no force."""
    lagrange_block(Y, dY, p, None, p[6])


@kernel(RHS_SIGNATURE)
def lagrange_constant(t: float, Y: Block, dY: Block, p: Block) -> None:
    """No damper, constant force."""
    lagrange_block(Y, dY, p, p[5], None)


@kernel(RHS_SIGNATURE)
def lagrange_damped_constant(t: float, Y: Block, dY: Block, p: Block) -> None:
    """Damper, constant force."""
    lagrange_block(Y, dY, p, p[5], p[6])


@kernel(RHS_SIGNATURE)
def lagrange_decaying(t: float, Y: Block, dY: Block, p: Block) -> None:
    """No damper, decaying force."""
    lagrange_block(Y, dY, p, decayed(p, t), None)


@kernel(RHS_SIGNATURE)
def lagrange_damped_decaying(t: float, Y: Block, dY: Block, p: Block) -> None:
    """Damper, decaying force."""
    lagrange_block(Y, dY, p, decayed(p, t), p[6])
