"""The section of a disturbance of every equilibrium: SciPy, own Runge-Kutta steps, matrix exponentials."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from oracles import motion_rates
from scan_types.values import (
    Floats,
    check_labels,
    deepest_first,
    oracle_jacobian,
    rk4,
    scipy_motion,
    stored,
    together,
)

from fastmech.results import Dataset
from fastmech.scan_types.disturbed_motion import DisturbedMotionScan
from fastmech.scan_types.request import HALVING
from fastmech.scene import Scene

SCENE, ANGLES = deepest_first("bistable")
PARAMS = SCENE.parameters
DISTURBANCE = np.array([0.11, -0.07, 0.3, -0.5])
CENTERS = np.concatenate([ANGLES, np.zeros_like(ANGLES)], axis=1)
TIMES = np.linspace(0.0, 1.5, 7)

STATE = {"phi": "rad", "theta": "rad", "phi_dot": "rad/s", "theta_dot": "rad/s"}

UNITS = {"equilibrium": "1", "time": "s", "phi": "rad", "theta": "rad"}
UNITS |= {f"{which}_{name}": unit for which in ("nonlinear", "linearized") for name, unit in STATE.items()}


def scan(dt: float, method: str) -> DisturbedMotionScan:
    disturbance = dict(zip(STATE, DISTURBANCE.tolist(), strict=True))
    return DisturbedMotionScan(disturbance=disturbance, t_end=1.5, outputs=7, dt=dt, method=method)


@pytest.fixture(scope="module")
def section(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return stored(scan(0.01, "dop853"), SCENE, tmp_path_factory.mktemp("disturbed_motion"))


@pytest.fixture(scope="module")
def coarse(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return stored(scan(0.05, "rk4"), SCENE, tmp_path_factory.mktemp("disturbed_motion"))


def steps_of(count: int) -> Floats:
    """Own Runge-Kutta disturbances with so many steps at the outputs (equilibrium, time, component)."""
    states = rk4(motion_rates(PARAMS), CENTERS + DISTURBANCE, 1.5, count)[:: count // 6]
    return (states - CENTERS).transpose(1, 0, 2)


def test_labels(section: Dataset) -> None:
    check_labels(section, UNITS)
    assert section["nonlinear_phi"].dims == section["linearized_theta_dot"].dims == ("equilibrium", "time")
    assert section["phi"].dims == section["theta"].dims == ("equilibrium",)


def test_places_and_times(section: Dataset) -> None:
    np.testing.assert_allclose(section["time"].data, TIMES, rtol=0, atol=1e-15)
    found = np.stack([section["phi"].data, section["theta"].data], axis=-1)
    np.testing.assert_allclose(found, ANGLES, rtol=0, atol=1e-12)


def test_nonlinear_is_scipy_s(section: Dataset) -> None:
    right = (scipy_motion(PARAMS, CENTERS + DISTURBANCE, TIMES) - CENTERS).transpose(1, 0, 2)
    np.testing.assert_allclose(together(section, "nonlinear"), right, rtol=0, atol=1e-8)


def test_linearized_is_the_matrix_exponential(section: Dataset) -> None:
    right = [[scipy.linalg.expm(t * oracle_jacobian(PARAMS, q)) @ DISTURBANCE for t in TIMES] for q in ANGLES]
    np.testing.assert_allclose(together(section, "linearized"), right, rtol=1e-9, atol=1e-11)


def test_attributes(section: Dataset, coarse: Dataset) -> None:
    one, half = steps_of(30), steps_of(60)
    np.testing.assert_allclose(together(coarse, "nonlinear"), one, rtol=0, atol=1e-9)
    assert coarse.attrs["error_estimate"] == pytest.approx(np.abs(half - one).max(), rel=1e-6)
    assert coarse.attrs["error_estimate"] > 1e-5
    assert section.attrs["error_estimate"] < 1e-8
    assert section.attrs["error_estimate_is"] == HALVING
    assert [section.attrs[f"disturbance_{name}"] for name in STATE] == DISTURBANCE.tolist()
    assert (section.attrs["t_end"], section.attrs["outputs"]) == (1.5, 7)
    assert (coarse.attrs["dt"], coarse.attrs["method"]) == (0.05, "rk4")
    assert section.attrs["failed"] == coarse.attrs["failed"] == 0


def test_the_default_is_the_paper_s_disturbance(tmp_path: Path) -> None:
    default = stored(DisturbedMotionScan(outputs=3, t_end=0.2), Scene(alpha=0.0), tmp_path)
    for name in ("nonlinear", "linearized"):
        start = together(default, name)[:, 0]
        np.testing.assert_allclose(start, np.tile([0.1, 0.0, 0.1, 0.0], (4, 1)), rtol=0, atol=1e-15)
