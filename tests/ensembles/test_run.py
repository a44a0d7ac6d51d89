"""Containment: who fails keeps the last finite state and its time; nobody else notices."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import fastmech as fm
from fastmech.ensembles import run as running
from fastmech.ensembles.ends import STOP_CODE, STOP_STATE, STOP_TIME
from fastmech.ensembles.problem import system_problem
from fastmech.ensembles.run import Ensemble, run_ensemble
from fastmech.integrators.explicit import Batch
from fastmech.integrators.methods import METHODS


def square(t: float, y: float) -> tuple[float]:
    return (y * y,)


BLOW_UP = fm.System(square, ["y"], {})


def far(t: float, y: float) -> float:
    return 3.0 if y > 1e3 else 0.0


@pytest.mark.parametrize("method", ["rk4", "abm8", "dop853", "gauss4"])
def test_last_finite_state_and_time(method: str) -> None:
    """y' = y^2 is y0 / (1 - y0 t): infinite at t = 1/y0 in starts that are positive."""
    starts = np.array([[-1.0], [1.0], [0.5], [-0.3], [2.0], [np.inf]])
    p = system_problem(BLOW_UP, 6, {})
    times = np.linspace(0.0, 100.0, 201)
    run = run_ensemble(p.rhs, p.params, starts, times, 0.005, METHODS[method])
    tame = [0, 3]
    alone = run_ensemble(p.rhs, p.params, starts[tame], times, 0.005, METHODS[method])
    np.testing.assert_array_equal(run.states[:, tame], alone.states)
    np.testing.assert_array_equal(run.last[tame], run.states[-1, tame])
    wrong = fm.Status.NOT_CONVERGED if method == "gauss4" else fm.Status.NOT_FINITE
    assert run.status.tolist() == [0, wrong, wrong, 0, wrong, fm.Status.START_NOT_FINITE]
    assert np.isnan(run.failed[tame]).all()
    np.testing.assert_allclose(run.failed[[1, 2, 4]], [1.0, 2.0, 0.5], atol=0.1)
    assert run.failed[5] == 0.0
    assert np.isfinite(run.last[:5]).all()
    # Finite outputs before the failure, none after it.
    for lane in (1, 2, 4):
        finite = np.isfinite(run.states[:, lane, 0])
        np.testing.assert_array_equal(finite, times[1:] <= run.failed[lane])


def test_a_stop_before_the_end_is_no_failure() -> None:
    """It stops at y > 1000, finite; the steps after it in the same call overflow."""
    system = fm.System(square, ["y"], {}, stop=far)
    p = system_problem(system, 2, {})
    run = run_ensemble(p.rhs, p.params, [[1.0], [-1.0]], [0.0, 5.0], 0.001, METHODS["rk4"], p.observation)
    assert run.status.tolist() == [0, 0]
    assert np.isnan(run.failed).all()
    assert 1e3 < run.last[0, 0] < np.inf
    assert run.states[0, 0, 0] == run.last[0, 0]


@pytest.mark.parametrize(("method", "dt", "steps"), [("rk4", 5.0, 2), ("rk4", 10.0, 2), ("euler", 6.0, 8)])
def test_no_energy_beyond_a_double_s_range_is_right(method: str, dt: float, steps: int) -> None:
    """So few steps that states are still finite, and their energies are not."""
    starts = np.random.default_rng(1).uniform([0.5, -1.0, 0.0, 0.0], [2.5, 1.0, 0.0, 0.0], (1000, 4))
    run = fm.integrate(fm.Scene(c2=1100 / 3, alpha=0.0), starts, steps * dt, dt, method)
    right = run.status == 0
    # Rods 1 m long, some 10 kg and 1 kN: no motion from rest is faster than 100 rad/s.
    assert np.abs(run.y[-1, right, 2:]).max(initial=0.0) < 100.0


