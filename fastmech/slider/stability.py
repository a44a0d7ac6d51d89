"""Stability of one equilibrium by three criteria, and what they come to together.

Three criteria of stability as codes with their rounding bounds: one source for maps and single calls.
Lagrange-Dirichlet with Sylvester's minors looks at U alone, Hurwitz at the characteristic polynomial, and the
eigenvalues at its roots. Each says ``CRITICAL`` where rounding hides the sign that it needs. Kernels compile
these functions; in Python they take NumPy's doubles, which divide by zero as kernels do.

Eigenvalues of small motion: two real quadratic factors of its polynomial by Newton's method. The polynomial
knows more than a state matrix in doubles: strong damping puts rates of 1e12 and 1e-12 1/s beside one another,
and its coefficients hold both to rounding where the matrix loses the slow ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.jit import inlined
from fastmech.objects import Printed
from fastmech.scene import Scene
from fastmech.slider.equilibria import KINDS, Equilibrium
from fastmech.slider.lagrange import unit
from fastmech.slider.linearize import (
    MEANING,
    SmallMotion,
    linearized,
    polynomial,
    reach,
    slowest_decay,
    small_motion,
    squares,
)
from fastmech.slider.solve import existence_radius, morse_index
from fastmech.slider.theorem import EPS, pulls

#: Relative rounding of a quantity made from the coefficients in some ten operations, each within EPS/2.
ROUNDING = 16.0 * EPS

#: Newton steps before the factors count as not found; from the undamped ones two to six are enough.
STEPS = 24

#: A step below this part of the factors ends the iteration.
SETTLED = 4.0 * EPS

#: Residuals of the factors, in powers of the largest root's size, up to which they are accepted.
RESIDUAL = 32.0 * EPS

Quadruple = tuple[float, float, float, float]


@inlined
def factor(p: Quadruple, a: float, b: float, c: float, d: float) -> tuple[Quadruple, bool]:
    """x^4 + p3 x^3 + p2 x^2 + p1 x + p0 = (x^2 + a x + b)(x^2 + c x + d), from a guess of the factors.

    Newton's method on the four conditions a + c = p3, b + d + a c = p2, a d + b c = p1, b d = p0 (Bairstow's,
    for both factors at once); it converges quadratically unless the factors share a root.

    Returns:
        The factors and whether they reproduce the polynomial to rounding.
    """
    p3, p2, p1, p0 = p
    for _ in range(STEPS):
        r1 = p3 - (a + c)
        r2 = p2 - (b + d + a * c)
        r3 = p1 - (a * d + b * c)
        r4 = p0 - b * d
        # Eliminating the steps of c and d leaves two equations for those of a and b.
        reduced = r2 - a * r1
        m11, m12, n1 = d - b + a * (a - c), c - a, r3 - b * r1 - a * reduced
        m21, m22, n2 = b * (a - c), d - b, r4 - b * reduced
        determinant = m11 * m22 - m12 * m21
        if determinant == 0.0:
            break
        step_a = (n1 * m22 - n2 * m12) / determinant
        step_b = (m11 * n2 - m21 * n1) / determinant
        step_c = r1 - step_a
        step_d = reduced + (a - c) * step_a - step_b
        a, b, c, d = a + step_a, b + step_b, c + step_c, d + step_d
        moved = abs(step_a) + abs(step_c)
        size = abs(a) + abs(c)
        moved_square, square = abs(step_b) + abs(step_d), abs(b) + abs(d)
        if moved <= SETTLED * (size + np.sqrt(square)) and moved_square <= SETTLED * square:
            break
    scale = abs(a) + abs(c) + np.sqrt(abs(b) + abs(d))
    exact = (
        abs(p3 - (a + c)) <= RESIDUAL * scale
        and abs(p2 - (b + d + a * c)) <= RESIDUAL * scale**2
        and abs(p1 - (a * d + b * c)) <= RESIDUAL * scale**3
        and abs(p0 - b * d) <= RESIDUAL * abs(b * d)
    )
    return (a, b, c, d), exact


@inlined
def sum_size(a: float, b: float) -> float:
    """What rounding in the roots of x^2 + a x + b counts by in their sum: |a|, or more for opposite roots."""
    return max(abs(a), np.sqrt(max(-b, 0.0)))


@inlined
def factor_errors(p: Quadruple, f: Quadruple) -> Quadruple:
    """By how much (p3, p2, p1, p0) differ at most from the polynomial of the factors' computed roots."""
    a, b, c, d = f
    one, two = sum_size(a, b), sum_size(c, d)
    return (
        abs(p[0] - (a + c)) + ROUNDING * (one + two),
        abs(p[1] - (b + d + a * c)) + ROUNDING * (abs(b) + abs(d) + one * two),
        abs(p[2] - (a * d + b * c)) + ROUNDING * (one * abs(d) + abs(b) * two),
        abs(p[3] - b * d) + ROUNDING * abs(b * d),
    )


