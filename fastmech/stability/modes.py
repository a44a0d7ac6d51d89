"""Undamped modes, and how far the slider's damper reaches them."""

from __future__ import annotations

import numpy as np

from fastmech.jit import inlined
from fastmech.stability.linearize import SmallMotion

#: Names of the three measures that must be away from zero for the damper to reach both modes.
SIN_PHI = "sin phi"
SIN_PSI = "sin(phi+theta)"
UNLOADED = "U_theta,theta - C"

#: What it means when one of them vanishes.
MEANING = {
    SIN_PHI: "the slider is at dead centre (sin phi = 0), so small motions do not move the damper",
    SIN_PSI: "sin(phi+theta) = 0, so M2 swings without pulling at M1",
    UNLOADED: "U_theta,theta = C, so the rod M1M2 is unloaded and M2 swings without pulling at M1",
}


@inlined
def squares(s: SmallMotion) -> tuple[float, float]:
    """Squares of the undamped natural frequencies [1/s^2], rising; negative ones grow instead.

    They are the roots of det(K - w^2 M), found from the Hessian in the Cholesky coordinates of M.
    """
    # With M = L L^T, L = [[r, s12], [0, 1]] (upper), r = sqrt(det M): L^-1 K L^-T is symmetric.
    r = np.sqrt(s.determinant)
    h12 = (s.k12 - s.s12 * s.k22) / r
    h11 = (s.k11 - 2.0 * s.s12 * s.k12 + s.s12 * s.s12 * s.k22) / s.determinant
    mean, half = 0.5 * (h11 + s.k22), 0.5 * (h11 - s.k22)
    spread = np.hypot(half, h12)
    larger = mean + np.copysign(spread, mean)
    product = (s.k11 * s.k22 - s.k12 * s.k12) / s.determinant
    smaller = product / larger if larger != 0.0 else 0.0
    return min(larger, smaller), max(larger, smaller)


def reach(s: SmallMotion, spring: float) -> dict[str, float]:
    """Three measures in [0, 1] of how well the damper reaches the modes; a mode is missed where one is zero.

    A mode that the damper misses has phi at rest: either k = 0 (sin phi = 0), or (0, 1) is an eigenvector of
    (K, M), K12 = sin(phi+theta) K22, which by K12 = C sin(phi+theta) means one of the other two.
    """
    total = abs(s.k22) + spring
    return {
        # k = sin phi (1 + cos phi / sqrt(4 - sin^2 phi)) <= 4/3 and zero only with sin phi.
        SIN_PHI: 0.75 * abs(s.k),
        SIN_PSI: abs(s.s12),
        UNLOADED: abs(s.k22 - spring) / total if total > 0.0 else 0.0,
    }


@inlined
def slowest_decay(
    s: SmallMotion, spring: float, low: float, high: float, p: tuple[float, float, float, float]
) -> float:
    """Decay rate [1/s] of the mode that the damper reaches least, for a minimum of U; zero if it is missed.

    For where eigenvalues have no digits left: weak, missing or enormous damping. The characteristic
    polynomial is (x^2 + w1^2)(x^2 + w2^2) + p3 x (x^2 + K22) with w1^2 <= K22 <= w2^2. Roots near i w, to
    first order in p3 or in the gap |K22 - w^2|, with W the other frequency:

        rate = p3 gap (W^2 - w^2) / (2 ((W^2 - w^2)^2 + p3^2 w^2)).

    For large p3 the same with the product of both gaps and K22 for w^2, and a real root at -p0/(p3 K22). The
    product is (K12 - sin(phi+theta) K22)^2 / det M, which gives the smaller gap without cancellation.
    """
    p3, _, p1, p0 = p
    split = high - low
    if not split > 0.0 or p3 == 0.0:
        return 0.0
    product = (s.s12 * (spring - s.k22)) ** 2 / s.determinant
    if p3 * p3 > high:
        return min(p3 * product / (2.0 * (split * split + p3 * p3 * s.k22)), p0 / p1)
    below, above = s.k22 - low, high - s.k22
    if below < above:
        below = product / above
    else:
        above = product / below
    return min(
        p3 * below * split / (2.0 * (split * split + p3 * p3 * low)),
        p3 * above * split / (2.0 * (split * split + p3 * p3 * high)),
    )
