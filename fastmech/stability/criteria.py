"""Three criteria of stability as codes with their rounding bounds: one source for maps and single calls.

Lagrange-Dirichlet with Sylvester's minors looks at U alone, Hurwitz at the characteristic polynomial, and the
eigenvalues at its roots. Each says ``CRITICAL`` where rounding hides the sign that it needs. Kernels compile
these functions; in Python they take NumPy's doubles, which divide by zero as kernels do.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.jit import inlined
from fastmech.stability.linearize import SmallMotion, polynomial, small_motion
from fastmech.stability.modes import slowest_decay, squares
from fastmech.stability.quartic import ROUNDING, Quadruple, motion_roots


class Verdict(IntEnum):
    """What a criterion says of an equilibrium."""

    NONE = -1
    """There is no equilibrium in this slot."""

    ASYMPTOTICALLY_STABLE = 0
    STABLE = 1
    UNSTABLE = 2
    CRITICAL = 3
    """Rounding hides the sign that the criterion needs."""


ASYMPTOTIC, STABLE, UNSTABLE, CRITICAL = (
    int(Verdict.ASYMPTOTICALLY_STABLE),
    int(Verdict.STABLE),
    int(Verdict.UNSTABLE),
    int(Verdict.CRITICAL),
)


class Assessment(NamedTuple):
    """What the criteria say of one equilibrium, and what they say it from; reduced units."""

    s: SmallMotion
    p: Quadruple  #: characteristic polynomial (p3, p2, p1, p0)
    p_error: Quadruple  #: bounds on its errors
    minor_error: tuple[float, float]  #: of an entry of the Hessian [1/s^2] and of its determinant [1/s^4]
    squares: tuple[float, float]  #: of the undamped natural frequencies [1/s^2], rising
    roots_error: Quadruple  #: ``p_error`` and what computing the eigenvalues adds
    decay: float  #: rate of the slowest mode [1/s]; NaN unless U has a minimum
    sylvester: int
    hurwitz: int
    spectrum: int
    joint: int


@inlined
def sylvester_code(s: SmallMotion, e: float, index: int) -> tuple[int, float]:
    """Lagrange-Dirichlet's verdict and the error of the second minor.

    ``e`` bounds each entry's error. ``index`` is the Morse index if it is proved, else negative: the
    equilibrium's own proof knows the determinant's sign more closely than the bound.
    """
    first, second = s.k11, s.k11 * s.k22 - s.k12 * s.k12
    size = abs(s.k11 * s.k22) + s.k12 * s.k12
    error = e * (abs(s.k11) + abs(s.k22) + 2.0 * abs(s.k12) + 2.0 * e) + ROUNDING * size
    if second < -error:
        return UNSTABLE, error
    if second > error:
        if first > e:
            return STABLE, error
        if first < 0.0:
            return UNSTABLE, error
    if index < 0:
        return CRITICAL, error
    return (STABLE if index == 0 else UNSTABLE), error


@inlined
def coefficient_errors(
    s: SmallMotion, p: Quadruple, e: float, minor_error: float, slider: float, damping: float, radius: float
) -> Quadruple:
    """Bounds on the errors of (p3, p2, p1, p0); ``e`` bounds those of the Hessian's entries.

    An angle's error, up to ``radius`` [rad], changes k by at most 1.5 of it and the metric by what follows.
    The damping coefficient counts as known to the rounding of the motion's own rate: a damping of less than
    ROUNDING per radian cannot be told from none in double precision.
    """
    turned = min(radius, 1.0)
    m11 = 3.0 * slider * (abs(s.k) + turned) * turned
    share = (turned + m11) / s.determinant
    size = (abs(s.k11) + s.m11 * abs(s.k22) + 2.0 * abs(s.s12 * s.k12)) / s.determinant
    ratio = 1.5 * (ROUNDING + turned)
    e3 = damping * ratio * (2.0 * abs(s.k) + ratio) / s.determinant + share * p[0]
    e3 += ROUNDING * (p[0] + np.sqrt(size))
    stiffness = e * (1.0 + s.m11 + 2.0 * abs(s.s12)) + m11 * abs(s.k22) + 2.0 * turned * abs(s.k12)
    return (
        e3,
        stiffness / s.determinant + share * abs(p[1]) + ROUNDING * size,
        e3 * abs(s.k22) + p[0] * e,
        minor_error / s.determinant + (share + ROUNDING) * abs(p[3]),
    )


@inlined
def hurwitz_determinants(p: Quadruple, e: Quadruple) -> tuple[Quadruple, Quadruple]:
    """D1 .. D4 of lambda^4 + p3 lambda^3 + p2 lambda^2 + p1 lambda + p0 with first-order error bounds."""
    p3, p2, p1, p0 = p
    e3, e2, e1, e0 = e
    a3, a2, a1, a0 = abs(p3), abs(p2), abs(p1), abs(p0)
    d2 = p3 * p2 - p1
    d3 = p1 * d2 - p3 * p3 * p0
    error2 = e3 * a2 + e2 * a3 + e1 + ROUNDING * (a3 * a2 + a1)
    error3 = e1 * abs(d2) + a1 * error2 + 2.0 * a3 * e3 * a0 + a3 * a3 * e0 + ROUNDING * a3 * a3 * a0
    return (p3, d2, d3, p0 * d3), (e3, error2, error3, e0 * abs(d3) + a0 * error3)


@inlined
def hurwitz_code(p: Quadruple, e: Quadruple) -> int:
    """Hurwitz's verdict: all determinants positive means that every root has a negative real part."""
    d, error = hurwitz_determinants(p, e)
    if d[0] > error[0] and d[1] > error[1] and d[2] > error[2] and d[3] > error[3]:
        return ASYMPTOTIC
    if p[0] < -e[0] or p[1] < -e[1] or p[2] < -e[2] or p[3] < -e[3] or d[1] < -error[1] or d[2] < -error[2]:
        return UNSTABLE
    return CRITICAL


