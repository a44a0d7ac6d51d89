"""One compiled call from equilibria to all that stability asks of them, for many scenes in a row."""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.atlas.quartic import factor, quadratic, sort_roots
from fastmech.atlas.verdicts import (
    ASYMPTOTIC,
    ROUNDING,
    STABLE,
    coefficient_errors,
    hurwitz_code,
    spectrum_code,
    sylvester_code,
)
from fastmech.jit import CUBE, MATRIX, STATUSES, inlined, kernel
from fastmech.stability.linearize import SmallMotion, fill_state_matrix, polynomial, small_motion

Floats = NDArray[np.float64]
Codes = NDArray[np.int8]

ROOTS = types.Array(types.complex128, 3, "C")
VERDICTS = types.Array(types.int8, 3, "C")


#: Imaginary part of a real eigenvalue that rounding explains, relative to the largest eigenvalue.
REAL = 64 * 2.0**-52


@inlined
def squares(s: SmallMotion) -> tuple[float, float]:
    """Squares of the undamped natural frequencies [1/s^2], rising; see ``modes.squared_frequencies``."""
    r = np.sqrt(s.determinant)
    h12 = (s.k12 - s.s12 * s.k22) / r
    h11 = (s.k11 - 2.0 * s.s12 * s.k12 + s.s12 * s.s12 * s.k22) / s.determinant
    mean, half = 0.5 * (h11 + s.k22), 0.5 * (h11 - s.k22)
    spread = np.hypot(half, h12)
    larger = mean + np.copysign(spread, mean)
    product = (s.k11 * s.k22 - s.k12 * s.k12) / s.determinant
    smaller = product / larger if larger != 0.0 else 0.0
    return min(larger, smaller), max(larger, smaller)


@inlined
def decay_rate(
    s: SmallMotion, spring: float, low: float, high: float, p3: float, p1: float, p0: float
) -> float:
    """Rate [1/s] of the mode that the damper reaches least; see ``modes.slowest_decay``."""
    split = high - low
    if not split > 0.0 or p3 == 0.0:
        return 0.0
    product = (s.s12 * (spring - s.k22)) ** 2 / s.determinant
    if p3 * p3 > high:
        return min(p3 * product / (2.0 * (split * split + p3 * p3 * s.k22)), p0 / p1)
    below, above = s.k22 - low, high - s.k22
    if below < above:
        below = product / above
    else:
        above = product / below
    return min(
        p3 * below * split / (2.0 * (split * split + p3 * p3 * low)),
        p3 * above * split / (2.0 * (split * split + p3 * p3 * high)),
    )


@inlined
def motion_roots(
    s: SmallMotion,
    p: tuple[float, float, float, float],
    low: float,
    high: float,
    matrix: NDArray[np.complex128],
    roots: NDArray[np.complex128],
) -> None:
    """Write the four eigenvalues [1/s], largest real part first; ``matrix`` (4, 4) is for working in.

    Newton's method starts from the undamped factors, or from those of strong damping (one fast root, one
    slow one, and an oscillation with phi held); where it fails, as at a double pair, LAPACK takes over.
    """
    p3, p2, p1, p0 = p
    if p3 * p3 > 4.0 * abs(high) and s.k22 != 0.0:
        a, b, c, d, exact = factor(p3, p2, p1, p0, p3, p0 / s.k22, 0.0, s.k22)
    else:
        share = (s.k22 - low) / (high - low)
        a, b, c, d, exact = factor(p3, p2, p1, p0, p3 * (1.0 - share), low, p3 * share, high)
    if exact:
        roots[0], roots[1] = quadratic(a, b)
        roots[2], roots[3] = quadratic(c, d)
    else:
        real = matrix.real.copy()
        fill_state_matrix(s, real)
        matrix[:] = real
        roots[:] = np.linalg.eigvals(matrix)
        # The matrix is real: an imaginary part as small as rounding is none.
        noise = REAL * np.abs(roots).max()
        for k in range(4):
            if abs(roots[k].imag) <= noise:
                roots[k] = roots[k].real
    sort_roots(roots)


@kernel(types.void(MATRIX, MATRIX, MATRIX, MATRIX, STATUSES, CUBE, ROOTS, MATRIX, MATRIX, VERDICTS))
def assess(
    coefficients: Floats,
    phi: Floats,
    theta: Floats,
    radius: Floats,
    count: Codes,
    hessian: Floats,
    eigenvalues: NDArray[np.complex128],
    frequency: Floats,
    decay: Floats,
    verdict: Codes,
) -> None:
    """Stability of the first ``count`` equilibria of every row; the other slots get NaN and -1.

    Args:
        coefficients: (n, 8) rows of ``fastmech.mechanism.coefficients.Coefficients``, the force frozen.
        phi, theta, radius: (n, slots) from ``fastmech.equilibria.solve.solve``.
        count: (n,).
        hessian: (n, slots, 3) second derivatives of U over m2 l^2 (phi phi, phi theta, theta theta); written.
        eigenvalues: (n, slots, 4) [1/s], largest real part first; written.
        frequency: (n, slots) lowest undamped natural frequency [rad/s], NaN where U falls; written.
        decay: (n, slots) decay rate of the slowest mode [1/s], NaN unless U has a minimum; written.
        verdict: (n, slots, 4) Sylvester's, Hurwitz's, the eigenvalues' and the joint ``Verdict``; written.
    """
    matrix = np.zeros((4, 4), dtype=np.complex128)
    for row in range(coefficients.shape[0]):
        mass, slider, lift, spring, gravity, force, damping, _ = coefficients[row]
        loads = abs(lift) + (mass + 2.0) * gravity + 2.0 * spring + 2.0 * abs(force)
        for i in range(count[row], phi.shape[1]):
            hessian[row, i], eigenvalues[row, i], verdict[row, i] = np.nan, complex(np.nan, np.nan), -1
            frequency[row, i], decay[row, i] = np.nan, np.nan
        for i in range(count[row]):
            s = small_motion(phi[row, i], theta[row, i], mass, slider, lift, spring, gravity, force, damping)
            hessian[row, i, 0], hessian[row, i, 1], hessian[row, i, 2] = s.k11, s.k12, s.k22
            p = polynomial(s)
            low, high = squares(s)
            roots = eigenvalues[row, i]
            motion_roots(s, p, low, high, matrix, roots)
            # Third derivatives of U are at most 2 loads, so an angle's error changes the Hessian by no more.
            e = loads * (ROUNDING + 2.0 * min(radius[row, i], 1.0))
            by_minors, minor_error = sylvester_code(s, e)
            errors = coefficient_errors(s, p, e, minor_error)
            by_spectrum = spectrum_code(roots, p, errors)
            frequency[row, i] = np.sqrt(low) if low >= 0.0 else np.nan
            decay[row, i] = np.nan
            joint = by_minors
            if by_minors == STABLE:
                if by_spectrum == ASYMPTOTIC:
                    decay[row, i] = -roots[0].real
                else:
                    decay[row, i] = decay_rate(s, spring, low, high, p[0], p[2], p[3])
                if damping > 0.0:
                    joint = ASYMPTOTIC
            verdict[row, i, 0], verdict[row, i, 1] = by_minors, hurwitz_code(p, errors)
            verdict[row, i, 2], verdict[row, i, 3] = by_spectrum, joint
