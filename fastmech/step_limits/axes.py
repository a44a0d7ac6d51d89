"""How far a method's stability region reaches along the negative real and the imaginary axis."""

from __future__ import annotations

from fractions import Fraction
from math import factorial

import numpy as np

from fastmech.integrators.method import Adams, Method, RungeKutta, bashforth, moulton
from fastmech.step_limits.amplification import amplifies, first_crossing, stability_polynomial

#: Growth a step that rounding explains.
ROUNDED = 1e-11

#: Where the search begins and ends: a method that is stable to the end has no limit.
NEAREST, FARTHEST = 1e-3, 1e8


def real_limit(method: Method) -> float:
    """Largest x such that the method is stable at every -x' with 0 < x' <= x; inf if A-stable there."""
    return first_crossing(lambda x: amplifies(method, -x, 1.0 + ROUNDED), NEAREST, FARTHEST)


def imaginary_limit(method: Method) -> float:
    """Largest y such that the method is stable at every i y', 0 < y' <= y; 0 if growth begins at once."""
    if isinstance(method, RungeKutta):
        return _explicit_imaginary(method)
    if isinstance(method, Adams) and _first_growth(method) > 0:
        return 0.0
    return first_crossing(lambda y: amplifies(method, 1j * y, 1.0 + ROUNDED), NEAREST, FARTHEST)


def _first_growth(method: Adams) -> Fraction:
    """Leading coefficient of log|zeta| at z = iy by powers of y, of the root zeta near exp(z), exactly.

    Rounding hides it where it is small. The root solves zeta = sum_a row_a(z) zeta^-a with rows of powers of
    z; exp(z) misses that by r(z), which begins with the power ``order + 1``, so that log zeta is
    z - r / (1 + D z + ...).
    """
    past = bashforth(method.start_steps + 1)
    rows = [[Fraction(int(age == 0)), weight, Fraction(0)] for age, weight in enumerate(past)]
    if method.corrects:
        last, *others = moulton(method.order)
        rows = [
            [Fraction(int(age == 0)), weight + last * int(age == 0), last * row[1]]
            for age, (weight, row) in enumerate(zip(others, rows, strict=True))
        ]
    first = method.order + 1
    missed = [
        Fraction(1, factorial(n))
        - sum(
            c * Fraction(-age) ** (n - power) / factorial(n - power)
            for age, row in enumerate(rows)
            for power, c in enumerate(row)
            if n >= power
        )
        for n in (first, first + 1)
    ]
    slope = 1 + sum(age * row[1] for age, row in enumerate(rows))
    coefficient = -missed[0] if first % 2 == 0 else -(missed[1] - slope * missed[0])
    return coefficient * (-1) ** ((first + 1) // 2)


def _explicit_imaginary(method: RungeKutta) -> float:
    """From |R(iy)|^2 - 1, a polynomial in y^2 whose powers up to the order vanish."""
    r = stability_polynomial(method)
    powers = np.arange(r.size)
    even, odd = np.zeros(r.size), np.zeros(r.size)
    even[::2] = (r * (-1.0) ** (powers // 2))[::2]
    odd[1::2] = (r * (-1.0) ** (powers // 2))[1::2]
    growth = np.convolve(even, even) + np.convolve(odd, odd)  # coefficients by rising powers of y
    growth[: method.order + 1] = 0.0
    magnitude = np.convolve(np.abs(even), np.abs(even)) + np.convolve(np.abs(odd), np.abs(odd))
    growth[np.abs(growth) < 1e-13 * magnitude] = 0.0
    present = np.flatnonzero(growth)
    if not present.size or growth[present[0]] > 0.0:
        return 0.0
    roots = np.roots(growth[present[0] : present[-1] + 1][::-1])
    real = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0.0)]
    return float(real.min())
