"""Coefficients of the printed formulas (16) and (20), found from the mechanism's functions.

A formula that is a sum of known functions of the angles times unknown numbers is fitted at many angles; if
the functions are the right ones nothing is left over, and the numbers are exact to rounding.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.mechanism.lagrange import metric, potential_energy, potential_gradient
from fastmech.paper.compare import Printed, evaluate
from fastmech.scene import Scene

Floats = NDArray[np.float64]
Terms = list[dict[str, str]]

#: The term of the denominator of (16) whose coefficient is free.
FREE = "cos(4*phi)"


class Fit(NamedTuple):
    """Coefficients of a sum of terms and what it cannot represent."""

    coefficients: Floats
    residual: float  #: largest remainder over the largest value


def sample_angles(count: int = 400) -> Floats:
    """Angles spread over the torus, shape (count, 2)."""
    return np.random.default_rng(16).uniform(-np.pi, np.pi, (count, 2))


def term_values(terms: Terms, q: Floats) -> Floats:
    """The factors of ``terms`` at the angles ``q`` (n, 2), shape (n, terms)."""
    values = np.empty((len(q), len(terms)))
    for i, term in enumerate(terms):
        values[:, i] = evaluate(term["factor"], phi=q[:, 0], theta=q[:, 1])
    return values


def printed_sum(terms: Terms, q: Floats) -> Floats:
    """Sum of ``terms`` with their printed values."""
    return np.asarray(term_values(terms, q) @ np.array([float(term["value"]) for term in terms]))


def fit(terms: Terms, q: Floats, values: Floats) -> Fit:
    """Least-squares coefficients of ``terms`` for ``values`` (n,) at ``q`` (n, 2)."""
    return _fit(term_values(terms, q), values)


def _fit(basis: Floats, values: Floats) -> Fit:
    coefficients = np.asarray(np.linalg.lstsq(basis, values, rcond=None)[0], dtype=np.float64)
    remainder = np.max(np.abs(basis @ coefficients - values))
    return Fit(coefficients, float(remainder / np.max(np.abs(values))))


class Hamiltonian(NamedTuple):
    """(16) in its parts: each a fit in the order of the printed terms."""

    potential: Fit
    p_phi_2: Fit
    p_theta_2: Fit
    p_phi_p_theta: Fit
    outside: Floats  #: the denominator's coefficients
    inside: Floats
    residual_as_printed: float  #: what a denominator of the printed shape leaves over, at best
    residual_corrected: float  #: the same with the bracket closed after the last term


def hamiltonian_16(scene: Scene, equation: Printed) -> Hamiltonian:
    """Exact coefficients of (16) once the inner bracket of its denominator is closed after the last term.

    Numerators and denominator are determined up to a common factor; the paper's makes the denominator
    ``-(4 - sin^2 phi) det(a)/(m2 l^4)``. As cos 4 phi is a polynomial in sin^2 phi, its coefficient is free:
    it is taken as printed, and then all others are unique.
    """
    q = sample_angles()
    a = metric(scene, q)
    scale = -(4.0 - np.sin(q[:, 0]) ** 2) / (scene.m2 * scene.l**4)
    shape = equation["denominator"]
    outside: Terms = shape["outside"]
    taken = np.array([term["factor"] == FREE for term in outside])
    values = np.array([float(term["value"]) if term["factor"] == FREE else 0.0 for term in outside])
    functions = term_values(outside, q)
    rest = scale * np.linalg.det(a) - functions @ values
    square = np.sin(q[:, 0, None]) ** 2
    first = [functions[:, ~taken], square * term_values(shape["inside"], q)]
    after = term_values(shape["after"], q)
    corrected = _fit(np.hstack([*first, square * after]), rest)
    count = int(np.sum(~taken))
    values[~taken] = corrected.coefficients[:count]
    return Hamiltonian(
        potential=fit(equation["potential"], q, potential_energy(scene, q)),
        p_phi_2=fit(equation["p_phi_2"], q, scale * a[:, 1, 1] / 2.0),
        p_theta_2=fit(equation["p_theta_2"], q, scale * a[:, 0, 0] / 2.0),
        p_phi_p_theta=fit(equation["p_phi_p_theta"], q, -scale * a[:, 0, 1]),
        outside=values,
        inside=corrected.coefficients[count:],
        residual_as_printed=_fit(np.hstack([*first, after]), rest).residual,
        residual_corrected=corrected.residual,
    )


def printed_kinetic(equation: Printed, q: Floats, p: Floats, *, corrected: bool) -> Floats:
    """Kinetic part of (16) with its printed coefficients at ``q``, ``p`` (n, 2) [J].

    ``corrected`` closes the inner bracket of the denominator after the last term.
    """
    shape = equation["denominator"]
    square = np.sin(q[:, 0]) ** 2
    inside, after = printed_sum(shape["inside"], q), printed_sum(shape["after"], q)
    inner = square * (inside + after) if corrected else square * inside + after
    numerator = (
        p[:, 0] ** 2 * printed_sum(equation["p_phi_2"], q)
        + p[:, 1] ** 2 * printed_sum(equation["p_theta_2"], q)
        + p[:, 0] * p[:, 1] * printed_sum(equation["p_phi_p_theta"], q)
    )
    return np.asarray(numerator / (printed_sum(shape["outside"], q) + inner))


def equilibrium_20(scene: Scene, equation: Printed) -> dict[str, Fit]:
    """Exact coefficients of both conditions (20), by angle; the scene has the constant force."""
    q = sample_angles()
    gradient = potential_gradient(scene, q, scene.F0)
    return {angle: fit(equation[angle], q, gradient[:, i]) for i, angle in enumerate(("phi", "theta"))}
