"""Eigenvalues of the small motion of many trajectories from two real quadratics, without LAPACK.

The damper acts on one body only, so that the characteristic polynomial lambda^4 + p3 lambda^3 + .. + p0
(paper, Table 4) is known in closed form. It is (lambda^2 + a lambda + b)(lambda^2 + c lambda + d), where
y = b + d is a root of Ferrari's resolvent y^3 - p2 y^2 + (p1 p3 - 4 p0) y - (p3^2 p0 + p1^2 - 4 p2 p0).
Without damper y = p2; light damping hardly moves it, strong damping makes the resolvent as good as linear:
Newton's method from p2 needs few steps for both. Where they are too few LAPACK finds the eigenvalues.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.mechanism.coefficients import Coefficients
from fastmech.step_limits.local import LocalMotion, eigenvalues, part, state_matrices

Floats = NDArray[np.float64]

#: Newton iterations for the resolvent, and the error of p2 that they may leave.
ITERATIONS, RESOLVED = 5, 1e-12

#: Relative difference of b and d below which a and c are too uncertain.
APART = 1e-3

#: Newton iterations that bring an eigenvalue to rounding, and the last one's relative size.
POLISH, POLISHED = 3, 1e-9


class Factors(NamedTuple):
    """The quadratics lambda^2 + a lambda + b, lambda^2 + c lambda + d of small motions (n,)."""

    a: Floats
    b: Floats
    c: Floats
    d: Floats
    found: NDArray[np.bool_]  #: whether the others are they, to nine digits or so


def factored(motion: LocalMotion) -> Factors:
    """The characteristic polynomials as products of two real quadratics."""
    p3, p2, p1, p0, _ = motion
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        linear = p1 * p3 - 4.0 * p0
        constant = p3 * p3 * p0 + p1 * p1 - 4.0 * p2 * p0
        y = p2
        for _ in range(ITERATIONS):
            less = y - p2
            product = less * y + linear
            y = y - (product * y - constant) / (product + y * (less + y))
        b = 0.5 * (y + np.copysign(np.sqrt(y * y - 4.0 * p0), y))
        d = p0 / b
        difference = d - b
        a, c = (p1 - p3 * b) / difference, (p3 * d - p1) / difference
        product, size = a * c, np.abs(b) + np.abs(d)
        missed = np.abs(b + d + product - p2)
        found = (missed <= RESOLVED * (size + np.abs(product))) & (np.abs(difference) > APART * size)
    return Factors(a, b, c, d, found)


def decaying_modes(
    c: Coefficients,
    states: Floats,
    motion: LocalMotion,
    least: float,
    asked: Callable[[NDArray[np.int64], NDArray[np.complex128]], NDArray[np.bool_]],
) -> tuple[NDArray[np.int64], NDArray[np.complex128]]:
    """Modes of the small motion at states (n, 4) that decay by more than ``least`` a radian.

    Args:
        c: reduced coefficients.
        states: where.
        motion: the small motion there.
        least: what is as good as no decay.
        asked: tells of which states, with which eigenvalues, modes are wanted; told to about nine digits.

    Returns:
        which of the states has each, and its eigenvalue [1/s]; of conjugate ones that above the real axis.
    """
    factors = factored(motion)
    lanes: list[NDArray[np.int64]] = []
    found: list[NDArray[np.complex128]] = []
    for slope, offset in ((factors.a, factors.b), (factors.c, factors.d)):
        with np.errstate(invalid="ignore"):
            middle, square = -0.5 * slope, 0.25 * slope * slope - offset
            pair, real = (np.flatnonzero(factors.found & which) for which in (square < 0.0, square >= 0.0))
        lanes += [pair, real, real]
        found.append(middle[pair] + 1j * np.sqrt(-square[pair]))
        farther = middle[real] + np.copysign(np.sqrt(square[real]), middle[real])
        nearer = np.divide(offset[real], farther, out=np.zeros(real.size), where=farther != 0.0)
        found += [farther.astype(np.complex128), nearer.astype(np.complex128)]
    lane, values = np.concatenate(lanes), np.concatenate(found)
    some = (values.real < -0.5 * least * np.abs(values)) & asked(lane, values)
    lane, values = lane[some], values[some]
    values, sure = _polished(motion, lane, values)
    fails = ~factors.found
    fails[lane[~sure]] = True
    if fails.any():
        keep, rest = ~fails[lane], np.flatnonzero(fails)
        exact = eigenvalues(state_matrices(part(c, rest), *states[rest, :2].T)).ravel()
        lane, values = np.append(lane[keep], np.repeat(rest, 4)), np.append(values[keep], exact)
    decays = (values.real < -least * np.abs(values)) & (values.imag >= 0.0)
    return lane[decays], values[decays]


def _polished(
    motion: LocalMotion, lane: NDArray[np.int64], values: NDArray[np.complex128]
) -> tuple[NDArray[np.complex128], NDArray[np.bool_]]:
    """Eigenvalues after Newton iterations for the polynomials of their states, and whether they are exact."""
    p3, p2, p1, p0 = (p[lane] for p in motion[:4])
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        move = np.zeros_like(values)
        for _ in range(POLISH):
            first = values + p3
            second = first * values + p2
            third = second * values + p1
            slope = ((values + first) * values + second) * values + third
            rest = third * values + p0
            move = np.where(rest == 0.0, 0.0, rest / slope)
            values = values - move
        return values, np.abs(move) <= POLISHED * np.abs(values)