@inlined
def outer_root(p: Quadruple, x: float) -> float:
    """A real root of the polynomial, by Newton's method from beyond all others, roughly."""
    p3, p2, p1, p0 = p
    for _ in range(12):
        slope = p1 + x * (2.0 * p2 + x * (3.0 * p3 + 4.0 * x))
        x -= (p0 + x * (p1 + x * (p2 + x * (p3 + x)))) / slope
    return x


@inlined
def guess(way: int, s: SmallMotion, p: Quadruple, low: float, high: float) -> Quadruple:
    """Factors to begin with; ``low`` and ``high`` are the squares of the undamped frequencies [1/s^2].

    0: strong damping leaves one fast root, one slow one and an oscillation with phi held. 1: at a saddle the
    one growing root and the fastest decaying one are real and apart from the others. 2: the undamped factors
    with the modes' shares of the damping.
    """
    p3, p0 = p[0], p[3]
    if way == 0:
        return p3, p0 / s.k22, 0.0, s.k22
    if way == 1:
        one = outer_root(p, np.sqrt(abs(low)))
        other = outer_root(p, -(p3 + np.sqrt(abs(low)) + np.sqrt(abs(high))))
        return -one - other, one * other, p3 + one + other, p0 / (one * other)
    share = (s.k22 - low) / (high - low) if high > low else 0.5
    return p3 * (1.0 - share), low, p3 * share, high


@inlined
def quadratic(p: float, q: float) -> tuple[complex, complex]:
    """Roots of x^2 + p x + q, real ones without cancellation; of a pair the positive imaginary one first."""
    half = -0.5 * p
    discriminant = half * half - q
    if discriminant < 0.0:
        root = np.sqrt(-discriminant)
        return complex(half, root), complex(half, -root)
    larger = half + np.copysign(np.sqrt(discriminant), half)
    smaller = q / larger if larger != 0.0 else 0.0
    return complex(larger, 0.0), complex(smaller, 0.0)


@inlined
def sort_roots(roots: NDArray[np.complex128]) -> None:
    """Largest real part first; of a conjugate pair the positive imaginary part first."""
    for i in range(1, 4):
        for j in range(i, 0, -1):
            here, before = roots[j], roots[j - 1]
            if here.real < before.real or (here.real == before.real and here.imag <= before.imag):
                break
            roots[j], roots[j - 1] = before, here


@inlined
def motion_roots(
    s: SmallMotion, p: Quadruple, low: float, high: float, roots: NDArray[np.complex128]
) -> Quadruple:
    """Write the four eigenvalues [1/s], largest real part first.

    Returns:
        By how much the coefficients ``p`` differ at most from those of the polynomial that has these roots.
    """
    first = 2
    if p[0] * p[0] > 4.0 * abs(high) and s.k22 > 0.0:
        first = 0
    elif p[3] < 0.0 and p[0] > 0.0:
        first = 1
    a, b, c, d = guess(first, s, p, low, high)
    f, exact = factor(p, a, b, c, d)
    for other in range(3):
        if exact or other == first:
            continue
        a, b, c, d = guess(other, s, p, low, high)
        f, exact = factor(p, a, b, c, d)
    roots[0], roots[1] = quadratic(f[0], f[1])
    roots[2], roots[3] = quadratic(f[2], f[3])
    sort_roots(roots)
    return factor_errors(p, f)


class Verdict(IntEnum):
    """What a criterion says of an equilibrium."""

    NONE = -1
    """There is no equilibrium in this slot."""

    ASYMPTOTICALLY_STABLE = 0
    STABLE = 1
    UNSTABLE = 2
    CRITICAL = 3
    """Rounding hides the sign that the criterion needs."""


