"""Roots of the characteristic polynomial, compiled: two real quadratic factors by Newton's method."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastmech.equilibria.balance import EPS
from fastmech.jit import inlined

Floats = NDArray[np.float64]

#: Newton steps before the factors count as not found; from the undamped ones two to six are enough.
STEPS = 24

#: A step below this part of the factors ends the iteration.
SETTLED = 4.0 * EPS

#: Residuals of the factors, in powers of the largest root's size, up to which they are accepted.
RESIDUAL = 32.0 * EPS


@inlined
def factor(
    p3: float, p2: float, p1: float, p0: float, a: float, b: float, c: float, d: float
) -> tuple[float, float, float, float, bool]:
    """x^4 + p3 x^3 + p2 x^2 + p1 x + p0 = (x^2 + a x + b)(x^2 + c x + d), from a guess of the factors.

    Newton's method on the four conditions a + c = p3, b + d + a c = p2, a d + b c = p1, b d = p0 (Bairstow's,
    for both factors at once); it converges quadratically unless the factors share a root.

    Returns:
        The factors and whether they reproduce the polynomial to rounding.
    """
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
    return a, b, c, d, exact


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