@pytest.mark.parametrize("options", [{}, {"fit": [0.0, 1.0]}, {"formulation": "hamilton"}])
def test_a_result_tells_of_its_failures(options: dict[str, Any]) -> None:
    """At 1e200 rad/s the squares overflow in the first step, no steps fit: the start is the last state."""
    starts = np.random.default_rng(0).normal(size=(8, 4))
    why = "step_too_large" if "fit" in options else "not_finite"
    starts[3, 0], starts[5, 2:] = np.nan, [1e200, 0.0]
    with pytest.warns(fm.StepWarning, match="rad/s"):
        run = fm.integrate(fm.Scene(), starts, 2.0, 0.01, **options)
    advice = "use a smaller dt" + ", unless motions go to infinity" * (why == "not_finite")
    assert run.failures == f"2 of 8 trajectories failed: 1 {why}, 1 start_not_finite; {advice}"
    assert run.failures in " ".join(repr(run).split())
    assert run.failed is not None
    assert run.last is not None
    healthy = [0, 1, 2, 4, 6, 7]
    np.testing.assert_array_equal(run.last[healthy], run.y[-1, healthy])
    assert np.isnan(run.failed[healthy]).all()
    assert run.failed[5] == 0.0
    np.testing.assert_allclose(run.last[5, :3], starts[5, :3], rtol=1e-15)
    assert "none failed" in repr(fm.integrate(fm.Scene(), starts[:3], 0.1))


def test_runs_to_a_tolerance_keep_last_finite_states() -> None:
    starts = np.random.default_rng(0).normal(size=(8, 4))
    starts[5, 2] = 1e200
    run = fm.integrate(fm.Scene(), starts, 0.5, tol=1e-6)
    assert run.status.tolist() == [0, 0, 0, 0, 0, fm.Status.STEP_TOO_LARGE, 0, 0]
    assert run.failed is not None
    assert run.last is not None
    assert run.failed[5] == 0.0
    np.testing.assert_array_equal(run.last[5], starts[5])
    np.testing.assert_array_equal(run.last[:5], run.y[-1, :5])


class Counted:
    """A method that counts the steps of lanes that it takes, those that only fill vectors included."""

    def __init__(self, name: str) -> None:
        self.method, self.steps = METHODS[name], 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self.method, name)

    def run(self, rhs: Any, observe: Any, batch: Batch) -> Any:
        self.steps += batch.Y.shape[0] * batch.Y.shape[2] * int(batch.steps.sum())
        return self.method.run(rhs, observe, batch)


FAILING = np.arange(0, 1024, 16)


def counted(method: str, when: float, t_end: float = 20.0) -> tuple[Ensemble, int]:
    """1,024 trajectories of y' = y^2, of which every sixteenth fails at about ``when``; inf: none does."""
    starts = np.random.default_rng(0).uniform(-2.0, -1.0, (1024, 1))
    if when < np.inf:
        starts[FAILING, 0] = 1.0 / (when * np.linspace(0.95, 1.05, FAILING.size)) if when else np.nan
    p = system_problem(BLOW_UP, 1024, {})
    method_counted: Any = Counted(method)
    run = run_ensemble(p.rhs, p.params, starts, [0.0, t_end], 0.01, method_counted, threads=1)
    return run, method_counted.steps


@pytest.mark.parametrize("method", ["rk4", "dop853", "ab6", "abm8", "gauss4"])
@pytest.mark.parametrize("when", [0.0, 2.0, 10.0, 18.0])
def test_failing_trajectories_cost_the_rest_less_than_a_tenth(method: str, when: float) -> None:
    """Counted in steps of lanes, which take the time; those that failing ones take until then are counted."""
    right, alone = counted(method, np.inf)
    run, beside = counted(method, when)
    rest = np.setdiff1d(np.arange(1024), FAILING)
    assert np.flatnonzero(run.status).tolist() == FAILING.tolist()
    np.testing.assert_array_equal(run.states[:, rest], right.states[:, rest])
    assert (rest.size / beside) / (1024 / alone) > 0.9
    if when == 2.0:  # soon after it they are gone
        assert beside < alone


