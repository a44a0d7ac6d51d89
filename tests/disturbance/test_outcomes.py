"""Where disturbed trajectories end, checked where the answer is known and against SciPy."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from disturbance.known import center, equilibria, known, oracle_size, scipy_motion

from fastmech.disturbance.ensemble import DisturbedEnsemble, Outcome, disturb
from fastmech.equilibria.find import find_equilibria
from fastmech.errors import InputError
from fastmech.scene import Scene

SCENE = known("table_1")[0]


def resting_place(run: DisturbedEnsemble) -> Any:
    """Angles of the equilibrium and the turns that a run names for every lane that rests."""
    angles = np.array([[e.phi, e.theta] for e in run.equilibria])
    rests = run.end_index >= 0
    return rests, angles[run.end_index] + 2 * np.pi * run.turns


def test_small_disturbances_of_the_stable_equilibrium_return() -> None:
    (stable,) = equilibria("table_1", 0)
    run = disturb(SCENE, stable, 300, radius=0.05)
    assert np.all(run.outcome == Outcome.RETURNED)
    assert run.share_returned == 1.0
    assert run.equilibria[run.index].kind == "minimum"
    assert np.all(run.end_index == run.index)
    assert not run.turns.any()
    assert np.all(oracle_size(SCENE, stable, run.final - center(stable)) <= 0.01)


@pytest.mark.parametrize("morse_index", [1, 2])
def test_disturbances_of_unstable_equilibria_never_return(morse_index: int) -> None:
    """Table 1 with constant force has one minimum: all that has come to rest is there."""
    for unstable in equilibria("table_1", morse_index):
        run = disturb(SCENE, unstable, 200, radius=0.05, t_end=300.0)
        assert run.share_returned == 0.0
        assert np.all(np.isnan(run.time_to_return))
        assert np.mean(run.outcome == Outcome.ELSEWHERE) > 0.95
        rests, place = resting_place(run)
        assert {run.equilibria[i].kind for i in run.end_index[rests]} == {"minimum"}
        assert np.abs(run.final[rests, :2] - place[rests]).max() < 0.02


def test_every_outcome_agrees_with_scipy() -> None:
    """Large disturbances of a bistable scene: end, turns and outcome of eight lanes."""
    scene, angles, indices = known("bistable")
    minima = angles[[index == 0 for index in indices]]
    first = equilibria("bistable", 0)[0]
    run = disturb(scene, first, 400, radius=2.5, seed=4, t_end=40.0, dt=0.01, return_radius=0.2)
    assert {Outcome.RETURNED, Outcome.ELSEWHERE} <= set(run.outcome)
    assert np.any(run.turns != 0)
    for lane in [*range(5), *np.flatnonzero((run.turns != 0).any(axis=1))[:3]]:
        end = scipy_motion(scene, run.starts[lane], 40.0, 1e-9).y[:, -1]
        np.testing.assert_allclose(run.final[lane], end, rtol=0, atol=1e-5)
        away = end[:2] - minima
        turns = np.round(away / (2 * np.pi))
        near = np.argmin(np.abs(away - 2 * np.pi * turns).max(axis=1))
        if run.outcome[lane] == Outcome.UNDECIDED:
            assert run.end_index[lane] == -1
            continue
        np.testing.assert_array_equal(run.turns[lane], turns[near])
        e = run.equilibria[run.end_index[lane]]
        np.testing.assert_allclose([e.phi, e.theta], minima[near], atol=1e-12)
        home = np.allclose(minima[near], [first.phi, first.theta]) and not turns[near].any()
        assert run.outcome[lane] == (Outcome.RETURNED if home else Outcome.ELSEWHERE)


@pytest.mark.nojit
def test_the_unstable_balance_the_undecided_and_the_exploded_are_told_apart() -> None:
    (stable,), (maximum,) = equilibria("table_1", 0), equilibria("table_1", 2)
    still_there = disturb(SCENE, maximum, 3, radius=1e-6, t_end=0.5, dt=0.1)
    assert np.all(still_there.outcome == Outcome.AT_UNSTABLE)
    assert np.all(still_there.end_index == still_there.index)
    moving = disturb(SCENE, stable, 3, radius=0.5, t_end=0.5, dt=0.1)
    assert np.all(moving.outcome == Outcome.UNDECIDED)
    assert np.all(moving.end_index == -1)
    assert np.all(np.isnan(moving.time_to_return))


def test_a_step_too_large_is_not_finite() -> None:
    (stable,) = equilibria("table_1", 0)
    run = disturb(SCENE.replace(c1=162.5), stable, 5, t_end=2000.0, dt=2.0, method="euler")
    assert np.all(run.outcome == Outcome.NOT_FINITE)
    assert run.share_returned == 0.0


def test_time_to_return_and_excursions_against_dense_solutions() -> None:
    """The first step inside for good, and the largest departures over all steps and the start."""
    (stable,) = equilibria("table_1", 0)
    dt, t_end = 0.05, 120.0
    run = disturb(SCENE, stable, 40, radius=0.6, seed=8, t_end=t_end, dt=dt)
    times = dt * np.arange(2401)
    for lane in range(3):
        assert run.outcome[lane] == Outcome.RETURNED
        departures = scipy_motion(SCENE, run.starts[lane], t_end, 1e-10).sol(times).T - center(stable)
        outside = np.flatnonzero(oracle_size(SCENE, stable, departures) > 0.01)
        assert run.time_to_return[lane] == pytest.approx(times[outside[-1] + 1], abs=1e-9)
        np.testing.assert_allclose(run.excursion[lane], np.abs(departures[:, :2]).max(axis=0), rtol=1e-6)


def test_a_run_that_ends_inside_by_chance_has_not_returned() -> None:
    """At t_end some are in the ball and will leave it again: only what cannot leave has returned."""
    (stable,) = equilibria("table_1", 0)
    early = disturb(SCENE, stable, 2000, radius=0.5, t_end=25.0)
    late = disturb(SCENE, stable, 2000, radius=0.5, t_end=60.0)
    returned = early.outcome == Outcome.RETURNED
    assert 0 < returned.sum() < 2000
    np.testing.assert_array_equal(early.time_to_return[returned], late.time_to_return[returned])


def test_balls_that_would_meet_are_refused() -> None:
    (stable,) = equilibria("table_1", 0)
    with pytest.raises(InputError, match=r"^return_radius = 5 rad: must not exceed"):
        disturb(SCENE, stable, 1, return_radius=5.0)


def test_equilibria_and_seeds_have_streams_of_their_own() -> None:
    (first,), second = equilibria("table_1", 0), equilibria("table_1", 1)[0]
    ball = [
        run.size.to_ball.T @ (run.starts - center(e)).T
        for e, seed in ((first, 7), (second, 7), (first, 8), (second, 6))
        for run in [disturb(SCENE, e, 5, seed=seed, t_end=0.1)]
    ]
    for i in range(len(ball)):
        for j in range(i):
            assert not np.isclose(ball[i], ball[j]).any()


def test_a_disturbance_inside_the_ball_returns_at_once_or_after_it_left() -> None:
    (stable,) = equilibria("table_1", 0)
    run = disturb(SCENE, stable, 50, radius=0.001, t_end=1.0, return_radius=0.5)
    np.testing.assert_array_equal(run.time_to_return, 0.0)
    assert np.all(run.excursion >= np.abs(run.starts - center(stable))[:, :2])


def test_force_free_scene_with_a_decay_rate_is_welcome() -> None:
    scene = known("table_1_unforced")[0].replace(alpha=0.7)
    minimum = next(e for e in find_equilibria(scene) if e.kind == "minimum")
    assert disturb(scene, minimum, 50, radius=0.05).share_returned > 0.9


@pytest.mark.nojit
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"n": 0}, "n = 0: must be an integer not less than 1"),
        ({"n": 2.5}, "n = 2.5: must be an integer not less than 1"),
        ({"seed": -1}, "seed = -1: must be an integer not less than 0"),
        ({"radius": 0.0}, "radius = 0.0: must be a finite number of rad greater than 0"),
        ({"return_radius": -0.1}, "return_radius = -0.1: must be a finite number of rad greater than 0"),
        ({"t_end": np.inf}, "t_end = inf: must be a finite number of s greater than 0"),
        ({"dt": "x"}, "dt = 'x': must be a finite number of s greater than 0"),
        ({"method": "rk5"}, "method = 'rk5': unknown; known: euler"),
        ({"threads": 0}, "threads = 0: must be an integer not less than 1"),
        ({"progress": 3}, "progress = 3: must be a function of the number of finished trajectories"),
    ],
)
def test_wrong_arguments_are_refused(arguments: dict[str, Any], message: str) -> None:
    (stable,) = equilibria("table_1", 0)
    with pytest.raises(InputError, match=f"^{re.escape(message)}"):
        disturb(SCENE, stable, **({"n": 1, "t_end": 0.1} | arguments))


@pytest.mark.nojit
def test_a_decaying_force_and_a_foreign_equilibrium_are_refused() -> None:
    (stable,) = equilibria("table_1", 0)
    with pytest.raises(
        InputError, match=r"^scene\.alpha = 0\.7: must be 0 1/s .*replace\(alpha=0\.0\) and find"
    ):
        disturb(SCENE.replace(alpha=0.7), stable, 1)
    with pytest.raises(
        InputError,
        match=r"^equilibrium = \(1\.45058, -0\.232575\) rad, F = 100 N: must be one of this scene's",
    ):
        disturb(Scene(F0=-100.0, alpha=0.0), stable, 1)


@pytest.mark.nojit
def test_every_outcome_has_its_own_advice() -> None:
    assert len({outcome.advice for outcome in Outcome}) == len(Outcome)


def test_failed_trajectories_make_no_noise() -> None:
    """A step far too large: some end infinite, and nothing but their outcome says so."""
    scene = SCENE.replace(m3=0.5, beta=30.0)
    (stable,) = [e for e in find_equilibria(scene) if e.kind == "minimum"]
    run = disturb(scene, stable, 100, radius=1.0, t_end=3.0, dt=0.5, method="rk4")
    assert {Outcome.NOT_FINITE, Outcome.STEP_TOO_LARGE} & set(run.outcome.tolist())
