"""Eigenvalues of small motion of a lane from two real quadratics, without LAPACK.

The damper acts on one body only, so that the characteristic polynomial lambda^4 + p3 lambda^3 + .. + p0
(paper, Table 4) is known in closed form. It is (lambda^2 + a lambda + b)(lambda^2 + c lambda + d), where
y = b + d is a root of Ferrari's resolvent y^3 - p2 y^2 + (p1 p3 - 4 p0) y - (p3^2 p0 + p1^2 - 4 p2 p0).
Without damper y = p2; light damping hardly moves it, strong damping makes the resolvent as good as linear:
Newton's method from p2 needs few steps for both. Where they are too few, or b is too near to d and a to c,
LAPACK finds the eigenvalues.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fastmech.jit import inlined

#: Newton iterations for the resolvent, and the error of p2 that they may leave.
ITERATIONS, RESOLVED = 5, 1e-12

#: Relative difference of b and d below which a and c are too uncertain by the one way to find them, of a and
#: c by the other, and the relative error of p0 that this may leave.
APART, UNCERTAIN = 1e-3, 1e-10

#: Newton iterations that bring an eigenvalue to rounding, and the last one's relative size.
POLISH, POLISHED = 3, 1e-9


class Factors(NamedTuple):
    """The quadratics lambda^2 + a lambda + b, lambda^2 + c lambda + d of a small motion."""

    a: Any
    b: Any
    c: Any
    d: Any
    found: Any  #: whether the others are they, to nine digits or so


@inlined
def factored(p3: Any, p2: Any, p1: Any, p0: Any) -> Factors:
    """The characteristic polynomial as a product of two real quadratics."""
    linear = p1 * p3 - 4.0 * p0
    constant = p3 * p3 * p0 + p1 * p1 - 4.0 * p2 * p0
    y = p2
    for _ in range(ITERATIONS):
        less = y - p2
        product = less * y + linear
        y = y - (product * y - constant) / (product + y * (less + y))
    b = 0.5 * (y + np.copysign(np.sqrt(y * y - 4.0 * p0), y))
    d = p0 / b
    difference, size = d - b, np.abs(b) + np.abs(d)
    a, c = (p1 - p3 * b) / difference, (p3 * d - p1) / difference
    product = a * c
    missed = np.abs(b + d + product - p2)
    found = (missed <= RESOLVED * (size + np.abs(product))) & (np.abs(difference) > APART * size)
    # Where b and d are too near to tell a from c by p1, p2 does, and then p1 b from d.
    apart = np.sqrt(p3 * p3 - 4.0 * (p2 - y))
    near_a, near_c = 0.5 * (p3 + apart), 0.5 * (p3 - apart)
    near_d = (p1 - near_c * y) / apart
    near_b = y - near_d
    near = (np.abs(near_b * near_d - p0) <= UNCERTAIN * np.abs(p0)) & (
        apart * apart > APART * APART * np.abs(y)
    )
    if not found:
        a, b, c, d = near_a, near_b, near_c, near_d
    return Factors(a, b, c, d, found | near)


@inlined
def polished(real: Any, imaginary: Any, p3: Any, p2: Any, p1: Any, p0: Any) -> tuple[Any, Any, Any]:
    """An eigenvalue's two parts after Newton iterations for its polynomial, and whether it is exact."""
    moved = 0.0 * real
    for _ in range(POLISH):
        value = complex(real, imaginary)
        first = value + p3
        second = first * value + p2
        third = second * value + p1
        slope = ((value + first) * value + second) * value + third
        rest = third * value + p0
        size = slope.real * slope.real + slope.imag * slope.imag
        size = size + 1.0 * (rest == 0.0)  # where nothing is left to find, the slope may be 0 too
        along = (rest.real * slope.real + rest.imag * slope.imag) / size
        across = (rest.imag * slope.real - rest.real * slope.imag) / size
        moved = along * along + across * across
        real, imaginary = real - along, imaginary - across
    return real, imaginary, moved <= (POLISHED * POLISHED) * (real * real + imaginary * imaginary)
