"""Candidates: one bracket for every lap of every branch of the balance, solved and polished by Newton.

The conditions of rest as three balanced sinusoids, and how many solutions they have. With psi = phi + theta
the potential over m2 l^2 (paper (10), reduced) is

    U = A1 sin y1 + A2 sin y2 + A3 sin y3,     A1 cos y1 = a cos phi + f sin phi      (lift, force)
                                               A2 cos y2 = b sin theta + f cos theta  (gravity, force)
                                               A3 cos y3 = C cos psi                  (spring)

    y1 = phi - d1,  y2 = theta - d2,  y3 = -psi,    so    y1 + y2 + y3 = D := -(d1 + d2)  (mod 2 pi).

The mechanism rests exactly where the three pulls are equal, A1 cos y1 = A2 cos y2 = A3 cos y3 (paper (17)).
Nothing else of the scene matters, and the three angles play equal parts.

**Counting.** Number the amplitudes so that A1 is the smallest, and let rk = A1/Ak <= 1 for k = 2, 3. Then
yk = sk arccos(rk cos y1) with a sign sk for each, and the sum condition leaves one equation for y1 on each of
the four branches (s2, s3). With y1 = d - pi/2 and Ak(d) = arcsin(rk sin d), whose slope is at most rk:

- s2 = -s3: d - s2 (A2 - A3) = D + pi/2. The slope is 1 -+ (A2' - A3') > 0, since A2' and A3' have one sign
  and at most size one. So each of the two branches has exactly one solution.
- s2 = s3 = +-1, after a shift of d by pi for the lower sign: q(d) := d - A2(d) - A3(d) = D -+ pi/2
  (mod 2 pi). q is odd, gains 2 pi a turn, and its slope 1 - A2' - A3' grows with |d| up to |d| = pi/2 and is
  positive beyond. So if r2 + r3 <= 1 it increases and there is exactly one solution; else it increases to
  q(-w) = Q > 0, decreases to q(w) = -Q and increases again, and there are three solutions where
  |D -+ pi/2 mod 2 pi| < Q.
  Q < pi/2, so only one of the two branches can have three.

Hence there are **four equilibria, or six exactly if r2 + r3 > 1 and arcsin|cos D| < Q(r2, r3)**; the fold is
equality. (r2 + r3 > 1 says that 1/A1, 1/A2, 1/A3 are the sides of a triangle.) Equilibria are not isolated
exactly if two amplitudes vanish. Where A1 = A2 the branches have corners and meet at one another; that is
a singular point, it lies on the fold too, and the count elsewhere is unchanged.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fastmech.arrays import Floats
from fastmech.jit import inlined
from fastmech.slider.reduced import potential_gradient, potential_hessian

EPS = float(np.finfo(np.float64).eps)
HALF_PI = 0.5 * np.pi


class Pulls(NamedTuple):
    """The three sinusoids over (phi, theta, psi): amplitudes, phases, and what rounding may have changed.

    Everything is over the largest amplitude, so that products neither overflow nor vanish.
    """

    lift: float
    spring: float
    gravity: float
    force: float
    amplitude_phi: float
    amplitude_theta: float
    amplitude_psi: float
    phase_phi: float
    phase_theta: float
    error_phi: float  #: bound on the change of amplitude_phi (as a vector) by rounding of the coefficients
    error_theta: float
    error_psi: float


class Normal(NamedTuple):
    """The balance with the smallest amplitude first."""

    smallest: int  #: angle of the smallest amplitude: 0 phi, 1 theta, 2 -psi; the others follow cyclically
    ratio2: float  #: smallest amplitude over that of the next angle
    ratio3: float
    complement2: float  #: 1 - ratio2^2, without cancellation
    complement3: float
    turn: float  #: D, in (-pi, pi]
    corner: float  #: w: where q turns; 0 if it does not
    peak: float  #: Q = q(-w) [rad]; if q does not turn r2 + r3 - 1 <= 0, which continues Q to no fold
    distance: float  #: arcsin|cos D| [rad]: of D from the nearest odd multiple of pi/2
    error: float  #: bound on the error of peak - distance (of peak where that is below zero anyway) [rad]


@inlined
def wrap(angle: float) -> float:
    """The angle's representative in (-pi, pi]."""
    wrapped: float = angle - 2.0 * np.pi * np.rint(angle / (2.0 * np.pi))
    if wrapped <= -np.pi or wrapped > np.pi:
        return np.pi
    return wrapped


