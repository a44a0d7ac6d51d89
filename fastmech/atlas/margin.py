"""The signed distance to the fold at many parameter points, and where equilibria merge on the fold."""

from __future__ import annotations

import numpy as np
from numba import types

from fastmech.arrays import Floats
from fastmech.equilibria.search import HALF_PI, angles, normal_form, pulls, vanishing, wrap
from fastmech.jit import MATRIX, VECTOR, kernel


@kernel(types.void(MATRIX, VECTOR, VECTOR, VECTOR, VECTOR))
def fold_margins(coefficients: Floats, margin: Floats, symmetry: Floats, phi: Floats, theta: Floats) -> None:
    """Margin to the fold, and the place that becomes an equilibrium where it vanishes.

    Args:
        coefficients: (n, 8) rows of ``fastmech.mechanism.coefficients.Coefficients``, the force frozen.
        margin: (n,) [rad], positive with six equilibria (see ``balance``); NaN if degenerate; written.
        symmetry: (n,) |cos D|, zero where the scene is its own mirror image; written.
        phi, theta: (n,) [rad]: where two equilibria merge once the margin is zero; written.
    """
    for row in range(coefficients.shape[0]):
        mass, _, lift, spring, gravity, force, _, _ = coefficients[row]
        p = pulls(mass, lift, spring, gravity, force)
        if vanishing(p) >= 2:
            margin[row], symmetry[row], phi[row], theta[row] = np.nan, np.nan, np.nan, np.nan
            continue
        n = normal_form(p)
        margin[row] = n.peak - n.distance
        symmetry[row] = np.sin(n.distance)
        sign = 1.0 if abs(wrap(n.turn - HALF_PI)) <= abs(wrap(n.turn + HALF_PI)) else -1.0
        target = wrap(n.turn - sign * HALF_PI)
        d = -n.corner if target > 0.0 else n.corner
        if sign < 0.0:
            d += np.pi
        phi[row], theta[row] = angles(p, n, d, sign, sign)


def margins(coefficients: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Margin, symmetry, phi and theta of rows of reduced coefficients; see ``fold_margins``."""
    out = np.empty((4, len(coefficients)))
    fold_margins(coefficients, *out)
    return out[0], out[1], out[2], out[3]
