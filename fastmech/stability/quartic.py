"""Eigenvalues of small motion: two real quadratic factors of its polynomial by Newton's method.

The polynomial knows more than a state matrix in doubles: strong damping puts rates of 1e12 and 1e-12 1/s
beside one another, and its coefficients hold both to rounding where the matrix loses the slow ones.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastmech.equilibria.balance import EPS
from fastmech.jit import inlined
from fastmech.stability.linearize import SmallMotion

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
