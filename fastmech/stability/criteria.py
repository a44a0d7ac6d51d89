"""Three criteria of stability, each with its verdict, its reason and its own rounding bound.

Lagrange-Dirichlet with Sylvester's minors looks at U alone, Hurwitz at the characteristic polynomial, and
the eigenvalues at the state matrix. Each says "critical" where rounding hides the sign that it needs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from fastmech.stability.linearize import FloatArray, SmallMotion, polynomial

EPS = float(np.finfo(np.float64).eps)

#: Relative rounding of a quantity made from the coefficients in some ten operations, each within EPS/2.
ROUNDING = 16.0 * EPS

Verdict = Literal["asymptotically stable", "stable", "unstable", "critical"]


@dataclass(frozen=True)
class Finding:
    """What one criterion says and why."""

    verdict: Verdict
    reason: str


@dataclass(frozen=True, eq=False)
class Bounded:
    """Numbers with bounds on their errors, entry by entry."""

    value: FloatArray
    error: FloatArray

    @property
    def positive(self) -> NDArray[np.bool_]:
        """Positive beyond the bound."""
        return self.value > self.error

    @property
    def negative(self) -> NDArray[np.bool_]:
        """Negative beyond the bound."""
        return self.value < -self.error


def minors(s: SmallMotion, stiffness_error: float) -> Bounded:
    """Sylvester's leading minors of K, reduced [1/s^2, 1/s^4]; ``stiffness_error`` bounds each entry's."""
    e = stiffness_error
    values = np.array([s.k11, s.k11 * s.k22 - s.k12 * s.k12])
    size = abs(s.k11 * s.k22) + s.k12 * s.k12
    cross = e * (abs(s.k11) + abs(s.k22) + 2.0 * abs(s.k12) + 2.0 * e)
    return Bounded(values, np.array([e, cross + ROUNDING * size]))


def sylvester(minor: Bounded) -> Finding:
    """Lagrange-Dirichlet: a minimum of U is stable; a negative direction of U is unstable by second order."""
    first, second = minor.value
    if minor.positive.all():
        return Finding("stable", "both leading minors of the Hessian are positive: U has a minimum")
    if minor.negative[1]:
        return Finding("unstable", "the Hessian's determinant is negative: U has a saddle")
    if minor.positive[1] and first < 0.0:
        return Finding("unstable", "the Hessian is negative definite: U has a maximum")
    return Finding(
        "critical", f"the Hessian is singular within rounding: its determinant is {second:.2g} 1/s^4"
    )


def characteristic(s: SmallMotion, stiffness_error: float) -> Bounded:
    """(p3, p2, p1, p0) of the monic characteristic polynomial with error bounds.

    The damping coefficient counts as known to the rounding of the motion's own rate: a damping of less
    than ROUNDING per radian cannot be told from none in double precision.
    """
    p3, p2, p1, p0 = polynomial(s)
    size = (abs(s.k11) + s.m11 * abs(s.k22) + 2.0 * abs(s.s12 * s.k12)) / s.determinant
    e2 = stiffness_error * (1.0 + s.m11 + 2.0 * abs(s.s12)) / s.determinant + ROUNDING * size
    e3 = ROUNDING * (p3 + np.sqrt(size))
    e1 = e3 * abs(s.k22) + p3 * stiffness_error
    e0 = minors(s, stiffness_error).error[1] / s.determinant + ROUNDING * abs(p0)
    return Bounded(np.array([p3, p2, p1, p0]), np.array([e3, e2, e1, e0]))


def hurwitz_determinants(p: Bounded) -> Bounded:
    """D1 .. D4 of lambda^4 + p3 lambda^3 + p2 lambda^2 + p1 lambda + p0 with first-order error bounds."""
    p3, p2, p1, p0 = p.value
    e3, e2, e1, e0 = p.error
    a3, a2, a1, a0 = np.abs(p.value)
    d2 = p3 * p2 - p1
    d3 = p1 * d2 - p3 * p3 * p0
    error2 = e3 * a2 + e2 * a3 + e1 + ROUNDING * (a3 * a2 + a1)
    error3 = e1 * abs(d2) + a1 * error2 + 2.0 * a3 * e3 * a0 + a3 * a3 * e0 + ROUNDING * a3 * a3 * a0
    error4 = e0 * abs(d3) + a0 * error3
    return Bounded(np.array([p3, d2, d3, p0 * d3]), np.array([e3, error2, error3, error4]))


def hurwitz(p: Bounded, d: Bounded) -> Finding:
    """Hurwitz: all determinants positive means that every root has a negative real part."""
    if d.positive.all():
        return Finding("asymptotically stable", "all four Hurwitz determinants are positive")
    if p.negative.any():
        name = ("p3", "p2", "p1", "p0")[int(np.argmax(p.negative))]
        return Finding("unstable", f"the coefficient {name} is negative: a root has a positive real part")
    if d.negative[:3].any():
        name = f"D{int(np.argmax(d.negative)) + 1}"
        return Finding("unstable", f"the Hurwitz determinant {name} is negative")
    name = f"D{int(np.argmin(d.positive)) + 1}"
    return Finding(
        "critical", f"the Hurwitz determinant {name} is zero within rounding: a root is on the axis"
    )


def eigenvalues(
    matrix: FloatArray, rate: float, stiffness_error: float
) -> tuple[NDArray[np.complex128], FloatArray]:
    """Eigenvalues of the state matrix, largest real part first, with an error bound for each [1/s].

    ``rate`` [1/s] makes positions and velocities comparable. A simple eigenvalue moves by its condition
    number times the change of the matrix; Elsner's bound holds for any, and the smaller one is taken.
    """
    scale = np.array([1.0, 1.0, rate, rate])
    balanced = matrix * scale / scale[:, None]
    values, left, right = linalg.eig(balanced, left=True, right=True)
    norm = float(np.linalg.norm(balanced, 2))
    change = ROUNDING * norm + 2.0 * stiffness_error / rate
    overlap = np.abs(np.sum(left.conj() * right, axis=0))
    with np.errstate(divide="ignore"):
        error = np.minimum(change / overlap, (2.0 * norm + change) ** 0.75 * change**0.25)
    order = np.lexsort((-values.imag, -values.real))
    return values[order], error[order]


def spectrum(values: NDArray[np.complex128], error: FloatArray) -> Finding:
    """Stability by the signs of the eigenvalues' real parts."""
    real = values.real
    unstable = int(np.count_nonzero(real > error))
    if unstable:
        verb = "has" if unstable == 1 else "have"
        return Finding("unstable", f"{unstable} of the four eigenvalues {verb} a positive real part")
    if (real < -error).all():
        return Finding("asymptotically stable", "every eigenvalue has a negative real part")
    critical = int(np.count_nonzero(real >= -error))
    verb = "is" if critical == 1 else "are"
    return Finding(
        "critical", f"{critical} of the four eigenvalues {verb} on the imaginary axis within rounding"
    )
