"""What one step does to y' = lambda y: the stability function of every method, from its own coefficients.

Runge-Kutta methods multiply y by R(z), z = h lambda, R(z) = 1 + z b (I - z A)^-1 1 (Hairer, Wanner, *Solving
ODEs II*, section IV.3), a polynomial for an explicit one. An Adams method maps its history; the roots of its
characteristic polynomial (section V.1) take the place of R.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.integrators.implicit_method import ImplicitRungeKutta
from fastmech.integrators.method import Adams, Method, RungeKutta

Floats = NDArray[np.float64]

#: Newton iterations to a root that is near, and the last one's relative size.
NEWTON, CONVERGED = 10, 1e-10


def stability_polynomial(method: RungeKutta) -> Floats:
    """Coefficients of R(z), powers rising, of an explicit method: b A^(k-1) 1, summed without rounding.

    Up to the method's order they are 1/k! but for the rounding of its coefficients.
    """
    return _polynomial(tuple(map(tuple, method.tableau.a)), tuple(method.tableau.b))


@cache
def _polynomial(a: tuple[tuple[float, ...], ...], b: tuple[float, ...]) -> Floats:
    rows, weights = [[Fraction(w) for w in row] for row in a], [Fraction(w) for w in b]
    stages = [Fraction(1)] * len(b)
    coefficients = [Fraction(1)]
    for _ in range(len(b)):
        coefficients.append(sum((w * s for w, s in zip(weights, stages, strict=True)), Fraction(0)))
        stages = [sum((w * s for w, s in zip(row, stages, strict=False)), Fraction(0)) for row in rows]
    return np.array([float(c) for c in coefficients])


def stability_function(method: Method, z: ArrayLike) -> NDArray[np.complex128]:
    """R(z) of a Runge-Kutta method, of the shape of ``z``."""
    points = np.asarray(z, dtype=np.complex128)
    if isinstance(method, RungeKutta):
        return np.asarray(np.polynomial.polynomial.polyval(points, stability_polynomial(method)))
    if not isinstance(method, ImplicitRungeKutta):
        raise TypeError(f"{method.name} is no Runge-Kutta method")
    stages = method.tableau.stages
    # R = det(I - zA + z 1 b) / det(I - zA) in the form that loses nothing far out.
    scaled = points[..., None, None]
    matrix = np.eye(stages) - scaled * method.tableau.matrix
    numerator = matrix + scaled * np.array(method.tableau.b)
    return np.asarray(np.linalg.det(numerator) / np.linalg.det(matrix))


def history_row(method: Adams, z: ArrayLike) -> NDArray[np.complex128]:
    """Weights (..., k) of the history (y_n, y_(n-1), ...) of y' = lambda y in the next y."""
    points = np.asarray(z, dtype=np.complex128)[..., None]
    corrector = method.corrector
    row = points * method.predictor
    row[..., 0] += 1.0
    if method.corrects:
        row = points * corrector[0] * row + points * corrector[1:]
        row[..., 0] += 1.0
    return row


def principal_root(method: Adams, z: ArrayLike) -> NDArray[np.complex128]:
    """The root for exp(z), of the shape of ``z``, by Newton's method from there; NaN: none is near."""
    points = np.asarray(z, dtype=np.complex128)
    row = history_row(method, points)
    descending = np.moveaxis(np.concatenate([np.ones((*row.shape[:-1], 1)), -row], axis=-1), -1, 0)
    rising, degree = descending[::-1], descending.shape[0] - 1
    slope = rising[1:] * np.arange(1.0, degree + 1.0).reshape(-1, *(1,) * points.ndim)
    root = np.exp(points)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        for _ in range(NEWTON):
            move = _values(rising, root) / _values(slope, root)
            root = root - move
        return np.where(np.abs(move) < CONVERGED * np.abs(root), root, np.nan)


def _values(rising: NDArray[np.complex128], at: NDArray[np.complex128]) -> NDArray[np.complex128]:
    return np.asarray(np.polynomial.polynomial.polyval(at, rising, tensor=False))


def companion(method: Adams, z: ArrayLike) -> NDArray[np.complex128]:
    """The matrices (..., k, k) that take the history (y_n, y_(n-1), ...) of y' = lambda y one step on."""
    row = history_row(method, z)
    size = row.shape[-1]
    matrices = np.tile(np.eye(size, k=-1, dtype=np.complex128), (*row.shape[:-1], 1, 1))
    matrices[..., 0, :] = row
    return matrices


def amplification(method: Method, z: ArrayLike) -> Floats:
    """Factor by which a step multiplies small motions: |R(z)|, or the history map's spectral radius."""
    if not isinstance(method, Adams):
        return np.abs(stability_function(method, z))
    return np.asarray(np.abs(np.linalg.eigvals(companion(method, z))).max(axis=-1))


def amplifies(method: Method, z: ArrayLike, factor: ArrayLike) -> NDArray[np.bool_]:
    """Whether a step multiplies small motions by more than ``factor`` > 0: quicker to tell than by how much.

    For an Adams method whether a root of the characteristic polynomial lies outside the circle of that
    radius, by Schur's recursion (Henrici, *Applied and Computational Complex Analysis I*, section 6.8): the
    polynomial has all roots inside the unit circle if its last coefficient is smaller than its first, and the
    polynomial of one degree less that eliminates the last has them too.
    """
    if not isinstance(method, Adams):
        return np.asarray(~(np.abs(stability_function(method, z)) <= factor))  # too large for a number, too
    row = np.moveaxis(history_row(method, z), -1, 0)  # coefficients first: arrays of many points are quicker
    degree, points = len(row), row.shape[1:]
    scale = 1.0 / np.asarray(factor, dtype=np.float64)
    coefficients = np.empty((degree, *points), dtype=np.complex128)  # all but the first, which is 1
    shrunk = -np.ones_like(scale)
    for age in range(degree):
        shrunk = shrunk * scale
        coefficients[age] = row[age] * shrunk
    outside = np.zeros(points, dtype=np.bool_)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):  # of those already found outside
        for _ in range(degree):
            last, rest = coefficients[-1], coefficients[:-1]
            size = last.real * last.real + last.imag * last.imag
            outside |= ~(size < 1.0)
            coefficients = (rest - last * rest[::-1].conj()) * (1.0 / (1.0 - size))
    return outside
