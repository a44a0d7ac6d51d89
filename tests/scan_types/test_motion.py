"""The section of a motion: every variable against the oracle, own Runge-Kutta steps and reference states."""

from __future__ import annotations

import tomllib
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from oracles import motion_rates, oracle
from scan_types.values import (
    Floats,
    Params,
    along,
    array,
    check_labels,
    rk4,
    scipy_motion,
    slider_slopes,
    stored,
    together,
)

import fastmech as fm
from fastmech.results import Dataset
from fastmech.scan_types.motion import Motion
from fastmech.scan_types.request import HALVING
from fastmech.scene import Scene

OTHER = {
    "m1": 7.0, "m2": 9.5, "m3": 4.0, "l": 0.8, "c1": 210.0, "c2": 95.0,
    "beta": 60.0, "g": 9.81, "F0": -70.0, "alpha": 0.4,
}  # fmt: skip
OTHER_START = (2.1, -0.7, 1.3, -2.4)

#: Outputs every 0.25 s, which 0.06 s does not divide: five steps between outputs, with half of it nine.
T_END, OUTPUTS, DT, STEPS, HALF_STEPS = 2.0, 9, 0.06, 40, 80

UNITS = {
    "time": "s", "phi": "rad", "theta": "rad", "phi_dot": "rad/s", "theta_dot": "rad/s",
    "p_phi": "kg m2/s", "p_theta": "kg m2/s",
    "formulation_difference_phi": "rad", "formulation_difference_theta": "rad",
    "formulation_difference_phi_dot": "rad/s", "formulation_difference_theta_dot": "rad/s",
    "x1": "m", "y1": "m", "x2": "m", "y2": "m", "x3": "m", "y3": "m",
    "constraint_residual_2": "m2", "constraint_residual_3": "m2", "constraint_residual_4": "m",
    "constraint_residual_5": "m2", "force": "N",
    "rod_om1": "N", "rod_m1m2": "N", "rod_m1m3": "N", "slider_normal": "N",
    "kinetic_energy": "J", "potential_energy": "J", "work_damper": "J", "work_force": "J",
    "energy_residual": "J",
}  # fmt: skip