@inlined
def root_errors(root: complex, p: Quadruple, e: Quadruple) -> tuple[float, float]:
    """How far a true eigenvalue may be from a computed one, and how far its real part may be [1/s].

    ``e`` bounds how far the coefficients are from those of the polynomial that has the computed roots. One at
    which the polynomial may be off by h is within 4 h/|P'| and within h^(1/4) of a true one. To first order
    it moves by -(sum of the coefficients' errors times root^k)/P'; only the real part of that moves its real
    part. So errors of the stiffnesses do not hide weak damping, nor errors of strong damping what is left.
    """
    r = np.sqrt(root.real * root.real + root.imag * root.imag)
    h = e[3] + r * (e[2] + r * (e[1] + r * e[0]))
    reach = np.sqrt(np.sqrt(h))
    slope = p[2] + root * (2.0 * p[1] + root * (3.0 * p[0] + root * 4.0))
    steep = np.sqrt(slope.real * slope.real + slope.imag * slope.imag)
    doubt = ROUNDING * (abs(p[2]) + r * (2.0 * abs(p[1]) + r * (3.0 * p[0] + r * 4.0)))
    steep_least = steep - doubt
    if not steep_least > 0.0:
        return reach, reach
    reach = min(reach, 4.0 * h / steep_least)
    inverse = complex(slope.real / steep, -slope.imag / steep) / steep
    one, two = root * inverse, root * root * inverse
    three = root * two
    along = abs(three.real) * e[0] + abs(two.real) * e[1] + abs(one.real) * e[2] + abs(inverse.real) * e[3]
    # The rest of Taylor's series, the errors of its first derivative, and that derivative's own rounding.
    bend = p[1] + root * (3.0 * p[0] + root * 6.0)
    curved = np.sqrt(bend.real * bend.real + bend.imag * bend.imag) + reach * (p[0] + 4.0 * r + reach)
    tilted = e[2] + r * (2.0 * e[1] + r * 3.0 * e[0]) + doubt
    return reach, min(reach, along + reach * (tilted + reach * curved) / steep_least)


@inlined
def spectrum_code(roots: NDArray[np.complex128], p: Quadruple, e: Quadruple) -> int:
    """Verdict by the signs of the eigenvalues' real parts."""
    settled = True
    for root in roots:
        _, error = root_errors(root, p, e)
        if root.real > error:
            return UNSTABLE
        if root.real >= -error:
            settled = False
    return ASYMPTOTIC if settled else CRITICAL


@inlined
def assess_one(
    coefficients: Floats, place: tuple[float, float, float, int], roots: NDArray[np.complex128]
) -> Assessment:
    """All three criteria at an equilibrium, and their joint verdict.

    A singular Hessian is critical; a Hessian with a negative direction is unstable, damped or not
    (Kelvin-Tait-Chetaev); a minimum is stable without damping and asymptotically stable with it, also where
    the linear damping misses a mode (LaSalle).

    Args:
        coefficients: (8,) ``fastmech.mechanism.coefficients.Coefficients``, the force frozen.
        place: phi, theta [rad], within how many rad the true equilibrium is, and its Morse index (negative:
            not proved).
        roots: (4,) eigenvalues [1/s], largest real part first; written.
    """
    mass, slider, lift, spring, gravity, force, damping, _ = coefficients
    phi, theta, radius, index = place
    s = small_motion(phi, theta, mass, slider, lift, spring, gravity, force, damping)
    # Third derivatives of U are at most 2 loads, so an angle's error changes the Hessian by no more.
    loads = abs(lift) + (mass + 2.0) * gravity + 2.0 * spring + 2.0 * abs(force)
    e = loads * (ROUNDING + 2.0 * min(radius, 1.0))
    p = polynomial(s)
    low, high = squares(s)
    by_minors, minor_error = sylvester_code(s, e, index)
    p_error = coefficient_errors(s, p, e, minor_error, slider, damping, radius)
    f = motion_roots(s, p, low, high, roots)
    both = (p_error[0] + f[0], p_error[1] + f[1], p_error[2] + f[2], p_error[3] + f[3])
    by_spectrum = spectrum_code(roots, p, both)
    decay, joint = np.nan, by_minors
    if by_minors == STABLE:
        decay = -roots[0].real if by_spectrum == ASYMPTOTIC else slowest_decay(s, spring, low, high, p)
        if damping > 0.0:
            joint = ASYMPTOTIC
    return Assessment(
        s, p, p_error, (e, minor_error), (low, high), both, decay, by_minors, hurwitz_code(p, p_error),
        by_spectrum, joint,
    )  # fmt: skip
