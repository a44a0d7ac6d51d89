"""How deep each well is: the energy at which its sublevel set first meets another minimum.

Angles count their turns here: a copy of the same minimum one turn further is another minimum.
"""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.equilibria.descent import convex_radius, descend, step_off
from fastmech.equilibria.outcome import Outcome
from fastmech.equilibria.solve import INDICES
from fastmech.jit import MATRIX, STATUSES, kernel
from fastmech.mechanism.reduced import metric_determinant, slider_ratio

Floats = NDArray[np.float64]
Codes = NDArray[np.int8]

COMPLETE = int(Outcome.COMPLETE)


@kernel(types.void(MATRIX, MATRIX, MATRIX, MATRIX, INDICES, STATUSES, STATUSES, MATRIX))
def barriers(
    coefficients: Floats,
    phi: Floats,
    theta: Floats,
    energy: Floats,
    index: Codes,
    count: Codes,
    outcome: Codes,
    barrier: Floats,
) -> None:
    """Write the energy of the lowest way out of every minimum into ``barrier`` (n, 6), NaN elsewhere.

    Equilibria come deepest first, and energies and barriers are in the same unit; other arguments as in
    ``solve``. Saddles are taken in rising order. One whose two sides lead down to different minima (or to
    copies of one minimum, some turns apart) opens both wells. With four equilibria each saddle does: the
    torus has two independent turns, and two saddles for them.
    """
    phis, thetas, radii, slot = np.empty(6), np.empty(6), np.empty(6), np.empty(6, dtype=np.int64)
    for row in range(coefficients.shape[0]):
        barrier[row] = np.nan
        if outcome[row] != COMPLETE:
            continue
        n, minima = int(count[row]), 0
        for i in range(n):
            if index[row, i] == 0:
                phis[minima], thetas[minima], slot[minima] = phi[row, i], theta[row, i], i
                radii[minima] = convex_radius(coefficients[row], phi[row, i], theta[row, i])
                minima += 1
        for i in range(n):
            if index[row, i] != 1:
                continue
            if n == 4:
                barrier[row, 0] = energy[row, i]
                break
            c = coefficients[row]
            p1, t1 = step_off(c, phi[row, i], theta[row, i], 1.0)
            p2, t2 = step_off(c, phi[row, i], theta[row, i], -1.0)
            first, a1, a2 = descend(c, p1, t1, phis, thetas, radii, minima)
            second, b1, b2 = descend(c, p2, t2, phis, thetas, radii, minima)
            if first >= 0 and second >= 0 and (first != second or a1 != b1 or a2 != b2):
                for well in (first, second):
                    if np.isnan(barrier[row, slot[well]]):
                        barrier[row, slot[well]] = energy[row, i]


def least_speeds(coefficients: Floats, phi: Floats, theta: Floats, depth: Floats, mass: Floats) -> Floats:
    """Least speed of M2 [m/s] at which the mechanism's kinetic energy is ``depth`` [J], (n, 6).

    At rest's position the velocity v of M2 determines both rates, v = J q', hence the energy of the whole
    mechanism: T = v.W^-1 v / 2 with the mobility W = J M^-1 J^T, M the metric of paper (11). Since M2 hangs
    at M1 by a rod, W has the eigenvalues 1/m2 across the rod M1M2, where M2 swings alone, and 1/m along it,
    where it drags M1 and the slider with it:

        m = m2 + (m1 + m3 k^2) / cos^2(phi + theta),    k = -(dx3/dphi)/l.

    So T lies between m2 v^2/2 and m v^2/2, and a kick that gives M2 less than sqrt(2 depth / m) leaves T
    below the depth: it does not leave the well, in whatever direction, and with damping still less. The
    bound is reached along the rod; a blow across it needs sqrt(2 depth / m2), and an impulse on M2 in any
    direction at least sqrt(2 m2 depth), which depends on the depth alone. Where cos(phi + theta) = 0 crank
    and rod are in line, M1 can move while M2 rests, and the bound is 0: M2's speed tells nothing there.

    Args:
        coefficients: (n, 8) rows as ``solve`` takes them.
        phi, theta, depth: (n, 6) [rad], [rad], [J].
        mass: (n,) m2 [kg].
    """
    ratio, slider = coefficients[:, 0, None], coefficients[:, 1, None]
    k, _ = slider_ratio(np.sin(phi), np.cos(phi))
    cosine = np.cos(phi + theta)
    mobility = cosine**2 / (metric_determinant(ratio, slider, k, cosine) * mass[:, None])
    return np.asarray(np.sqrt(2.0 * depth * mobility))
