"""Block right-hand sides of the canonical equations (14), one for every combination of terms.

State (phi, theta, p_phi, p_theta), momenta over m2 l^2; ``p`` are the lanes' reduced coefficients (8, lanes).
"""

from __future__ import annotations

from fastmech.jit import RHS_SIGNATURE, kernel
from fastmech.kernels.blocks import DAMPING, DECAY, FORCE, Block, canonical_block


@kernel(RHS_SIGNATURE)
def canonical_free(t: float, Y: Block, dY: Block, p: Block) -> None:
    """No damper, no force."""
    canonical_block(t, Y, dY, p, None, None, None)


@kernel(RHS_SIGNATURE)
def canonical_damped(t: float, Y: Block, dY: Block, p: Block) -> None:
    """Damper, no force."""
    canonical_block(t, Y, dY, p, None, DAMPING, None)


@kernel(RHS_SIGNATURE)
def canonical_constant(t: float, Y: Block, dY: Block, p: Block) -> None:
    """No damper, constant force."""
    canonical_block(t, Y, dY, p, FORCE, None, None)


@kernel(RHS_SIGNATURE)
def canonical_damped_constant(t: float, Y: Block, dY: Block, p: Block) -> None:
    """Damper, constant force."""
    canonical_block(t, Y, dY, p, FORCE, DAMPING, None)


@kernel(RHS_SIGNATURE)
def canonical_decaying(t: float, Y: Block, dY: Block, p: Block) -> None:
    """No damper, decaying force."""
    canonical_block(t, Y, dY, p, FORCE, None, DECAY)


@kernel(RHS_SIGNATURE)
def canonical_damped_decaying(t: float, Y: Block, dY: Block, p: Block) -> None:
    """Damper, decaying force."""
    canonical_block(t, Y, dY, p, FORCE, DAMPING, DECAY)
