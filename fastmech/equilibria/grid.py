"""A grid of starts and Newton's method with a line search: the search that assumes nothing of the scene."""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.equilibria.balance import EPS, wrap
from fastmech.jit import MATRIX, VECTOR, inlined, kernel
from fastmech.mechanism.reduced import potential_gradient, potential_hessian

Floats = NDArray[np.float64]

#: Starts along each angle. The proof does not rest on it: what a grid misses is found to be missing.
STARTS = 16

#: Two results nearer than this [rad] are one equilibrium.
MERGE = 1e-6

_MOST_STEPS = 60
_ARMIJO = 1e-4


@inlined
def newton_with_line_search(
    lift: float, spring: float, gravity: float, force: float, phi: float, theta: float
) -> tuple[float, float, bool]:
    """Root of the reduced gradient from one start, and whether it was reached.

    The merit is half the gradient's square. A Newton step is halved until it satisfies Armijo's condition;
    where the Hessian is singular or its step does not descend, the merit's own gradient is followed
    (Nocedal, Wright, *Numerical Optimization*, section 11.2).
    """
    scale = max(abs(lift), abs(spring), abs(gravity), abs(force))
    for _ in range(_MOST_STEPS):
        s1, c1, s2, c2 = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
        g1, g2 = potential_gradient(s1, c1, s2, c2, c1 * c2 - s1 * s2, lift, spring, gravity, force)
        if abs(g1) + abs(g2) <= 8.0 * EPS * scale:
            return wrap(phi), wrap(theta), True
        h11, h12, h22 = potential_hessian(s1, c1, s2, c2, s1 * c2 + c1 * s2, lift, spring, gravity, force)
        merit = 0.5 * (g1 * g1 + g2 * g2)
        down1, down2 = h11 * g1 + h12 * g2, h12 * g1 + h22 * g2
        determinant = h11 * h22 - h12 * h12
        if abs(determinant) > EPS * scale * scale:
            step1, step2 = -(h22 * g1 - h12 * g2) / determinant, -(h11 * g2 - h12 * g1) / determinant
        else:
            step1, step2 = -down1 / (scale * scale), -down2 / (scale * scale)
        slope = down1 * step1 + down2 * step2
        length = min(1.0, 1.0 / (abs(step1) + abs(step2)))
        accepted = False
        while length > EPS and not accepted:
            new_phi, new_theta = phi + length * step1, theta + length * step2
            s1, c1, s2, c2 = np.sin(new_phi), np.cos(new_phi), np.sin(new_theta), np.cos(new_theta)
            g1, g2 = potential_gradient(s1, c1, s2, c2, c1 * c2 - s1 * s2, lift, spring, gravity, force)
            accepted = 0.5 * (g1 * g1 + g2 * g2) <= merit + _ARMIJO * length * slope
            length = 0.5 * length
        if not accepted:
            # At rounding level no step descends any more; else the start fell into a dip that is no root.
            return wrap(phi), wrap(theta), merit <= (256.0 * EPS * scale) ** 2
        phi, theta = new_phi, new_theta
    return wrap(phi), wrap(theta), False


@kernel(types.int64(types.float64, types.float64, types.float64, types.float64, VECTOR, MATRIX))
def search_grid(
    lift: float, spring: float, gravity: float, force: float, starts: Floats, found: Floats
) -> int:
    """Roots reached from the starts ``starts`` x ``starts``, duplicates on the torus merged.

    ``found`` (k, 2) receives angles phi, theta in (-pi, pi]; returns their number, at most k.
    """
    count = 0
    for start_phi in starts:
        for start_theta in starts:
            phi, theta, reached = newton_with_line_search(
                lift, spring, gravity, force, start_phi, start_theta
            )
            known = not reached
            for i in range(count):
                if np.hypot(wrap(phi - found[i, 0]), wrap(theta - found[i, 1])) < MERGE:
                    known = True
            if not known and count < found.shape[0]:
                found[count, 0], found[count, 1] = phi, theta
                count += 1
    return count


def grid_search(lift: float, spring: float, gravity: float, force: float, starts: int = STARTS) -> Floats:
    """Equilibria that Newton's method reaches from a grid of starts, shape (count, 2) [rad]."""
    found = np.empty((64, 2))
    angles = -np.pi + 2.0 * np.pi * (np.arange(starts) + 0.5) / starts
    return found[: search_grid(lift, spring, gravity, force, angles, found)].copy()
