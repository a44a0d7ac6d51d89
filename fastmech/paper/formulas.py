"""Evidence about wrongly printed formulas: print and correction evaluated along the paper's motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from fastmech.ensembles.balance import EnergyBalance
from fastmech.mechanism.geometry import positions, velocities
from fastmech.mechanism.hamilton import hamiltonian, momenta, rates
from fastmech.mechanism.lagrange import (
    angular_accelerations,
    christoffel,
    generalized_forces,
    metric,
    potential_gradient,
)
from fastmech.paper.coefficients import Floats
from fastmech.paper.printed import evaluate
from fastmech.paper.scene import PAPER_SCENE, START

Formula = Mapping[str, str]
#: measure, unit, value for the print, value for the correction, tolerance
Measured = tuple[str, str, float, float, float]

ANGLES, DEVIATION_TIME = 256, 1.0


def formula_evidence(key: str, formula: Formula, motion: EnergyBalance) -> list[Measured]:
    """What is measured about the formula of this key of ``printed.toml``."""
    return _MEASURES[key](formula, motion)


def _pair(measure: Callable[[str], float], formula: Formula) -> tuple[float, float]:
    return measure(formula["printed"]), measure(formula["corrected"])


def _names(y: Floats, scale: float = 1.0) -> dict[str, Any]:
    """The paper's quantities at states ``y`` (n, 4), with lengths in units of 1/scale m."""
    scene = PAPER_SCENE.model_dump()
    scene["l"], scene["g"] = scene["l"] * scale, scene["g"] * scale
    points = {name: value * scale for name, value in positions(PAPER_SCENE, y)._asdict().items()}
    angles = dict(zip(("phi", "theta", "phi_dot", "theta_dot"), y.T, strict=True))
    return {**scene, **points, **angles}


def _length(formula: Formula, motion: EnergyBalance) -> list[Measured]:
    names = _names(motion.y)

    def residual(expression: str) -> float:
        return float(np.max(np.abs(evaluate(expression, **names))))

    return [
        (
            "largest residual along the motion, which is zero for a rod of length l",
            "m",
            *_pair(residual, formula),
            1e-12,
        )
    ]


def _constraint(formula: Formula, motion: EnergyBalance) -> list[Measured]:
    names = _names(motion.y)

    def residual(expression: str) -> float:
        return float(np.max(np.abs(evaluate(expression, **names))))

    return [("largest residual of the constraint along the motion", "m²", *_pair(residual, formula), 1e-12)]


def _kinetic(formula: Formula, motion: EnergyBalance) -> list[Measured]:
    v = velocities(PAPER_SCENE, motion.y)
    scene = PAPER_SCENE
    true = 0.5 * (scene.m1 * (v.x1**2 + v.y1**2) + scene.m2 * (v.x2**2 + v.y2**2) + scene.m3 * v.x3**2)
    names = _names(motion.y)

    def error(expression: str) -> float:
        return float(np.max(np.abs(evaluate(expression, **names) - true)))

    return [
        ("largest difference from the kinetic energy (8) along the motion", "J", *_pair(error, formula), 1e-9)
    ]


def _potential(formula: Formula, motion: EnergyBalance) -> list[Measured]:
    works = motion.work_damper + motion.work_force

    def imbalance(expression: str) -> float:
        energy = motion.kinetic + evaluate(expression, **_names(motion.y))
        return float(np.max(np.abs(energy - energy[0] - works)))

    def change_of_units(expression: str) -> float:
        metres = evaluate(expression, **_names(motion.y))
        centimetres = evaluate(expression, **_names(motion.y, 100.0)) / 100.0**2
        return float(np.max(np.abs(centimetres - metres)))

    return [
        ("largest violation of the energy balance along the motion", "J", *_pair(imbalance, formula), 1e-6),
        (
            "change of the energy if lengths are given in cm instead of m",
            "J",
            *_pair(change_of_units, formula),
            1e-9,
        ),
    ]


def _christoffel(formula: Formula, motion: EnergyBalance) -> list[Measured]:
    phi = 2.0 * np.pi * np.arange(ANGLES) / ANGLES
    a11 = metric(PAPER_SCENE, np.stack([phi, np.zeros(ANGLES)], axis=-1))[:, 0, 0]
    # a11 is analytic and periodic: its Fourier series differentiates it to rounding.
    waves = np.fft.rfft(a11) * 1j * np.arange(ANGLES // 2 + 1)
    true = 0.5 * np.fft.irfft(waves, ANGLES)
    names = {**PAPER_SCENE.model_dump(), "phi": phi}

    def error(expression: str) -> float:
        return float(np.max(np.abs(evaluate(expression, **names) - true)))

    return [("largest difference from (1/2) d a11/d phi over a turn", "kg m²", *_pair(error, formula), 1e-9)]


def _canonical(formula: Formula, motion: EnergyBalance) -> list[Measured]:
    q, p = motion.y[:, :2], momenta(PAPER_SCENE, motion.y)
    true = _momentum_rates(motion.y, motion.t)

    def residual(expression: str) -> float:
        return float(np.max(np.abs(_evaluated_rates(expression, q, p, motion.t) - true)))

    inside = motion.t[motion.t <= DEVIATION_TIME]

    def deviation(expression: str) -> float:
        def rhs(t: float, state: Floats) -> Floats:
            now, momentum = state[None, :2], state[None, 2:]
            slope = _evaluated_rates(expression, now, momentum, np.array([t]))
            return np.concatenate([rates(PAPER_SCENE, now, momentum)[0], slope[0]])

        start = np.concatenate([START[:2], momenta(PAPER_SCENE, START)])
        run = solve_ivp(rhs, (0.0, inside[-1]), start, "DOP853", inside, rtol=1e-9, atol=1e-9)
        return float(np.max(np.abs(run.y[:2].T - motion.y[: inside.size, :2])))

    return [
        (
            "largest difference from the rate of the momenta along the motion",
            "N m",
            *_pair(residual, formula),
            1e-6,
        ),
        (
            f"largest deviation of the angles in the first {DEVIATION_TIME:g} s",
            "rad",
            *_pair(deviation, formula),
            1e-6,
        ),
    ]


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


_MEASURES: dict[str, Callable[[Formula, EnergyBalance], list[Measured]]] = {
    "text_rod": _length,
    "equation_2": _constraint,
    "equation_9": _kinetic,
    "equation_10": _potential,
    "equation_12": _christoffel,
    "equation_14": _canonical,
}
