"""Scenes in which stability would set an explicit step: what is predicted, and that ``tol`` goes implicit."""

from __future__ import annotations

import numpy as np
import pytest
from ensembles.references import Floats, errors, motions_of, rest_starts
from oracles import motion_rates
from scipy.integrate import solve_ivp

import fastmech as fm
from fastmech.ensembles.fitting import stability_radius
from fastmech.scene import Scene
from fastmech.slider.linearize import configuration_eigenvalues
from fastmech.studies.hardcases.walk import motion


def stiff_motions(scene: Scene, starts: Floats, t_end: float) -> Floats:
    """Final states by SciPy's Radau at 1e-10."""
    rates = motion_rates(scene.parameters)
    ends = [
        solve_ivp(rates, (0.0, t_end), start, method="Radau", rtol=1e-10, atol=1e-11).y[:, -1]
        for start in starts
    ]
    return np.array(ends)


@pytest.mark.parametrize("beta", [1e4, 1e6])
def test_the_damper_s_rate_bounds_the_eigenvalues_tightly(beta: float) -> None:
    scene = Scene(beta=beta, alpha=0.0)
    fastest = np.abs(configuration_eigenvalues(scene, 0.0)).max()
    bound = float(scene._motion({}).damping)
    assert 0.9 * bound <= fastest <= 1.01 * bound  # springs move a damped mode a little


def test_without_damper_nothing_is_stopped() -> None:
    assert Scene(beta=0.0)._motion({}).damping == 0.0


def test_radii_in_closed_form() -> None:
    """|1 + z| = 1 meets the direction nearest to the imaginary axis first."""
    assert stability_radius("euler") == pytest.approx(2.0 * np.sin(0.1), rel=1e-9)
    assert stability_radius("radau5") == np.inf


@pytest.mark.parametrize("beta", [1e5, 1e6])
def test_heavy_damping_is_integrated_implicitly(beta: float) -> None:
    scene, starts, tol = Scene(beta=beta, alpha=0.0), rest_starts(4, seed=4), 1e-5
    run = fm.integrate(scene, starts, 0.5, tol=tol)
    true = errors(run.y, stiff_motions(scene, starts, 0.5)[None]).max()
    assert run.method == "radau5"
    assert run.reason is not None
    assert "accuracy allows" in run.reason
    assert "\n" not in run.reason
    assert run.steps < 200
    assert run.error_estimate is not None
    assert true <= tol
    assert true / 3.0 <= run.error_estimate <= max(3.0 * true, 1e-9)


@pytest.mark.parametrize("beta", [1e5, 1e6])
def test_starts_that_the_damper_stops_at_once(beta: float) -> None:
    """Long steps would err by their first one alone, which halving does not show: every claim must hold."""
    scene, tol = Scene(beta=beta, alpha=0.0), 1e-6
    starts = np.random.default_rng(2).uniform([0.5, -1.0, -1.0, -1.0], [2.5, 1.0, 1.0, 1.0], (6, 4))
    run = fm.integrate(scene, starts, 1.0, tol=tol)
    true = errors(run.y, stiff_motions(scene, starts, 1.0)[None]).ravel()
    assert run.method == "radau5"
    assert run.error is not None
    assert true.max() <= tol
    assert (true <= 3.0 * run.error + 1e-9).all()


@pytest.mark.parametrize(
    "name",
    ["damping_1e4", "damping_1e6", "heavy_m2", "short_rods", "long_rods", "sudden_decay",
     "large_force"],
)  # fmt: skip
@pytest.mark.parametrize("tol", [1e-4, 1e-8])
def test_hard_motions_against_extended_precision(name: str, tol: float) -> None:
    hard = motion(name)
    run = fm.integrate(hard.scene, hard.start, hard.t_end, tol=tol)
    true = np.abs(run.y[-1, 0] - hard.expected).max()
    assert run.error_estimate is not None
    assert true <= max(tol, 3.0 * run.error_estimate)
    if name == "damping_1e6":
        assert run.method == "radau5"


@pytest.mark.parametrize("tol", [1e-3, 1e-6])
def test_mild_scenes_stay_explicit(tol: float) -> None:
    run = fm.integrate(Scene(alpha=0.0), rest_starts(8), 1.0, tol=tol)
    assert run.method != "radau5"
    assert run.reason == "least work at this tolerance and these output times"
    assert fm.integrate(Scene(alpha=0.0), rest_starts(8), 1.0, dt=0.01).reason is None


@pytest.mark.parametrize("alpha", [30.0, 1e3, 1e6])
@pytest.mark.parametrize("tol", [1e-4, 1e-7])
def test_a_quickly_decaying_force_gives_its_impulse_at_few_steps(alpha: float, tol: float) -> None:
    """Were the vibrations alone to set the step, it would see the force at its first node only."""
    scene, starts = Scene(F0=1e4, alpha=alpha), rest_starts(6, seed=5)
    run = fm.integrate(scene, starts, 2.0, tol=tol)
    assert errors(run.y, motions_of(scene, starts, [2.0])).max() <= tol
    if alpha > 100.0:
        assert run.steps < 5000


def test_a_stiff_system_of_one_s_own() -> None:
    """Prothero and Robinson's problem y' = -rate (y - cos t): its solution soon follows the cosine."""
    rate = 1e5

    def follow(t: float, y: float, rate: float) -> tuple[float]:
        return (-rate * (y - fm.cos(t)),)

    system = fm.System(follow, state=["y"], parameters={"rate": rate})
    run = fm.integrate(system, np.linspace(-2.0, 2.0, 9)[:, None], 10.0, tol=1e-6)
    right = (rate**2 * np.cos(10.0) + rate * np.sin(10.0)) / (rate**2 + 1.0)
    assert run.method == "radau5"
    assert np.abs(run.y[-1] - right).max() <= 1e-6