@inlined
def pulls(mass: float, lift: float, spring: float, gravity: float, force: float) -> Pulls:
    """Amplitudes, phases and rounding bounds of the three sinusoids, for finite coefficients.

    The bounds count the roundings of ``fastmech.slider.coefficients.reduce``: lift is a difference of
    two terms that were rounded before; every other coefficient has less than two relative roundings.
    """
    amplitude_phi = np.hypot(lift, force)
    amplitude_theta = np.hypot(gravity, force)
    scale = max(amplitude_phi, amplitude_theta, spring)
    if scale == 0.0:
        scale = 1.0
    lift_error = 2.0 * EPS * ((mass + 1.0) * gravity + abs(lift)) / scale
    a, C, b, f = lift / scale, spring / scale, gravity / scale, force / scale
    return Pulls(
        a,
        C,
        b,
        f,
        amplitude_phi / scale,
        amplitude_theta=amplitude_theta / scale,
        amplitude_psi=C,
        phase_phi=np.arctan2(f, a),
        phase_theta=np.arctan2(b, f),
        error_phi=lift_error + 2.0 * EPS * abs(f),
        error_theta=2.0 * EPS * (b + abs(f)),
        error_psi=2.0 * EPS * C,
    )


@inlined
def vanishing(p: Pulls) -> int:
    """How many of the three amplitudes are zero within rounding; two or more: equilibria not isolated."""
    count = 0
    if p.amplitude_phi <= p.error_phi:
        count += 1
    if p.amplitude_theta <= p.error_theta:
        count += 1
    if p.amplitude_psi <= p.error_psi:
        count += 1
    return count


@inlined
def lag(ratio: float, complement: float, sine: float, cosine: float) -> tuple[float, float]:
    """arcsin(ratio sin d) and its slope in d, accurate also near ratio = 1; the slope is NaN at a corner."""
    root = np.sqrt(complement + (ratio * cosine) ** 2)
    return np.arctan2(ratio * sine, root), ratio * cosine / root


@inlined
def lag_error(ratio: float, complement: float, sine: float, cosine: float, change: float) -> float:
    """Bound on the change of arcsin(ratio sin d) when ratio changes by up to ``change``.

    The slope 1/sqrt(1 - x^2) gives one bound; arcsin(1) - arcsin(1 - x) <= 2 sqrt(x) gives another, which
    holds at the corner too.
    """
    square = complement + (ratio * cosine) ** 2 - 2.0 * change
    steep: float = 2.0 * np.sqrt(change)
    if square > 0.0:
        steep = min(steep, change * sine / np.sqrt(square))
    return steep


@inlined
def corner_cosine_squared(complement2: float, complement3: float, ratio2: float, ratio3: float) -> float:
    """cos^2 w of the corner of q, where A2' + A3' = 1; given ratio2 + ratio3 > 1.

    Clearing the roots leaves 3 x^4 + 4 S x^3 + 6 N x^2 = N^2 for x = cos^2 w, with Bk = 1/rk^2 - 1,
    S = B2 + B3, N = B2 B3. The left side is convex and increasing, so Newton from above cannot overshoot;
    each term alone gives a bound from above, and the least of them is close.
    """
    B2 = complement2 / (ratio2 * ratio2)
    B3 = complement3 / (ratio3 * ratio3)
    S, N = B2 + B3, B2 * B3
    if N == 0.0:
        return 0.0
    x: float = min(1.0, np.cbrt(N * (N / (4.0 * S))), np.sqrt(N / np.sqrt(3.0)))
    for _ in range(60):
        value = ((3.0 * x + 4.0 * S) * x + 6.0 * N) * x * x - N * N
        slope = ((12.0 * x + 12.0 * S) * x + 12.0 * N) * x
        step = value / slope
        if not step > EPS * x:
            break
        x -= step
    return x


