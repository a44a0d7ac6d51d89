"""The way down the potential, with proof: which minimum a place on the unwrapped plane is connected to.

A path on which U never rises connects its start with its end inside {U <= U(start)}. Here every step proves
that U falls along the whole of it, and the path ends in a ball about a minimum in which U is convex, so that
the straight line to the minimum falls too. Where the path ends is therefore no matter of step lengths: the
start lies in that minimum's component of the sublevel set, and the minimum's turns are counted on the way.
"""

from __future__ import annotations

import numpy as np

from fastmech.arrays import Floats
from fastmech.jit import inlined
from fastmech.slider.reduced import potential_gradient, potential_hessian

TURN = 2.0 * np.pi

#: Share of the proved radius of convexity that is used: what rounding takes is far less than the rest.
INSIDE = 0.9

#: Steps after which a descent is given up; a turn takes some twenty.
MOST_STEPS = 500

#: A place where neither slope nor a step of this length [rad] leads down is an unstable equilibrium.
STANDSTILL = 1e-9


@inlined
def slope(c: Floats, phi: float, theta: float) -> tuple[float, float, float, float, float]:
    """Reduced gradient (2 values) and Hessian (3 values) of U; ``c`` as ``Coefficients``."""
    s1, c1, s2, c2 = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    s12, c12 = s1 * c2 + c1 * s2, c1 * c2 - s1 * s2
    g1, g2 = potential_gradient((s1, c1, s2, c2), c12, (c[2], c[3], c[4]), c[5])
    h11, h12, h22 = potential_hessian((s1, c1, s2, c2), s12, (c[2], c[3], c[4]), c[5])
    return g1, g2, h11, h12, h22


@inlined
def least_eigenvalue(h11: float, h12: float, h22: float) -> float:
    """The smaller eigenvalue of a symmetric matrix."""
    return 0.5 * (h11 + h22) - np.hypot(0.5 * (h11 - h22), h12)


@inlined
def curvature_bound(c: Floats) -> float:
    """Bound on the Hessian's eigenvalues, in magnitude, over the whole plane.

    U is a sinusoid of phi, one of theta and one of phi + theta, whose Hessian has the norm 2 C.
    """
    return max(np.hypot(c[2], c[5]), np.hypot(c[4], c[5])) + 2.0 * abs(c[3])


@inlined
def third_bound(c: Floats) -> float:
    """Bound M on how fast the Hessian changes: |H(x) - H(y)| <= M |x - y|, and |U'''(d, d, d)| <= M |d|^3."""
    return max(np.hypot(c[2], c[5]), np.hypot(c[4], c[5])) + 2.0 * np.sqrt(2.0) * abs(c[3])


@inlined
def convex_radius(c: Floats, phi: float, theta: float) -> float:
    """Radius [rad] of a ball about a minimum in which U is convex; not positive: none is proved."""
    _, _, h11, h12, h22 = slope(c, phi, theta)
    return INSIDE * least_eigenvalue(h11, h12, h22) / third_bound(c)


@inlined
def step_off(c: Floats, phi: float, theta: float, side: float) -> tuple[float, float]:
    """A place below a saddle on one side, +1 or -1, with a straight falling way to it.

    Along the unstable eigenvector, whose eigenvalue is -u, a step of u/M falls: u s^2/2 > M s^3/6 up to it.
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
    reach = side * abs(low) / third_bound(c) / size
    return phi + reach * v1, theta + reach * v2


@inlined
def step_down(c: Floats, third: float, phi: float, theta: float) -> tuple[float, float, float]:
    """Where one falling step leads, and the step's length [rad]; zero length: at a standstill.

    The step is d = -(H + m)^-1 g with m >= 0 such that H + m > 0, so g.d + d.H.d/2 <= -d.(H + m).d/2, and
    such that |d| <= 3 (least eigenvalue of H + m)/M, so that the cubic remainder M |d|^3/6 cannot outweigh
    it; both hold with m = max(-least, 0) + sqrt(M |g|/3), and for every part of the step too. (Newton's
    method with cubic regularization: Nesterov and Polyak, Mathematical Programming 108 (2006) 177.)
    """
    g1, g2, h11, h12, h22 = slope(c, phi, theta)
    low = least_eigenvalue(h11, h12, h22)
    more = max(-low, 0.0) + np.sqrt(third * np.hypot(g1, g2) / 3.0)
    k11, k22 = h11 + more, h22 + more
    determinant = k11 * k22 - h12 * h12
    if not determinant > 0.0:
        return phi, theta, 0.0
    d1, d2 = -(k22 * g1 - h12 * g2) / determinant, -(k11 * g2 - h12 * g1) / determinant
    length = np.hypot(d1, d2)
    if low <= 0.0 and length < STANDSTILL:
        return phi, theta, 0.0
    return phi + d1, theta + d2, length


@inlined
def in_ball(
    phi: float, theta: float, middle: tuple[float, float], radius: float
) -> tuple[bool, float, float]:
    """Whether a place lies in the ball about another, and its turns from it."""
    turns1, turns2 = np.rint((phi - middle[0]) / TURN), np.rint((theta - middle[1]) / TURN)
    away = np.hypot(phi - middle[0] - turns1 * TURN, theta - middle[1] - turns2 * TURN)
    return away < radius, turns1, turns2


@inlined
def descend(
    c: Floats, phi: float, theta: float, phis: Floats, thetas: Floats, radii: Floats, count: int
) -> tuple[int, float, float]:
    """Go down to a minimum; which one of ``count`` (-1: none is reached), and its turns.

    ``phis``, ``thetas`` and ``radii`` are the minima's listed places and their radii of convexity [rad].
    """
    third = third_bound(c)
    for _ in range(MOST_STEPS):
        for well in range(count):
            inside, turns1, turns2 = in_ball(phi, theta, (phis[well], thetas[well]), radii[well])
            if inside:
                return well, turns1, turns2
        phi, theta, length = step_down(c, third, phi, theta)
        if length == 0.0:
            break
    return -1, 0.0, 0.0