ASYMPTOTIC, STABLE, UNSTABLE, CRITICAL = (int(verdict) for verdict in Verdict if verdict >= 0)


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
        coefficients: (8,) ``fastmech.slider.coefficients.Coefficients``, the force frozen.
        place: phi, theta [rad], within how many rad the true equilibrium is, and its Morse index (negative:
            not proved).
        roots: (4,) eigenvalues [1/s], largest real part first; written.
    """
    mass, slider, lift, spring, gravity, force, damping, _ = coefficients
    phi, theta, radius, index = place
    s = small_motion(phi, theta, coefficients)
    # Third derivatives of U are at most 2 loads, so an angle's error changes the Hessian by no more.
    loads = abs(lift) + (mass + 2.0) * gravity + 2.0 * spring + 2.0 * abs(force)
    e = loads * (ROUNDING + 2.0 * min(radius, 1.0))
    p = polynomial(s)
    low, high = squares(s)
    by_minors, minor_error = sylvester_code(s, e, index)
    p_error = coefficient_errors(s, p, e, minor_error, slider, damping=damping, radius=radius)
    f = motion_roots(s, p, low, high, roots)
    both = (p_error[0] + f[0], p_error[1] + f[1], p_error[2] + f[2], p_error[3] + f[3])
    by_spectrum = spectrum_code(roots, p, both)
    decay, joint = np.nan, by_minors
    if by_minors == STABLE:
        decay = -roots[0].real if by_spectrum == ASYMPTOTIC else slowest_decay(s, spring, low, high, p)
        if damping > 0.0:
            joint = ASYMPTOTIC
    return Assessment(
        s, p, p_error, (e, minor_error), (low, high), roots_error=both, decay=decay, sylvester=by_minors,
        hurwitz=hurwitz_code(p, p_error), spectrum=by_spectrum, joint=joint,
    )  # fmt: skip


Word = Literal["asymptotically stable", "stable", "unstable", "critical"]

#: Verdicts, by their numbers.
VERDICTS: tuple[Word, ...] = ("asymptotically stable", "stable", "unstable", "critical")


class Finding(NamedTuple):
    """What one criterion says and why."""

    verdict: Word
    reason: str


def told_stability(found: Any) -> str:
    """Verdict, why, how fast motions decay, and the eigenvalues."""
    hours = found.decay_time / 3600.0
    slow = f" ({hours:.3g} h: it hardly comes to rest)" if 1.0 <= hours < np.inf else ""
    decay = "" if np.isnan(found.decay_time) else f"\ndecay time {found.decay_time:.4g} s{slow}"
    swings = ", ".join(f"{value:.6g}" for value in found.eigenvalues)
    return f"{found.verdict}: {found.explanation}{decay}\neigenvalues [1/s]: {swings}"


@dataclass(frozen=True, eq=False, repr=False)
class Classification(Printed):
    """Everything that decides an equilibrium's stability; SI units."""

    minors: Floats  #: Sylvester's leading minors of the Hessian of U (2,) [J, J^2]
    polynomial: Floats  #: characteristic polynomial (5,), monic, powers falling
    hurwitz_determinants: Floats  #: D1 .. D4
    eigenvalues: NDArray[np.complex128]  #: (4,) [1/s], largest real part first
    eigenvalue_errors: Floats  #: bound on the error of each [1/s]
    natural_frequencies: Floats  #: undamped (2,) [rad/s], rising; NaN for a direction that grows
    sylvester: Finding  #: Lagrange-Dirichlet with Sylvester's minors
    hurwitz: Finding
    spectrum: Finding  #: by the eigenvalues
    verdict: Word  #: the joint one
    explanation: str  #: why, and where the criteria differ, what that means
    decay_rate: float  #: of the slowest linear mode [1/s]; NaN unless U has a minimum
    reach: dict[str, float]  #: how well the damper reaches the modes; see ``linearize.reach``
    unreached: str | None  #: which measure of ``reach`` vanishes, if the damper misses a mode

    told = told_stability

    @property
    def decay_time(self) -> float:
        """Time [s] in which the slowest linear mode falls to 1/e; inf if it does not decay."""
        return 1.0 / self.decay_rate if self.decay_rate != 0.0 else np.inf


def classify(scene: Scene, equilibrium: Equilibrium) -> Classification:
    """Stability of one of a scene's equilibria, its force frozen; see :func:`assess_one`.

    Raises:
        InputError: an argument is wrong, or the scene is not at rest there, for example because the
            equilibrium is another scene's.
    """
    c, _ = linearized(scene, equilibrium)
    p = pulls(c.mass, c.lift, c.spring, c.gravity, c.force)
    radius = existence_radius(p, equilibrium.phi, equilibrium.theta)[0]
    index = morse_index(p, equilibrium.phi, equilibrium.theta, radius)
    roots = np.empty(4, dtype=np.complex128)
    with np.errstate(all="ignore"):
        a = assess_one(np.array(c), (equilibrium.phi, equilibrium.theta, radius, index), roots)
        errors = np.array([root_errors(root, a.p, a.roots_error) for root in roots])
        frequencies = np.sqrt(np.array(a.squares))
    by_minors, measures, unreached = _by_minors(a, index), reach(a.s, c.spring), None
    if a.sylvester == STABLE and a.hurwitz == CRITICAL and a.spectrum != ASYMPTOTIC and c.damping > 0.0:
        unreached = min(measures, key=lambda name: measures[name])
    inertia = unit(scene)
    return Classification(
        minors=np.array([a.s.k11 * inertia, (a.s.k11 * a.s.k22 - a.s.k12 * a.s.k12) * inertia**2]),
        polynomial=np.array([1.0, *a.p]),
        hurwitz_determinants=np.array(hurwitz_determinants(a.p, a.p_error)[0]),
        eigenvalues=roots,
        eigenvalue_errors=errors[:, 0],
        natural_frequencies=frequencies,
        sylvester=by_minors,
        hurwitz=_by_hurwitz(a),
        spectrum=_by_spectrum(a, roots, errors[:, 1]),
        verdict=VERDICTS[a.joint],
        explanation=_explanation(a, c.damping, by_minors.reason, unreached, measures),
        decay_rate=float(a.decay),
        reach=measures,
        unreached=unreached,
    )


