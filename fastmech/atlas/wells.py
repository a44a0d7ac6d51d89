"""How deep each well is: the energy at which its sublevel set first meets another minimum.

Angles count their turns here: a copy of the same minimum one turn further is another minimum.
"""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.equilibria.outcome import Outcome
from fastmech.equilibria.solve import INDICES
from fastmech.jit import MATRIX, STATUSES, inlined, kernel
from fastmech.mechanism.reduced import (
    metric_determinant,
    potential_gradient,
    potential_hessian,
    slider_ratio,
)

Floats = NDArray[np.float64]
Codes = NDArray[np.int8]

COMPLETE = int(Outcome.COMPLETE)
TURN = 2.0 * np.pi

#: Longest step of a descent, and its first one off the saddle [rad].
STEP, OFF = 0.1, 1e-3

#: A descent has arrived when it is this near to a minimum [rad] and Newton's step is no longer.
ARRIVED = 1e-2

#: Steps after which a descent is given up; a turn takes some 60.
MOST_STEPS = 2000


@inlined
def slope(c: Floats, phi: float, theta: float) -> tuple[float, float, float, float, float]:
    """Reduced gradient (2 values) and Hessian (3 values) of U; ``c`` as ``Coefficients``."""
    s1, c1, s2, c2 = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    s12, c12 = s1 * c2 + c1 * s2, c1 * c2 - s1 * s2
    g1, g2 = potential_gradient(s1, c1, s2, c2, c12, c[2], c[3], c[4], c[5])
    h11, h12, h22 = potential_hessian(s1, c1, s2, c2, s12, c[2], c[3], c[4], c[5])
    return g1, g2, h11, h12, h22


@inlined
def least_eigenvalue(h11: float, h12: float, h22: float) -> float:
    """The smaller eigenvalue of a symmetric matrix."""
    return 0.5 * (h11 + h22) - np.hypot(0.5 * (h11 - h22), h12)


@inlined
def descend(
    c: Floats, phi: float, theta: float, side: float, phis: Floats, thetas: Floats, index: Codes, count: int
) -> tuple[int, float, float]:
    """Go down from a saddle on one side; the minimum reached and how many turns from its listed place.

    Steps are -(H + m)^-1 grad with m >= 0 so large that H + m is positive and no step exceeds ``STEP``: the
    way down in open country, Newton's method near the bottom, and along the floor of a narrow valley.
    Returns -1 if no minimum is reached.
    """
    _, _, h11, h12, h22 = slope(c, phi, theta)
    low = least_eigenvalue(h11, h12, h22)
    # Both (h12, low - h11) and (low - h22, h12) are eigenvectors; the longer one is accurate.
    v1, v2 = h12, low - h11
    if abs(low - h22) > abs(low - h11):
        v1, v2 = low - h22, h12
    size = np.hypot(v1, v2)
    if size == 0.0:
        v1, v2, size = 1.0, 0.0, 1.0
    phi, theta = phi + side * OFF * v1 / size, theta + side * OFF * v2 / size
    for _ in range(MOST_STEPS):
        g1, g2, h11, h12, h22 = slope(c, phi, theta)
        low = least_eigenvalue(h11, h12, h22)
        more = max(-low, 0.0) + np.hypot(g1, g2) / STEP
        k11, k22 = h11 + more, h22 + more
        determinant = k11 * k22 - h12 * h12
        d1, d2 = -(k22 * g1 - h12 * g2) / determinant, -(k11 * g2 - h12 * g1) / determinant
        phi, theta = phi + d1, theta + d2
        if low > 0.0 and np.hypot(d1, d2) < ARRIVED:
            for i in range(count):
                if index[i] == 0:
                    turns1 = np.round((phi - phis[i]) / TURN)
                    turns2 = np.round((theta - thetas[i]) / TURN)
                    if np.hypot(phi - phis[i] - turns1 * TURN, theta - thetas[i] - turns2 * TURN) < ARRIVED:
                        return i, turns1, turns2
    return -1, 0.0, 0.0


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
    for row in range(coefficients.shape[0]):
        barrier[row] = np.nan
        if outcome[row] != COMPLETE:
            continue
        n = int(count[row])
        for i in range(n):
            if index[row, i] != 1:
                continue
            if n == 4:
                barrier[row, 0] = energy[row, i]
                break
            args = (phi[row], theta[row], index[row], n)
            first, a1, a2 = descend(coefficients[row], phi[row, i], theta[row, i], 1.0, *args)
            second, b1, b2 = descend(coefficients[row], phi[row, i], theta[row, i], -1.0, *args)
            if first >= 0 and second >= 0 and (first != second or a1 != b1 or a2 != b2):
                if np.isnan(barrier[row, first]):
                    barrier[row, first] = energy[row, i]
                if np.isnan(barrier[row, second]):
                    barrier[row, second] = energy[row, i]


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
