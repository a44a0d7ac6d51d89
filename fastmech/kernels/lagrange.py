"""Block right-hand sides of Lagrange's equations (13), one for every combination of terms.

State (phi, theta, phi', theta'); ``p`` are the lanes' reduced coefficients (8, lanes). A scene is given the
kernel of the terms that it has, see :func:`fastmech.kernels.select.right_hand_side`.
"""

from __future__ import annotations

from fastmech.jit import RHS_SIGNATURE, kernel
from fastmech.kernels.blocks import DAMPING, DECAY, FORCE, Block, lagrange_block


@kernel(RHS_SIGNATURE)
def lagrange_free(t: float, Y: Block, dY: Block, p: Block) -> None:
    """No damper, no force."""
    lagrange_block(t, Y, dY, p, None, None, None)


@kernel(RHS_SIGNATURE)
def lagrange_damped(t: float, Y: Block, dY: Block, p: Block) -> None:
    """Damper, no force."""
    lagrange_block(t, Y, dY, p, None, DAMPING, None)


@kernel(RHS_SIGNATURE)
def lagrange_constant(t: float, Y: Block, dY: Block, p: Block) -> None:
    """No damper, constant force."""
    lagrange_block(t, Y, dY, p, FORCE, None, None)


@kernel(RHS_SIGNATURE)
def lagrange_damped_constant(t: float, Y: Block, dY: Block, p: Block) -> None:
    """Damper, constant force."""
    lagrange_block(t, Y, dY, p, FORCE, DAMPING, None)


@kernel(RHS_SIGNATURE)
def lagrange_decaying(t: float, Y: Block, dY: Block, p: Block) -> None:
    """No damper, decaying force."""
    lagrange_block(t, Y, dY, p, FORCE, None, DECAY)


@kernel(RHS_SIGNATURE)
def lagrange_damped_decaying(t: float, Y: Block, dY: Block, p: Block) -> None:
    """Damper, decaying force."""
    lagrange_block(t, Y, dY, p, FORCE, DAMPING, DECAY)
