"""Starts far faster than all others, in runs to a tolerance: what they cost, and that they disturb nobody."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from ensembles.references import rest_starts

import fastmech as fm
from fastmech.ensembles import solve as module
from fastmech.ensembles.solve import solve

SCENE = fm.Scene(c2=1100 / 3, alpha=0.0)


@pytest.mark.parametrize("quantile", [0.9, 1.0])
@pytest.mark.parametrize("speed", [1e20, 1e100, 1e300])
def test_a_start_that_no_steps_follow_leaves_others_alone(speed: float, quantile: float) -> None:
    starts, times = rest_starts(24), np.linspace(0.0, 4.0, 9)
    right = fm.integrate(SCENE, starts, t_eval=times, tol=1e-4, quantile=quantile)
    wild = np.insert(starts, 7, [0.3, 0.2, speed, 0.0], axis=0)
    run, others = fm.integrate(SCENE, wild, t_eval=times, tol=1e-4, quantile=quantile), np.arange(25) != 7
    np.testing.assert_array_equal(run.y[:, others], right.y)
    np.testing.assert_array_equal(run.status == fm.Status.STEP_TOO_LARGE, ~others)
    assert run.error_estimate == right.error_estimate
    if quantile == 1.0:
        assert run.error is not None
        np.testing.assert_array_equal(run.error[others], right.error)
        assert run.error[7] == np.inf


@pytest.mark.parametrize("slow", [0, 5, 100])
@pytest.mark.slow
def test_a_fast_start_costs_no_more_than_its_steps_ask_for(
    slow: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At 1,000 rad/s the motion is chaotic: no step brings it to a tolerance, and few are tried in vain.

    Without a count of fitted steps the shortest would be 64 times as short as the first.
    """
    steps: list[int] = []

    def counted(*arguments: Any, **named: Any) -> Any:
        solution = solve(*arguments, **named)
        steps.append(int(solution.steps.max(initial=0)))
        return solution

    monkeypatch.setattr(module, "solve", counted)
    starts = np.vstack([rest_starts(slow) * 0.5, [[0.3, 0.2, 1e3, 0.0]]])
    run = fm.integrate(SCENE, starts, 10.0, tol=1e-6)
    assert run.error is not None
    assert (run.error[:-1] <= 1e-6).all()
    assert run.error[-1] > 1e-6
    # 10 s at 1,000 rad/s are 1e4 rad, of which an Adams method takes about 20 steps a rad at first.
    assert max(steps) < 32 * 2e5
    assert sum(steps) < 200 * 2e5  # about half of that: in chaos rounding decides how often it is tried


@pytest.mark.parametrize("quantile", [0.9, 1.0])
@pytest.mark.parametrize("own", [False, True])
@pytest.mark.parametrize("speed", [1e20, 1e200])
def test_starts_that_no_steps_follow_are_told_so_alone_too(speed: float, own: bool, quantile: float) -> None:
    starts = np.array([[0.3, 0.2, speed, 0.0]] * 2)
    parameters = {"beta": np.ones(2)} if own else {}
    run = fm.integrate(SCENE, starts, t_eval=[0.0, 1.0], tol=1e-6, quantile=quantile, parameters=parameters)
    assert (run.status == fm.Status.STEP_TOO_LARGE).all()
    np.testing.assert_array_equal(run.y[0], starts)
    assert np.isnan(run.y[1]).all()
    assert "no start" in str(run.reason)


@pytest.mark.parametrize("own", [False, True])
def test_no_start_that_is_finite_and_no_start_at_all(own: bool) -> None:
    for starts in (np.full((2, 4), np.nan), np.zeros((0, 4))):
        parameters = {"beta": np.ones(len(starts))} if own else {}
        run = fm.integrate(SCENE, starts, 1.0, tol=1e-6, parameters=parameters)
        assert (run.status == fm.Status.START_NOT_FINITE).all()
        assert run.y.shape == (1, len(starts), 4)


@pytest.mark.parametrize(("speed", "aside"), [(1e6, False), (1e8, True), (2e7, True)])
def test_steps_are_fitted_to_no_motion_that_takes_too_many(speed: float, aside: bool) -> None:
    """Fitted again, a step shrinks with the speed to the power 1.5; a microsecond takes few all the same."""
    slow = rest_starts(3)
    starts, end = np.vstack([slow, [[0.3, 0.2, speed, 0.0]]]), 1e-6 if not aside else 1.0
    run = fm.integrate(SCENE, starts, end, dt=1e-3, fit=[0.0, 0.5 * end])
    assert (run.status[3] == fm.Status.STEP_TOO_LARGE) == aside
    alone = fm.integrate(SCENE, slow, end, dt=1e-3, fit=[0.0, 0.5 * end])
    np.testing.assert_array_equal(run.y[:, :3], alone.y)
    assert (run.status[:3] == fm.Status.OK).all()
