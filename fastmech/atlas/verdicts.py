"""The three criteria of ``fastmech.stability.criteria`` for compiled maps: codes instead of sentences.

The formulas and error bounds are those of ``criteria``, written for scalars; tests hold the two together.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from fastmech.equilibria.balance import EPS
from fastmech.jit import inlined
from fastmech.stability.linearize import SmallMotion

Floats = NDArray[np.float64]

ROUNDING = 16.0 * EPS


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


@inlined
def sylvester_code(s: SmallMotion, e: float) -> tuple[int, float]:
    """Lagrange-Dirichlet's verdict and the error of the second minor; ``e`` bounds each entry's error."""
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
    return CRITICAL, error


@inlined
def coefficient_errors(
    s: SmallMotion, p: tuple[float, float, float, float], e: float, minor_error: float
) -> tuple[float, float, float, float]:
    """Bounds on the errors of (p3, p2, p1, p0)."""
    p3, _, _, p0 = p
    size = (abs(s.k11) + s.m11 * abs(s.k22) + 2.0 * abs(s.s12 * s.k12)) / s.determinant
    e3 = ROUNDING * (p3 + np.sqrt(size))
    return (
        e3,
        e * (1.0 + s.m11 + 2.0 * abs(s.s12)) / s.determinant + ROUNDING * size,
        e3 * abs(s.k22) + p3 * e,
        minor_error / s.determinant + ROUNDING * abs(p0),
    )


@inlined
def hurwitz_code(p: tuple[float, float, float, float], e: tuple[float, float, float, float]) -> int:
    """Hurwitz's verdict from the coefficients and their errors."""
    p3, p2, p1, p0 = p
    e3, e2, e1, e0 = e
    a3, a2, a1, a0 = abs(p3), abs(p2), abs(p1), abs(p0)
    d2 = p3 * p2 - p1
    d3 = p1 * d2 - p3 * p3 * p0
    error2 = e3 * a2 + e2 * a3 + e1 + ROUNDING * (a3 * a2 + a1)
    error3 = e1 * abs(d2) + a1 * error2 + 2.0 * a3 * e3 * a0 + a3 * a3 * e0 + ROUNDING * a3 * a3 * a0
    error4 = e0 * abs(d3) + a0 * error3
    if p3 > e3 and d2 > error2 and d3 > error3 and p0 * d3 > error4:
        return ASYMPTOTIC
    if p3 < -e3 or p2 < -e2 or p1 < -e1 or p0 < -e0 or d2 < -error2 or d3 < -error3:
        return UNSTABLE
    return CRITICAL


@inlined
def spectrum_code(
    roots: NDArray[np.complex128],
    p: tuple[float, float, float, float],
    e: tuple[float, float, float, float],
) -> int:
    """Verdict by the signs of the eigenvalues' real parts.

    An eigenvalue at which the polynomial may be off by h is within 4 h/|P'| and within h^(1/4) of a true one.
    """
    settled = True
    for root in roots:
        r = np.sqrt(root.real * root.real + root.imag * root.imag)
        h = e[3] + r * (e[2] + r * (e[1] + r * e[0]))
        h += ROUNDING * (abs(p[3]) + r * (abs(p[2]) + r * (abs(p[1]) + r * (abs(p[0]) + r))))
        derivative = p[2] + root * (2.0 * p[1] + root * (3.0 * p[0] + root * 4.0))
        slope = np.sqrt(derivative.real * derivative.real + derivative.imag * derivative.imag)
        error = np.sqrt(np.sqrt(h))
        if slope > 0.0:
            error = min(error, 4.0 * h / slope)
        if root.real > error:
            return UNSTABLE
        if root.real >= -error:
            settled = False
    return ASYMPTOTIC if settled else CRITICAL
