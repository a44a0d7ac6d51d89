"""What one step does to y' = lambda y: every method's stability function, and its limits on the axes.

Runge-Kutta methods multiply y by R(z), z = h lambda, R(z) = 1 + z b (I - z A)^-1 1 (Hairer, Wanner, *Solving
ODEs II*, section IV.3), a polynomial for an explicit one. An Adams method maps its history; the roots of its
characteristic polynomial (section V.1) take the place of R.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.arrays import Flags, Floats
from fastmech.integrators.methods import Adams, ImplicitRungeKutta, Method, RungeKutta

#: Ratio of neighbouring places of the search: finer than any lobe of a stability region.
RATIO = 1.03

#: Places that are looked at in one call.
AT_ONCE = 64

#: Divisions of an interval of that ratio by 17 after which it is as narrow as rounding.
PARTS, DIVISIONS = 17, 11


@cache
def stability_polynomial(method: RungeKutta) -> Floats:
    """Coefficients of R(z), powers rising, of an explicit method: b A^(k-1) 1, summed without rounding.

    Up to the method's order they are 1/k! but for the rounding of its coefficients.
    """
    rows = [[Fraction(w) for w in row] for row in method.tableau.a]
    weights = [Fraction(w) for w in method.tableau.b]
    stages = [Fraction(1)] * len(weights)
    coefficients = [Fraction(1)]
    for _ in weights:
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
    now = np.zeros(method.predictor.size)
    now[0] = 1.0
    weights = points * method.predictor + now
    if method.corrects:
        weights = points * (method.corrector[0] * weights + method.corrector[1:]) + now
    return np.asarray(weights)


def amplifies(method: Method, z: ArrayLike, factor: ArrayLike) -> Flags:
    """Whether a step multiplies small motions by more than ``factor`` > 0: quicker to tell than by how much.

    For an Adams method whether a root of the characteristic polynomial lies outside a circle of that radius.
    """
    if not isinstance(method, Adams):
        return np.asarray(~(np.abs(stability_function(method, z)) <= factor))  # too large for a number, too
    points = np.asarray(z, dtype=np.complex128)
    radius = np.asarray(np.broadcast_to(factor, points.shape), dtype=np.float64)[..., None]
    return _outside(history_row(method, points) * radius ** -np.arange(1.0, method.predictor.size + 1.0))


def _outside(weights: NDArray[np.complex128]) -> Flags:
    """Whether x^k - w_1 x^(k-1) - ... - w_k, of weights (..., k), has a root outside the unit circle.

    By Schur's recursion (Henrici, *Applied and Computational Complex Analysis I*, section 6.8): all roots lie
    inside if the last coefficient is smaller than the first, and if so do those of the polynomial of one
    degree less from which the last has been eliminated.
    """
    rest = -weights
    outside = np.zeros(rest.shape[:-1], dtype=np.bool_)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        while rest.shape[-1]:
            last, rest = rest[..., -1:], rest[..., :-1]
            size = (last * last.conj()).real
            outside |= ~(size[..., 0] < 1.0)
            rest = (rest - last * rest[..., ::-1].conj()) / (1.0 - size)
    return outside


def first_crossing(beyond: Callable[[Floats], Flags], start: float, stop: float) -> float:
    """Least x at which ``beyond`` turns true; 0.0 if so at ``start``, inf if not up to ``stop``.

    From places that grow by :data:`RATIO` it is narrowed down to rounding. ``beyond`` is asked of
    many places (m,) in one call: it pays to compute with arrays.
    """
    last = max(int(np.ceil(np.log(stop / start) / np.log(RATIO))), 0)
    for first in range(0, last + 1, AT_ONCE):
        places = start * RATIO ** np.arange(first, min(first + AT_ONCE, last + 1.0))
        found = np.flatnonzero(beyond(places))
        if found.size:
            at = float(places[found[0]])
            return 0.0 if first + found[0] == 0 else _narrowed(beyond, at / RATIO, at)
    return float("inf")


def _narrowed(beyond: Callable[[Floats], Flags], below: float, above: float) -> float:
    """Where it turns true between two places: in the first part whose end is beyond, again and again.

    Importing SciPy's root finders takes longer than a first run, and every run asks for a step limit.
    """
    for _ in range(DIVISIONS):
        places = below + (above - below) * np.arange(1, PARTS) / PARTS
        found = np.flatnonzero(beyond(places))
        first = int(found[0]) if found.size else places.size
        ends = [below, *places.tolist(), above]
        below, above = ends[first], ends[first + 1]
    return below
