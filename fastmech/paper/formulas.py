"""Evidence about wrongly printed formulas: print and correction evaluated along the paper's motion."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

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
from fastmech.paper.compare import evaluate
from fastmech.paper.scene import PAPER_SCENE, START

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
