"""Lagrange's equations that keep account: of the work of damper and force, or of how often they are asked.

The one that counts has a parameter after the eight coefficients: its calls, of the block's first lane.
"""

from __future__ import annotations

from fastmech.jit import RHS_SIGNATURE, kernel
from fastmech.kernels.blocks import Block
from fastmech.kernels.sincos import sincos
from fastmech.slider.kernels.select import DAMPING, DECAY, FORCE, force_now, with_terms
from fastmech.slider.reduced import slider_ratio

_LAGRANGE = with_terms("lagrange", "damped_decaying")


@kernel(RHS_SIGNATURE)
def lagrange_work(t: float, Y: Block, dY: Block, p: Block) -> None:
    """State (phi, theta, phi', theta', W_damper, W_force), works over m2 l^2; damper and decaying force."""
    _LAGRANGE(t, Y, dY, p)
    for i in range(Y.shape[1]):
        s1, c1 = sincos(Y[0, i])
        _, c2 = sincos(Y[1, i])
        k, _ = slider_ratio(s1, c1)
        force = force_now(t, p[FORCE, i], p[DECAY, i])
        dY[4, i] = -p[DAMPING, i] * (k * Y[2, i]) * (k * Y[2, i])
        dY[5, i] = -force * (s1 * Y[2, i] + c2 * Y[3, i])


#: Row of the parameters that counts.
CALLS = 8


@kernel(RHS_SIGNATURE)
def counting_lagrange(t: float, Y: Block, dY: Block, p: Block) -> None:
    """As the kernel with damper and decaying force; counts a call."""
    p[CALLS, 0] += 1.0
    _LAGRANGE(t, Y, dY, p)
