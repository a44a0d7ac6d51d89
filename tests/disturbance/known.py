"""Scenes with known equilibria, and motions by SciPy, for the tests of disturbances."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from oracles import motion_rates, oracle
from scipy.integrate import solve_ivp

from fastmech.scene import Scene
from fastmech.slider.equilibria import Equilibrium, find_equilibria

Floats = NDArray[np.float64]

DATA = Path(__file__).parents[2] / "data"


@cache
def known(name: str) -> tuple[Scene, Floats, list[int]]:
    """Scene, equilibria (n, 2) [rad] and Morse indices of the reference data."""
    data = tomllib.loads((DATA / "equilibria.toml").read_text(encoding="utf-8"))
    entry = next(scene for scene in data["scene"] if scene["name"] == name)
    angles = np.array([[float(e["phi"]), float(e["theta"])] for e in entry["equilibria"]])
    return Scene(**entry["parameters"]), angles, [e["morse_index"] for e in entry["equilibria"]]


def equilibria(name: str, morse_index: int) -> list[Equilibrium]:
    """Those of fastmech's equilibria of a known scene with this index; the angles are the known ones."""
    scene, angles, indices = known(name)
    found = [e for e in find_equilibria(scene) if e.morse_index == morse_index]
    right = angles[[index == morse_index for index in indices]]
    assert len(found) == len(right)
    assert all(np.abs(right - [e.phi, e.theta]).max(axis=1).min() < 1e-12 for e in found)
    return found


def center(e: Equilibrium) -> Floats:
    return np.array([e.phi, e.theta, 0.0, 0.0])


def scipy_motion(scene: Scene, start: Floats, t_end: float, tolerance: float = 1e-12) -> Any:
    """SciPy's DOP853 with dense output on Newton's equations."""
    return solve_ivp(
        motion_rates(scene.parameters),
        (0.0, t_end),
        start,
        method="DOP853",
        rtol=tolerance,
        atol=tolerance,
        dense_output=True,
    )


def stiff_motion(scene: Scene, start: Floats, t_end: float) -> Floats:
    """Final state by SciPy's Radau at 1e-8."""
    found = solve_ivp(
        motion_rates(scene.parameters),
        (0.0, t_end),
        start,
        method="Radau",
        rtol=1e-8,
        atol=1e-9,
    )
    return np.asarray(found.y[:, -1])


def oracle_jacobian(scene: Scene, e: Equilibrium) -> Floats:
    return np.array(oracle().jacobian(scene.parameters, center(e), 0.0), dtype=np.float64)


def oracle_size(scene: Scene, e: Equilibrium, disturbances: Floats) -> Floats:
    """The kinetic-energy norm from the oracle's metric and Hessian."""
    params, q = scene.parameters, (e.phi, e.theta)
    a = np.array(oracle().metric(params, q), dtype=np.float64)
    hessian = np.array(oracle().hessian(params, q, scene.F0), dtype=np.float64)
    square = np.abs(np.linalg.eigvals(np.linalg.inv(a) @ hessian)).max()
    xi, eta = disturbances[..., :2], disturbances[..., 2:]
    energy = np.einsum("...i,ij,...j", xi, a, xi) + np.einsum("...i,ij,...j", eta, a, eta) / square
    return np.asarray(np.sqrt(energy / (scene.m2 * scene.l**2)))