def _by_minors(a: Assessment, index: int) -> Finding:
    """Lagrange-Dirichlet: a minimum of U is stable; a negative direction of U is unstable by second order."""
    first, second = a.s.k11, a.s.k11 * a.s.k22 - a.s.k12 * a.s.k12
    e, error = a.minor_error
    if a.sylvester == CRITICAL:
        reason = f"the Hessian is singular within rounding: its determinant is {second:.2g} 1/s^4"
    elif second < -error:
        reason = "the Hessian's determinant is negative: U has a saddle"
    elif second > error and first > e:
        reason = "both leading minors of the Hessian are positive: U has a minimum"
    elif second > error and first < 0.0:
        reason = "the Hessian is negative definite: U has a maximum"
    else:
        reason = f"U has a {KINDS[index]}: its minors are near zero, their signs proved with the equilibrium"
    return Finding(VERDICTS[a.sylvester], reason)


def _by_hurwitz(a: Assessment) -> Finding:
    """Hurwitz, with the coefficient or determinant that decides."""
    if a.hurwitz == ASYMPTOTIC:
        return Finding(VERDICTS[ASYMPTOTIC], "all four Hurwitz determinants are positive")
    d, error = (np.array(values) for values in hurwitz_determinants(a.p, a.p_error))
    negative = np.array(a.p) < -np.array(a.p_error)
    if negative.any():
        name = ("p3", "p2", "p1", "p0")[int(np.argmax(negative))]
        reason = f"the coefficient {name} is negative: a root has a positive real part"
    elif a.hurwitz == UNSTABLE:
        reason = f"the Hurwitz determinant D{int(np.argmax(d < -error)) + 1} is negative"
    else:
        name = f"D{int(np.argmin(d > error)) + 1}"
        reason = f"the Hurwitz determinant {name} is zero within rounding: a root is on the axis"
    return Finding(VERDICTS[a.hurwitz], reason)


def _by_spectrum(a: Assessment, roots: NDArray[np.complex128], errors: Floats) -> Finding:
    """The eigenvalues' real parts, counted."""
    if a.spectrum == ASYMPTOTIC:
        return Finding(VERDICTS[ASYMPTOTIC], "every eigenvalue has a negative real part")
    unstable = a.spectrum == UNSTABLE
    count = int(np.count_nonzero(roots.real > errors if unstable else roots.real >= -errors))
    verb = ("has" if count == 1 else "have") if unstable else ("is" if count == 1 else "are")
    what = "a positive real part" if unstable else "on the imaginary axis within rounding"
    return Finding(VERDICTS[a.spectrum], f"{count} of the four eigenvalues {verb} {what}")


def _explanation(
    a: Assessment, damping: float, minors: str, unreached: str | None, measures: dict[str, float]
) -> str:
    """Why the joint verdict is what it is."""
    if a.joint == CRITICAL:
        return f"{minors}; equilibria merge here and second order does not decide"
    if a.joint == UNSTABLE:
        return f"{minors}, which no damping makes stable (Kelvin-Tait-Chetaev)"
    if damping == 0.0:
        return (
            "U has a minimum and nothing damps (beta = 0): disturbances stay small but do not die out; "
            "Hurwitz and the eigenvalues are silent because all roots are on the imaginary axis"
        )
    if unreached is not None:
        return (
            f"U has a minimum but the damper misses a mode: {MEANING[unreached]} "
            f"(measure {measures[unreached]:.2g}, linear decay rate {a.decay:.2g} 1/s); Hurwitz and the "
            "eigenvalues are silent and the decay is algebraic, the energy falling like 1/t or slower"
        )
    settled = f"U has a minimum and the damper reaches both modes; the slower one decays at {a.decay:.3g} 1/s"
    silent = "Hurwitz" if a.hurwitz == CRITICAL else "the eigenvalues"
    if CRITICAL in (a.hurwitz, a.spectrum):
        settled += f"; that is below the rounding of {silent}"
    return settled