@inlined
def normal_form(p: Pulls) -> Normal:
    """The balance with its smallest amplitude first, and the margin to the fold with its rounding bound.

    At most one amplitude may vanish (see ``vanishing``).
    """
    smallest = 0
    low, middle, high = p.amplitude_phi, p.amplitude_theta, p.amplitude_psi
    low_error, middle_error, high_error = p.error_phi, p.error_theta, p.error_psi
    if middle < low and middle <= high:
        smallest = 1
        low, middle, high = middle, high, low
        low_error, middle_error, high_error = middle_error, high_error, low_error
    elif high < low:
        smallest = 2
        low, middle, high = high, low, middle
        low_error, middle_error, high_error = high_error, low_error, middle_error
    ratio2, ratio3 = low / middle, low / high
    complement2 = (middle - low) * (middle + low) / (middle * middle)
    complement3 = (high - low) * (high + low) / (high * high)
    change2 = (low_error + ratio2 * middle_error) / middle + 4.0 * EPS * ratio2
    change3 = (low_error + ratio3 * high_error) / high + 4.0 * EPS * ratio3
    turn = wrap(-(p.phase_phi + p.phase_theta))

    corner, peak = 0.0, min(ratio2 + ratio3 - 1.0, 0.0)
    error = change2 + change3
    if peak >= -error:
        error += p.error_phi / p.amplitude_phi + p.error_theta / p.amplitude_theta + 16.0 * EPS
    if ratio2 + ratio3 > 1.0:
        x = corner_cosine_squared(complement2, complement3, ratio2, ratio3)
        cosine, sine = np.sqrt(x), np.sqrt(1.0 - x)
        corner = np.arctan2(sine, cosine)
        peak = lag(ratio2, complement2, sine, cosine)[0] + lag(ratio3, complement3, sine, cosine)[0] - corner
        # Q is a maximum over d, so the error of the corner itself does not count.
        error += lag_error(ratio2, complement2, sine, cosine, change2)
        error += lag_error(ratio3, complement3, sine, cosine, change3)
    distance = abs(HALF_PI - abs(turn))
    return Normal(
        smallest, ratio2, ratio3, complement2, complement3,
        turn=turn, corner=corner, peak=peak, distance=distance, error=error,
    )  # fmt: skip


@inlined
def expected_count(n: Normal) -> int:
    """Number of equilibria by the theorem above: 4 or 6; 0 where rounding hides which."""
    margin = n.peak - n.distance
    if margin < -n.error:
        return 4
    if margin > n.error:
        return 6
    return 0


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
    return potential_gradient((s1, c1, s2, c2), c1 * c2 - s1 * s2, (p.lift, p.spring, p.gravity), p.force)


@inlined
def hessian(p: Pulls, phi: float, theta: float) -> tuple[float, float, float]:
    """Hessian of U over m2 l^2 and the scale, paper (19)."""
    s1, c1, s2, c2 = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    return potential_hessian((s1, c1, s2, c2), s1 * c2 + c1 * s2, (p.lift, p.spring, p.gravity), p.force)


@inlined
def polish(p: Pulls, phi: float, theta: float) -> tuple[float, float]:
    """Newton steps on the gradient as long as each makes it smaller; angles come back in (-pi, pi].

    A step shorter than ``SHORT`` is the last one: the next would be below rounding.
    """
    loads = p.lift, p.spring, p.gravity
    phi, theta = wrap(phi), wrap(theta)
    s1, c1, s2, c2 = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    g1, g2 = potential_gradient((s1, c1, s2, c2), c1 * c2 - s1 * s2, loads, p.force)
    merit = abs(g1) + abs(g2)
    for _ in range(8):
        h11, h12, h22 = potential_hessian((s1, c1, s2, c2), s1 * c2 + c1 * s2, loads, p.force)
        determinant = h11 * h22 - h12 * h12
        step1, step2 = -(h22 * g1 - h12 * g2) / determinant, -(h11 * g2 - h12 * g1) / determinant
        new_phi, new_theta = wrap(phi + step1), wrap(theta + step2)
        s1, c1, s2, c2 = np.sin(new_phi), np.cos(new_phi), np.sin(new_theta), np.cos(new_theta)
        g1, g2 = potential_gradient((s1, c1, s2, c2), c1 * c2 - s1 * s2, loads, p.force)
        if not abs(g1) + abs(g2) < merit:
            break
        merit = abs(g1) + abs(g2)
        phi, theta = new_phi, new_theta
        if abs(step1) + abs(step2) < SHORT:
            break
    return phi, theta


@inlined
def candidates(p: Pulls, n: Normal, phi: Floats, theta: Floats) -> int:
    """Write every equilibrium's angles into ``phi, theta`` (``LAPS`` slots each) and return their number.

    Where the fold is within rounding the laps that may have merged are all searched; what they give
    then agrees up to the square root of rounding, and is for the caller to merge.
    """
    count = 0
    for sign in (1.0, -1.0):
        target = n.turn + HALF_PI
        d = lap_root(n, sign, -sign, target, target - HALF_PI, high=target + HALF_PI, rising=1.0)
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
                d = lap_root(n, 1.0, 1.0, target, low, high=high, rising=rising)
                phi[count], theta[count] = polish(p, *angles(p, n, d + shift, sign, sign))
                count += 1
    return count
