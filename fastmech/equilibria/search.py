"""Candidates: one bracket for every lap of every branch of the balance, solved and polished by Newton."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastmech.equilibria.balance import EPS, HALF_PI, Normal, Pulls, lag, wrap
from fastmech.jit import inlined
from fastmech.mechanism.reduced import potential_gradient, potential_hessian

FloatArray = NDArray[np.float64]

#: The exact bound on the number of equilibria of a scene whose equilibria are isolated.
MOST = 6

#: Length of a Newton step [rad] after which the next one, of second order in it, is lost in rounding.
SHORT = 1e-10

#: Laps of all branches: two with one, two with three; all have a solution only within rounding of a fold.
LAPS = 8


@inlined
def lap_root(
    n: Normal, sign2: float, sign3: float, target: float, low: float, high: float, rising: float
) -> float:
    """Root of d - sign2 A2(d) - sign3 A3(d) = target on a lap [low, high] where the left side is monotone.

    Newton's method that halves the bracket wherever a step would leave it (a NaN slope at a corner
    included). Where the target is beyond the lap's end values the nearer end comes back: at a fold.
    """
    x = 0.5 * (low + high)
    for _ in range(100):
        sine, cosine = np.sin(x), np.cos(x)
        lag2, slope2 = lag(n.ratio2, n.complement2, sine, cosine)
        lag3, slope3 = lag(n.ratio3, n.complement3, sine, cosine)
        value = rising * (x - sign2 * lag2 - sign3 * lag3 - target)
        if value > 0.0:
            high = x
        else:
            low = x
        step = x - value / (rising * (1.0 - sign2 * slope2 - sign3 * slope3))
        if not low < step < high:
            step = 0.5 * (low + high)
        if abs(step - x) <= EPS * max(1.0, abs(x)):
            return step
        x = step
    return x


@inlined
def angles(p: Pulls, n: Normal, d: float, sign2: float, sign3: float) -> tuple[float, float]:
    """(phi, theta) of the point d of a branch."""
    sine, cosine = np.sin(d), np.cos(d)
    first = d - HALF_PI
    second = sign2 * (HALF_PI - lag(n.ratio2, n.complement2, sine, cosine)[0])
    third = sign3 * (HALF_PI - lag(n.ratio3, n.complement3, sine, cosine)[0])
    if n.smallest == 0:
        return first + p.phase_phi, second + p.phase_theta
    if n.smallest == 1:
        return third + p.phase_phi, first + p.phase_theta
    return second + p.phase_phi, third + p.phase_theta


@inlined
def gradient(p: Pulls, phi: float, theta: float) -> tuple[float, float]:
    """Gradient of U over m2 l^2 and the scale, paper (17)."""
    s1, c1, s2, c2 = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    return potential_gradient(s1, c1, s2, c2, c1 * c2 - s1 * s2, p.lift, p.spring, p.gravity, p.force)


@inlined
def hessian(p: Pulls, phi: float, theta: float) -> tuple[float, float, float]:
    """Hessian of U over m2 l^2 and the scale, paper (19)."""
    s1, c1, s2, c2 = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    return potential_hessian(s1, c1, s2, c2, s1 * c2 + c1 * s2, p.lift, p.spring, p.gravity, p.force)


@inlined
def polish(p: Pulls, phi: float, theta: float) -> tuple[float, float]:
    """Newton steps on the gradient as long as each makes it smaller; angles come back in (-pi, pi].

    A step shorter than ``SHORT`` is the last one: the next would be below rounding.
    """
    phi, theta = wrap(phi), wrap(theta)
    s1, c1, s2, c2 = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    g1, g2 = potential_gradient(s1, c1, s2, c2, c1 * c2 - s1 * s2, p.lift, p.spring, p.gravity, p.force)
    merit = abs(g1) + abs(g2)
    for _ in range(8):
        h11, h12, h22 = potential_hessian(
            s1, c1, s2, c2, s1 * c2 + c1 * s2, p.lift, p.spring, p.gravity, p.force
        )
        determinant = h11 * h22 - h12 * h12
        step1, step2 = -(h22 * g1 - h12 * g2) / determinant, -(h11 * g2 - h12 * g1) / determinant
        new_phi, new_theta = wrap(phi + step1), wrap(theta + step2)
        s1, c1, s2, c2 = np.sin(new_phi), np.cos(new_phi), np.sin(new_theta), np.cos(new_theta)
        g1, g2 = potential_gradient(s1, c1, s2, c2, c1 * c2 - s1 * s2, p.lift, p.spring, p.gravity, p.force)
        if not abs(g1) + abs(g2) < merit:
            break
        merit = abs(g1) + abs(g2)
        phi, theta = new_phi, new_theta
        if abs(step1) + abs(step2) < SHORT:
            break
    return phi, theta


@inlined
def candidates(p: Pulls, n: Normal, phi: FloatArray, theta: FloatArray) -> int:
    """Write every equilibrium's angles into ``phi, theta`` (``LAPS`` slots each) and return their number.

    Where the fold is within rounding the laps that may have merged are all searched; what they give
    then agrees up to the square root of rounding, and is for the caller to merge.
    """
    count = 0
    for sign in (1.0, -1.0):
        target = n.turn + HALF_PI
        d = lap_root(n, sign, -sign, target, target - HALF_PI, target + HALF_PI, 1.0)
        phi[count], theta[count] = polish(p, *angles(p, n, d, sign, -sign))
        count += 1
    for sign in (1.0, -1.0):
        target = wrap(n.turn - sign * HALF_PI)
        shift = 0.0 if sign > 0.0 else np.pi
        for lap in range(-1, 2):
            # Laps: [-pi, -w] rising, [-w, w] falling, [w, pi] rising; one rising where q does not turn.
            low = (-np.pi, -n.corner, n.corner)[lap + 1]
            high = (-n.corner, n.corner, np.pi)[lap + 1]
            if n.corner == 0.0:
                low, high = -np.pi, np.pi
                there = lap == 0
            elif lap == 0:
                there = abs(target) <= n.peak + n.error
            else:
                there = -lap * target <= n.peak + n.error
            if there:
                rising = -1.0 if lap == 0 and n.corner > 0.0 else 1.0
                d = lap_root(n, 1.0, 1.0, target, low, high, rising)
                phi[count], theta[count] = polish(p, *angles(p, n, d + shift, sign, sign))
                count += 1
    return count