def test_starts_that_are_not_finite_take_no_steps() -> None:
    p, method = system_problem(BLOW_UP, 3, {}), Counted("rk4")
    told: list[int] = []
    starts: Any = [[np.nan], [np.inf], [-np.inf]]
    chosen: Any = method
    run = run_ensemble(p.rhs, p.params, starts, [0.0, 1.0], 0.01, chosen, progress=told.append)
    assert method.steps == 0
    assert sum(told) == 3
    assert run.status.tolist() == [fm.Status.START_NOT_FINITE] * 3
    assert run.failed.tolist() == [0.0] * 3
    np.testing.assert_array_equal(run.last, starts)


@pytest.mark.parametrize("method", ["rk4", "ab6", "abm8", "gauss6", "radau5", "sdirk4"])
def test_where_calls_end_does_not_matter(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not for those that fail either: one call, or one for every piece, between which most lanes leave."""
    starts = np.random.default_rng(1).uniform(-1.0, 1.0, (60, 1))
    p = system_problem(BLOW_UP, 60, {})
    runs = []
    for steps in (10**6, 1):
        monkeypatch.setattr(running, "CALL_STEPS", steps)
        monkeypatch.setattr(running, "CALL_EVALUATIONS", 10**9)
        runs.append(run_ensemble(p.rhs, p.params, starts, [0.0, 7.0, 16.0], 0.02, METHODS[method]))
    long, short = runs
    assert 0 < np.count_nonzero(long.status) < 60
    for name in ("states", "status", "failed", "last"):
        np.testing.assert_array_equal(getattr(long, name), getattr(short, name))


def late(t: float, y: float) -> float:
    return 1.0 if t > 1.2 else 0.0


def large(t: float, y: float) -> float:
    return 2.0 if not y < 1e9 else 0.0


@pytest.mark.parametrize("method", ["rk4", "ab6", "abm8", "radau5", "sdirk4"])
@pytest.mark.parametrize("call_steps", [1, 10**6])
def test_a_stop_after_a_failure_is_none(method: str, call_steps: int) -> None:
    """y' = y^2 from 1 is over at t = 1; only the other two are there to be stopped at t > 1.2."""
    p = system_problem(fm.System(square, ["y"], {}, stop=late), 3, {})
    watched = replace(p.observation, call_steps=call_steps)
    times = np.linspace(0.0, 3.0, 61)
    run = run_ensemble(p.rhs, p.params, [[1.0], [0.1], [-1.0]], times, 0.01, METHODS[method], watched)
    assert run.status[0] in (fm.Status.NOT_FINITE, fm.Status.NOT_CONVERGED)
    assert run.status[1:].tolist() == [fm.Status.OK] * 2
    assert run.records[STOP_CODE].tolist() == [0.0, 1.0, 1.0]
    np.testing.assert_allclose(run.records[STOP_TIME, 1:], 1.21, atol=0.011)
    np.testing.assert_allclose(run.failed[0], 1.0, atol=0.1)
    assert np.isnan(run.failed[1:]).all()
    assert np.isnan(run.states[-1, 0]).all()
    np.testing.assert_allclose(run.states[-1, 1:, 0], run.records[STOP_STATE, 1:])


@pytest.mark.parametrize("method", ["rk4", "ab6"])
def test_no_code_stops_a_state_that_is_not_finite(method: str) -> None:
    """From 1e200 the first step is infinite already, and its code is 2."""
    run = fm.integrate(fm.System(square, ["y"], {}, stop=large), [[1e200], [0.1]], 0.5, 0.1, method)
    assert run.status.tolist() == [fm.Status.NOT_FINITE, fm.Status.OK]
    assert run.stop_code is not None
    assert run.stop_code.tolist() == [0, 0]
    assert run.last is not None
    assert run.last[0, 0] == 1e200


def test_runs_to_a_tolerance_do_not_stop_what_has_failed() -> None:
    system = fm.System(square, ["y"], {}, stop=late)
    run = fm.integrate(system, [[1.0], [0.1], [-1.0]], 3.0, tol=1e-6)
    assert run.status.tolist() == [fm.Status.NOT_FINITE, fm.Status.OK, fm.Status.OK]
    assert run.stop_code is not None
    assert run.stop_time is not None
    assert run.stop_code.tolist() == [0, 1, 1]
    np.testing.assert_allclose(run.stop_time[1:], 1.2, rtol=1e-12)
