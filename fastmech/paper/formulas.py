"""Evidence about wrongly printed formulas: print and correction evaluated along the paper's motion.

A formula that is a sum of known functions of the angles times unknown numbers is fitted at many angles; if
the functions are the right ones nothing is left over, and the numbers are exact to rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from fastmech.arrays import Floats
from fastmech.ensembles.balance import EnergyBalance
from fastmech.mechanism.geometry import positions, velocities
from fastmech.mechanism.hamilton import hamiltonian, momenta, rates
from fastmech.mechanism.lagrange import (
    angular_accelerations,
    christoffel,
    generalized_forces,
    metric,
    potential_energy,
    potential_gradient,
)
from fastmech.paper.compare import Printed, evaluate
from fastmech.paper.compute import PAPER_SCENE, START
from fastmech.scene import Scene

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


#: Angles over a turn, and time [s] of the deviation.
ANGLES, FIRST = 256, 1.0


class Measure(NamedTuple):
    """How wrong an expression is, along the paper's motion."""

    about: str
    unit: str
    tolerance: float  #: what rounding explains
    of: Callable[[str, EnergyBalance], float]


def _largest(values: Floats) -> float:
    return float(np.max(np.abs(values)))


def _names(y: Floats, scale: float = 1.0) -> dict[str, Any]:
    """The paper's quantities at states ``y`` (n, 4), with lengths in units of 1/scale m."""
    scene = PAPER_SCENE.model_dump()
    scene["l"], scene["g"] = scene["l"] * scale, scene["g"] * scale
    points = {name: value * scale for name, value in positions(PAPER_SCENE, y)._asdict().items()}
    angles = dict(zip(("phi", "theta", "phi_dot", "theta_dot"), y.T, strict=True))
    return {**scene, **points, **angles}


def _residual(expression: str, motion: EnergyBalance) -> float:
    return _largest(evaluate(expression, **_names(motion.y)))


def _kinetic(expression: str, motion: EnergyBalance) -> float:
    scene, v = PAPER_SCENE, velocities(PAPER_SCENE, motion.y)
    true = 0.5 * (scene.m1 * (v.x1**2 + v.y1**2) + scene.m2 * (v.x2**2 + v.y2**2) + scene.m3 * v.x3**2)
    return _largest(evaluate(expression, **_names(motion.y)) - true)


def _imbalance(expression: str, motion: EnergyBalance) -> float:
    energy = motion.kinetic + evaluate(expression, **_names(motion.y))
    return _largest(energy - energy[0] - (motion.work_damper + motion.work_force))


def _change_of_units(expression: str, motion: EnergyBalance) -> float:
    metres, centimetres = (evaluate(expression, **_names(motion.y, scale)) for scale in (1.0, 100.0))
    return _largest(centimetres / 100.0**2 - metres)


def _christoffel(expression: str, motion: EnergyBalance) -> float:
    phi = 2.0 * np.pi * np.arange(ANGLES) / ANGLES
    a11 = metric(PAPER_SCENE, np.stack([phi, np.zeros(ANGLES)], axis=-1))[:, 0, 0]
    # a11 is analytic and periodic: its Fourier series differentiates it to rounding.
    waves = np.fft.rfft(a11) * 1j * np.arange(ANGLES // 2 + 1)
    return _largest(
        evaluate(expression, **PAPER_SCENE.model_dump(), phi=phi) - 0.5 * np.fft.irfft(waves, ANGLES)
    )


def _canonical(expression: str, motion: EnergyBalance) -> float:
    q, p = motion.y[:, :2], momenta(PAPER_SCENE, motion.y)
    return _largest(_evaluated_rates(expression, q, p, motion.t) - _momentum_rates(motion.y, motion.t))


def _deviation(expression: str, motion: EnergyBalance) -> float:
    inside = motion.t[motion.t <= FIRST]

    def rhs(t: float, state: Floats) -> Floats:
        now, momentum = state[None, :2], state[None, 2:]
        slope = _evaluated_rates(expression, now, momentum, np.array([t]))
        return np.concatenate([rates(PAPER_SCENE, now, momentum)[0], slope[0]])

    start = np.concatenate([START[:2], momenta(PAPER_SCENE, START)])
    run = solve_ivp(rhs, (0.0, inside[-1]), start, "DOP853", inside, rtol=1e-9, atol=1e-9)
    return _largest(run.y[:2].T - motion.y[: inside.size, :2])


def _momentum_rates(y: Floats, t: Floats) -> Floats:
    """d/dt (a q') along a motion (n, 4) from Lagrange's accelerations; the symbols (12) give da/dq [N m]."""
    gamma = christoffel(PAPER_SCENE, y[:, :2])
    change = gamma + gamma.swapaxes(1, 2)
    inertia = np.einsum("nij,nj->ni", metric(PAPER_SCENE, y[:, :2]), angular_accelerations(PAPER_SCENE, y, t))
    return np.asarray(inertia + np.einsum("nijk,nj,nk->ni", change, y[:, 2:], y[:, 2:]))


def _evaluated_rates(expression: str, q: Floats, p: Floats, t: Floats) -> Floats:
    """Rates of the momenta by the printed or the corrected second half of (14), shape (n, 2)."""
    q_dot = rates(PAPER_SCENE, q, p)
    y = np.concatenate([q, q_dot], axis=1)
    nonpotential = generalized_forces(PAPER_SCENE, y, t) + potential_gradient(PAPER_SCENE, q)
    names: dict[str, Any] = {"dH_dp": q_dot, "Q": nonpotential}
    if "dH_dq" in expression:
        names["dH_dq"] = _gradient_of_hamiltonian(q, p)
    return np.asarray(evaluate(expression, **names))


def _gradient_of_hamiltonian(q: Floats, p: Floats) -> Floats:
    """dH/dq at fixed momenta by central differences of order six [N m], shape (n, 2)."""
    step = 4e-3
    gradient = np.zeros_like(q)
    for place, weight in ((1, 45.0), (2, -9.0), (3, 1.0)):
        for i in range(2):
            shift = np.zeros(2)
            shift[i] = place * step
            change = hamiltonian(PAPER_SCENE, q + shift, p) - hamiltonian(PAPER_SCENE, q - shift, p)
            gradient[:, i] += weight * change / (60.0 * step)
    return gradient


#: What is measured about the formula of a key of ``printed.toml``.
MEASURES = {
    "text_rod": [
        Measure(
            "largest residual along the motion, which is zero for a rod of length l", "m", 1e-12, _residual
        ),
    ],
    "equation_2": [Measure("largest residual of the constraint along the motion", "m²", 1e-12, _residual)],
    "equation_9": [
        Measure("largest difference from the kinetic energy (8) along the motion", "J", 1e-9, _kinetic),
    ],
    "equation_10": [
        Measure("largest violation of the energy balance along the motion", "J", 1e-6, _imbalance),
        Measure("change of the energy if lengths are given in cm instead of m", "J", 1e-9, _change_of_units),
    ],
    "equation_12": [
        Measure("largest difference from (1/2) d a11/d phi over a turn", "kg m²", 1e-9, _christoffel),
    ],
    "equation_14": [
        Measure("largest difference from the rate of the momenta along the motion", "N m", 1e-6, _canonical),
        Measure(f"largest deviation of the angles in the first {FIRST:g} s", "rad", 1e-6, _deviation),
    ],
}
