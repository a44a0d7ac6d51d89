"""The paper's motion against 25 digits, the two formulations against each other, constraints."""

from __future__ import annotations

import numpy as np
import pytest
from ensembles.starts import random_starts
from integrators.systems import paper_motion
from oracles import motion_rates
from scipy.integrate import solve_ivp

from fastmech.ensembles.integrate import integrate
from fastmech.scene import Scene
from fastmech.slider.geometry import constraints, positions

FORMULATIONS = pytest.mark.parametrize("formulation", ["lagrange", "hamilton"])


@FORMULATIONS
def test_paper_s_motion(formulation: str) -> None:
    """At 1, 2, 5, 10 and 20 s; dop853 with 10 ms leaves rounding only."""
    scene, start, times, states = paper_motion()
    run = integrate(scene, start, dt=0.01, method="dop853", t_eval=times, formulation=formulation)
    assert times.tolist() == [1.0, 2.0, 5.0, 10.0, 20.0]
    np.testing.assert_allclose(run.y[:, 0], states, rtol=0, atol=1e-11)


@pytest.mark.parametrize("change", [{}, {"alpha": 0.0}, {"beta": 0.0, "F0": 0.0}, {"m3": 0.0, "F0": -60.0}])
def test_both_formulations_agree(change: dict[str, float]) -> None:
    """Over 20 s from the paper's start and some calm ones, to 1e-10 rad and rad/s."""
    scene, start, times, _ = paper_motion()
    starts = start + np.random.default_rng(2).uniform(-0.1, 0.1, (6, 4))
    runs = [
        integrate(
            scene.replace(**change), starts, dt=0.01, method="dop853", t_eval=times, formulation=formulation
        )
        for formulation in ("lagrange", "hamilton")
    ]
    np.testing.assert_allclose(runs[0].y, runs[1].y, rtol=0, atol=1e-10)


@FORMULATIONS
def test_starts_come_back_as_given(formulation: str) -> None:
    """At t = 0, to rounding where momenta lie between."""
    starts = random_starts(50)
    run = integrate(Scene(), starts, t_eval=[0.0, 0.1], formulation=formulation)
    tolerance = 0.0 if formulation == "lagrange" else 1e-14
    np.testing.assert_allclose(run.y[0], starts, rtol=0, atol=tolerance * 100)


def test_constraints_hold_along_the_motion() -> None:
    """Paper (2)-(5) to 1e-12 of l^2, however wrong a step may be: angles cannot leave the constraints."""
    scene, start, times, _ = paper_motion()
    for method in ("euler", "dop853"):
        run = integrate(scene, start, method=method, t_eval=times)
        residuals = constraints(scene, positions(scene, run.y))
        assert np.abs(residuals).max() <= 1e-12 * scene.l**2


def test_against_scipy() -> None:
    """Random starts, decaying force to the left, one second."""
    scene, starts = Scene(F0=-150.0, alpha=0.3), random_starts(5, seed=3)
    run = integrate(scene, starts, 1.0, dt=0.005, method="dop853")
    for start, end in zip(starts, run.y[0], strict=True):
        reference = solve_ivp(
            motion_rates(scene.parameters),
            (0.0, 1.0),
            start,
            method="DOP853",
            rtol=1e-12,
            atol=1e-12,
        )
        np.testing.assert_allclose(end, reference.y[:, -1], rtol=0, atol=1e-9)
