"""Weights of the Adams formulas, computed exactly from their definition.

An Adams formula advances by the integral over one step of the polynomial that interpolates the derivative
at equidistant times (Hairer, Norsett, Wanner, *Solving ODEs I*, section III.1).
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import cache


def interpolatory_weights(nodes: Sequence[int]) -> list[Fraction]:
    """Weights of the quadrature over [0, 1] that is exact for polynomials of degree below ``len(nodes)``.

    The integral of each Lagrange polynomial on ``nodes`` (times in steps, relative to the step's start).
    """
    weights = []
    for node in nodes:
        polynomial, scale = [Fraction(1)], Fraction(1)  # coefficients by rising power
        for other in nodes:
            if other != node:
                scale *= node - other
                shifted, scaled = [Fraction(0), *polynomial], [other * c for c in (*polynomial, Fraction(0))]
                polynomial = [a - b for a, b in zip(shifted, scaled, strict=True)]
        integral = sum((c / (power + 1) for power, c in enumerate(polynomial)), Fraction(0))
        weights.append(integral / scale)
    return weights


@cache
def bashforth(order: int) -> tuple[Fraction, ...]:
    """Explicit formula: weights of f at t_n, t_(n-1), ..., t_(n-order+1)."""
    return tuple(interpolatory_weights(range(0, -order, -1)))


@cache
def moulton(order: int) -> tuple[Fraction, ...]:
    """Implicit formula: weights of f at t_(n+1), t_n, ..., t_(n-order+2)."""
    return tuple(interpolatory_weights(range(1, 1 - order, -1)))
