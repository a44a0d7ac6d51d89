"""What a run shows of its steps: who is right has no status, who is wrong has one, alone as in company."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from ensembles.references import motions_of, rest_starts

import fastmech as fm
from fastmech.ensembles.problem import motion_problem
from fastmech.ensembles.run import run_ensemble
from fastmech.ensembles.solve import TURNED, TURNS, may_turn, watched
from fastmech.integrators.methods import METHODS

TOO_LARGE = fm.Status.STEP_TOO_LARGE
BOX = np.random.default_rng(1).uniform([0.5, -1.0], [2.5, 1.0], (512, 2))


def run(scene: fm.Scene, starts: np.ndarray, t_end: float, **options: Any) -> fm.Trajectories:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fm.StepWarning)
        return fm.integrate(scene, starts, t_end, **options)


@pytest.mark.parametrize(("alpha", "dt"), [(0.7, 0.02), (0.0, 0.0165), (0.0, 0.015)])
@pytest.mark.slow
def test_roots_that_do_not_show_are_no_failure(alpha: float, dt: float) -> None:
    """At the minima abm12's spurious roots grow in such steps; these motions are right to 1e-6."""
    scene, starts = fm.Scene(alpha=alpha), np.column_stack([BOX, np.zeros((512, 2))])
    found = run(scene, starts, 10.0, dt=dt, method="abm12", fit=True)
    fine = run(scene, starts, 10.0, dt=1e-3, method="dop853").y[-1]
    some = slice(0, 512, 64)
    np.testing.assert_allclose(fine[some], motions_of(scene, starts[some], [10.0])[0], atol=1e-9)
    assert np.abs(found.y[-1] - fine).max() < 1e-6
    assert not found.status.any()


@pytest.mark.parametrize(
    ("scene", "dt"),
    [(fm.Scene(c1=2000.0, c2=3000.0, alpha=0.0), 0.1), (fm.Scene(c2=1100 / 3, alpha=0.0), 0.5)],
    ids=["stiff springs", "paper"],
)
def test_who_turns_too_far_is_told(scene: fm.Scene, dt: float) -> None:
    """RK4 with steps that no body can be followed in: whoever comes out wrong by 1 rad has a status."""
    starts = rest_starts(256)
    found = run(scene, starts, 10.0, dt=dt, method="rk4")
    fine = run(scene, starts, 10.0, dt=2e-3, method="dop853").y[-1]
    some = slice(0, 256, 32)
    np.testing.assert_allclose(fine[some], motions_of(scene, starts[some], [10.0])[0], atol=1e-8)
    with np.errstate(invalid="ignore"):
        wrong = ~(np.abs(found.y[-1] - fine)[:, :2].max(axis=1) < 1.0)
    assert wrong.sum() > 40
    assert (found.status[wrong] != fm.Status.OK).all()
    assert (found.status == TOO_LARGE).any()


@pytest.mark.parametrize("formulation", ["lagrange", "hamilton"])
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_turns_are_those_between_the_steps(formulation: str, dtype: str) -> None:
    """The first included, which begins at the start."""
    starts, precision = rest_starts(30), np.float32 if dtype == "float32" else np.float64
    problem = motion_problem(fm.Scene(), 30, {}, formulation)
    clock = np.linspace(0.0, 2.0, 41)
    seen = run_ensemble(
        problem.rhs, problem.params, starts, clock, 0.05, METHODS["rk4"], TURNS, precision=precision
    )
    states = np.concatenate([problem.inward(starts).astype(precision)[None], seen.states])
    turns = np.abs(np.diff(states[:, :, :2], axis=0)).max(axis=(0, 2))
    assert turns.min() > 0.0
    np.testing.assert_array_equal(seen.records[TURNED], turns)


@pytest.mark.parametrize(("method", "dt"), [("rk4", 0.2), ("ab6", 0.02), ("abm8", 0.06)])
@pytest.mark.parametrize("formulation", ["lagrange", "hamilton"])
@pytest.mark.slow
def test_statuses_know_no_company(method: str, dt: float, formulation: str) -> None:
    """Parameters that all share or that are each one's own, one thread or two, one by one or all together."""
    scene, starts = fm.Scene(alpha=0.0), rest_starts(70, seed=4)
    options: dict[str, Any] = {"dt": dt, "method": method, "formulation": formulation}
    together = run(scene, starts, 8.0, threads=1, **options).status
    assert {fm.Status.OK, TOO_LARGE} <= set(together)
    own = {"c1": np.full(70, scene.c1)}
    np.testing.assert_array_equal(run(scene, starts, 8.0, parameters=own, **options).status, together)
    np.testing.assert_array_equal(run(scene, starts, 8.0, threads=2, **options).status, together)
    for k in range(0, 70, 5):
        assert run(scene, starts[k : k + 1], 8.0, **options).status[0] == together[k]


def test_turns_before_a_new_fit_count() -> None:
    """A motion that is fast at first and slow later, with steps fitted anew on the way."""
    scene = fm.Scene(c1=2000.0, c2=3000.0, alpha=0.0, beta=400.0)
    starts = rest_starts(64, seed=2)
    once = run(scene, starts, 12.0, dt=0.3, method="dop853", fit=[0.0, 6.0])
    late = run(scene, once.y[-1], 6.0, dt=0.3, method="dop853", fit=True)
    assert ((once.status == TOO_LARGE) & (late.status == fm.Status.OK)).any()


def test_no_body_turns_faster_than_its_energy_allows() -> None:
    """By SciPy; and where nobody can turn too far in a step, nobody is watched."""
    starts, times = rest_starts(24, seed=5), np.linspace(0.0, 6.0, 1201)
    for scene in (fm.Scene(alpha=0.0), fm.Scene(m1=0.5, m2=20.0, beta=0.0), fm.Scene(F0=300.0, alpha=0.4)):
        problem = motion_problem(scene, len(starts), {}, "lagrange")
        assert problem.bounds is not None
        rates = np.abs(motions_of(scene, starts, times)[:, :, 2:]).max(axis=(0, 2))
        assert may_turn(problem.bounds, starts, 1.0 / rates * (1.0 + 1e-9)).all()
        assert not may_turn(problem.bounds, starts, 0.01 / rates).any()
        assert watched(problem, starts, 0.01 / float(rates.max())) is problem
        assert watched(problem, starts, 1.0 / float(rates.min()) * (1.0 + 1e-9)).observation is TURNS


@pytest.mark.slow
def test_runs_that_always_start_anew_are_watched() -> None:
    """Uneven outputs leave an Adams method to its starter, and a single step is the first one."""
    scene, starts = fm.Scene(c1=2000.0, c2=3000.0, alpha=0.0), rest_starts(200)
    times = np.cumsum(np.random.default_rng(3).uniform(0.05, 0.1, 40))
    for method in ("abm8", "ab6"):
        found = run(scene, starts, float(times[-1]), t_eval=times, dt=0.1, method=method)
        fine = run(scene, starts, float(times[-1]), dt=1e-3, method="dop853").y[-1]
        wrong = ~(np.abs(found.y[-1] - fine)[:, :2].max(axis=1) < 1.0)
        assert wrong.any()
        assert (found.status[wrong] != fm.Status.OK).all()
    step = run(scene, starts, 0.1, dt=0.1, method="rk4")
    turned = np.abs(step.y[-1] - starts)[:, :2].max(axis=1) > 1.0
    assert turned.any()
    assert (step.status[turned] == TOO_LARGE).all()