@pytest.fixture(scope="module")
def section(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """A coarse motion, so that the errors of the steps are far above rounding."""
    start = dict(zip(("phi", "theta", "phi_dot", "theta_dot"), OTHER_START, strict=True))
    scan = Motion(start=start, t_end=T_END, outputs=OUTPUTS, dt=DT, method="rk4")
    return stored(scan, Scene(**OTHER), tmp_path_factory.mktemp("motion"))


def states(section: Dataset) -> Floats:
    return np.stack([section[name].data for name in ("phi", "theta", "phi_dot", "theta_dot")], axis=-1)


def with_works(params: Params, steps: int) -> Floats:
    """Own Runge-Kutta steps of the state, the damper's work and the force's, at the outputs (outputs, 6)."""
    move = motion_rates(params)

    def rates(t: float, y: Floats) -> Floats:
        phi, theta, u, w = y[:4]
        slide = slider_slopes(params, phi)[0] * u
        x2_dot = -params["l"] * (np.sin(phi) * u + np.cos(theta) * w)
        force = params["F0"] * np.exp(-params["alpha"] * t)
        return np.concatenate([move(t, y[:4]), [-params["beta"] * slide**2, force * x2_dot]])

    return rk4(rates, array([*OTHER_START, 0.0, 0.0]), T_END, steps)[:: steps // (OUTPUTS - 1)]


def test_own_equations_are_the_oracle_s() -> None:
    right = array(oracle().accelerations(OTHER, OTHER_START, 0.3))
    assert motion_rates(OTHER)(0.3, array(OTHER_START))[2:] == pytest.approx(right, rel=1e-13)


def test_labels(section: Dataset) -> None:
    check_labels(section, UNITS)
    for name in UNITS:
        assert section[name].dims == ("time",)


def test_states_are_runge_kutta_s(section: Dataset) -> None:
    assert section["time"].data == pytest.approx(np.arange(OUTPUTS) * 0.25, abs=1e-15)
    np.testing.assert_allclose(states(section), with_works(OTHER, STEPS)[:, :4], rtol=0, atol=1e-11)


def test_attributes(section: Dataset) -> None:
    one, half = with_works(OTHER, STEPS)[:, :4], with_works(OTHER, HALF_STEPS)[:, :4]
    attrs = section.attrs
    assert attrs["error_estimate"] == pytest.approx(np.abs(half - one).max(), rel=1e-7)
    assert attrs["error_estimate"] > 1e-5
    assert attrs["error_estimate_is"] == HALVING
    assert (attrs["steps"], attrs["failed"], attrs["method"], attrs["dt"]) == (STEPS, 0, "rk4", DT)
    assert tuple(attrs[f"start_{name}"] for name in ("phi", "theta", "phi_dot", "theta_dot")) == OTHER_START


def test_canonical_motion(section: Dataset) -> None:
    def rates(t: float, y: Floats) -> Floats:
        return array(oracle().hamilton_rhs(OTHER, y[:2], y[2:], t))

    start = [*OTHER_START[:2], *oracle().momenta(OTHER, OTHER_START[:2], OTHER_START[2:])]
    canonical = rk4(rates, array(start), T_END, STEPS)[:: STEPS // (OUTPUTS - 1)]
    np.testing.assert_allclose(section["p_phi"].data, canonical[:, 2], rtol=0, atol=1e-9)
    np.testing.assert_allclose(section["p_theta"].data, canonical[:, 3], rtol=0, atol=1e-9)
    turned = array([rates(0.0, y)[:2] for y in canonical])
    difference = np.concatenate([canonical[:, :2], turned], axis=1) - with_works(OTHER, STEPS)[:, :4]
    stored_difference = together(section, "formulation_difference")
    np.testing.assert_allclose(stored_difference, difference, rtol=0, atol=1e-10)
    assert np.abs(stored_difference).max(axis=0).min() > 1e-6


def test_points_and_constraints(section: Dataset) -> None:
    right = along(oracle().positions, OTHER, states(section)[:, :2])
    for i, name in enumerate(("x1", "y1", "x2", "y2", "x3", "y3")):
        np.testing.assert_allclose(section[name].data, right[:, i], rtol=0, atol=1e-14, err_msg=name)
    l2 = Fraction(OTHER["l"]) ** 2
    exact = []
    for row in zip(
        *(section[name].data.tolist() for name in ("x1", "y1", "x2", "y2", "x3", "y3")), strict=True
    ):
        x1, y1, x2, y2, x3, y3 = (Fraction(value) for value in row)
        exact.append(
            [
                x1**2 + y1**2 - l2,
                (x2 - x1) ** 2 + (y2 - y1) ** 2 - l2,
                y3,
                (x3 - x1) ** 2 + (y3 - y1) ** 2 - 4 * l2,
            ]
        )
    np.testing.assert_allclose(together(section, "constraint_residual"), array(exact), rtol=0, atol=3e-15)
    assert (section["constraint_residual_4"].data == 0.0).all()


def test_force_and_reactions(section: Dataset) -> None:
    t = section["time"].data
    np.testing.assert_allclose(section["force"].data, -70.0 * np.exp(-0.4 * t), rtol=1e-14)
    right = [oracle().reactions(OTHER, y, now) for y, now in zip(states(section), t, strict=True)]
    names = {"rod_om1": "OM1", "rod_m1m2": "M1M2", "rod_m1m3": "M1M3", "slider_normal": "N"}
    for name, own in names.items():
        expected = array([getattr(forces, own) for forces in right])
        np.testing.assert_allclose(section[name].data, expected, rtol=0, atol=1e-10, err_msg=name)


def test_energies_and_works(section: Dataset) -> None:
    kinetic = along(oracle().kinetic_energy, OTHER, states(section))
    potential = along(oracle().potential, OTHER, states(section)[:, :2])
    works = with_works(OTHER, STEPS)[:, 4:]
    np.testing.assert_allclose(section["kinetic_energy"].data, kinetic, rtol=0, atol=1e-10)
    np.testing.assert_allclose(section["potential_energy"].data, potential, rtol=0, atol=1e-10)
    np.testing.assert_allclose(section["work_damper"].data, works[:, 0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(section["work_force"].data, works[:, 1], rtol=0, atol=1e-9)
    energy = kinetic + potential
    residual = energy - energy[0] - works.sum(axis=1)
    np.testing.assert_allclose(section["energy_residual"].data, residual, rtol=0, atol=1e-9)
    assert np.abs(residual).max() > 1e-4


def test_the_paper_s_motion(tmp_path: Path) -> None:
    path = Path(__file__).parents[2] / "data" / "paper_motion.toml"
    data = tomllib.loads(path.read_text(encoding="utf-8"))
    params = data["parameters"]
    section = stored(Motion(t_end=5.0, outputs=6), Scene(**params), tmp_path)
    assert [section.attrs[f"start_{name}"] for name in data["start"]] == list(data["start"].values())
    for state in data["state"][:3]:
        right = array([state[name] for name in ("phi", "theta", "phi_dot", "theta_dot")])
        i = int(state["t"])
        assert section["time"].data[i] == state["t"]
        np.testing.assert_allclose(states(section)[i], right, rtol=0, atol=1e-9)
        momenta = array(oracle().momenta(params, right[:2], right[2:]))
        own = [section["p_phi"].data[i], section["p_theta"].data[i]]
        np.testing.assert_allclose(own, momenta, rtol=0, atol=1e-7)
    smooth = scipy_motion(params, array(list(data["start"].values())), section["time"].data)
    np.testing.assert_allclose(states(section), smooth, rtol=0, atol=1e-9)
    assert section.attrs["error_estimate"] < 1e-9
    assert np.abs(together(section, "formulation_difference")).max() < 1e-9
    assert np.abs(section["energy_residual"].data).max() < 1e-6


def test_a_failed_motion_is_counted(tmp_path: Path) -> None:
    scan = Motion(start={"phi": 1.0, "phi_dot": 30.0}, t_end=40.0, outputs=3, dt=1.0, method="rk4")
    assert stored(scan, Scene(), tmp_path).attrs["failed"] == 1


@pytest.mark.slow
def test_a_mechanism_s_steps_agree_with_their_halves(tmp_path: Path) -> None:
    """x = cos(w t) / 10 with w dt = 3.3 at the step that slow mechanisms have."""
    x, w = fm.lengths("x"), 330.0
    stiff = fm.Mechanism(x, kinetic=x.dot**2 / 2, potential=w**2 * x**2 / 2)
    found = stored(Motion(start={"x": 0.1}, t_end=1.0, outputs=101), stiff, tmp_path)
    right = 0.1 * np.cos(w * found["time"].data)
    np.testing.assert_allclose(found["x"].data, right, atol=1e-4)
    assert found.attrs["dt"] < 0.01
