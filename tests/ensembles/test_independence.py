"""A lane's result depends on its own start alone, to the last bit."""

from __future__ import annotations

import os

import numpy as np
import pytest
from ensembles.starts import Floats, random_starts
from numpy.typing import NDArray

from fastmech.ensembles import lanes, run
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.run import run_ensemble
from fastmech.ensembles.status import Status
from fastmech.ensembles.threads import thread_count
from fastmech.integrators.methods import METHODS
from fastmech.scene import Scene
from fastmech.slider.coefficients import reduce
from fastmech.slider.kernels.select import right_hand_side

SCENE = Scene()
STARTS = random_starts(1001)
STARTS.flags.writeable = False
FORMULATIONS = pytest.mark.parametrize("formulation", ["lagrange", "hamilton"])


def states(block_lanes: int, threads: int, method: str = "rk4", starts: Floats = STARTS) -> Floats:
    params, times = np.array(reduce(SCENE)), np.array([0.0, 0.3, 0.5])
    rhs, tableau = right_hand_side(reduce(SCENE)), METHODS[method]
    return run_ensemble(
        rhs, params, starts, times, 0.05, tableau, threads=threads, block_lanes=block_lanes
    ).states


@pytest.mark.parametrize("method", ["rk4", "dop853", "gauss6", "radau5", "sdirk4"])
@pytest.mark.parametrize("block_lanes", [1, 7, 64, 256, 1000, 5000])
def test_block_size_does_not_matter(method: str, block_lanes: int) -> None:
    np.testing.assert_array_equal(states(block_lanes, 1, method), states(256, 1, method))


@pytest.mark.parametrize("method", ["rk4", "ab5", "ab6", "ab7", "ab8", "abm8", "abm10", "abm12"])
def test_calls_tasks_order_and_companions_do_not_matter(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Some far out, some lost; each with its own parameters, under a force of time."""
    starts = STARTS[:201].copy()
    starts[17, 0], starts[60, 1], starts[61, 0], starts[130, 3] = 1e17, 6e5, -1e154, 2e5
    random = np.random.default_rng(2)
    forces = zip(random.uniform(-300.0, 300.0, 201), random.uniform(1.0, 9.0, 201), strict=True)
    own = np.array([reduce(Scene(F0=force, alpha=alpha)) for force, alpha in forces])

    def through(which: NDArray[np.int64], threads: int) -> Floats:
        rhs, times = right_hand_side(reduce(SCENE)), np.array([0.0, 0.7, 0.7, 1.9, 4.0])
        return run_ensemble(
            rhs, own[which], starts[which], times, 0.004, METHODS[method], threads=threads
        ).states

    right = through(np.arange(201), 1)
    monkeypatch.setattr(lanes, "TASK_BYTES", 2**12)
    monkeypatch.setattr(run, "CALL_EVALUATIONS", 1)
    monkeypatch.setattr(run, "LANE_EVALUATIONS", 1)
    monkeypatch.setattr(run, "CALL_STEPS", 100)
    order = random.permutation(201)
    np.testing.assert_array_equal(through(order, 2), right[:, order])
    for which in (np.array([61]), np.array([130, 17, 60]), order[:33]):
        np.testing.assert_array_equal(through(which, 1), right[:, which])


@pytest.mark.parametrize("threads", [2, 3, 16])
def test_number_of_threads_does_not_matter(threads: int) -> None:
    np.testing.assert_array_equal(states(64, threads), states(64, 1))


@pytest.mark.nojit
def test_blocks_and_threads_small() -> None:
    starts = STARTS[:9]
    right = states(256, 1, starts=starts)
    for block_lanes, threads in ((1, 1), (2, 2), (4, 3)):
        np.testing.assert_array_equal(states(block_lanes, threads, starts=starts), right)


@FORMULATIONS
@pytest.mark.parametrize("threads", [1, 2, None])
def test_ensemble_equals_single_runs(formulation: str, threads: int | None) -> None:
    times = [0.0, 0.2, 0.5]
    many = integrate(SCENE, STARTS, t_eval=times, formulation=formulation, threads=threads)
    for lane in (0, 1, 255, 256, 511, 999, 1000):
        one = integrate(SCENE, STARTS[lane], t_eval=times, formulation=formulation)
        np.testing.assert_array_equal(one.y[:, 0], many.y[:, lane])


@FORMULATIONS
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_bad_start_leaves_others_alone(formulation: str, bad: float) -> None:
    right = integrate(SCENE, STARTS[:40], 0.5, formulation=formulation)
    for column in range(4):
        starts = STARTS[:40].copy()
        starts[13, column] = bad
        run = integrate(SCENE, starts, 0.5, formulation=formulation)
        others = np.arange(40) != 13
        np.testing.assert_array_equal(run.y[:, others], right.y[:, others])
        np.testing.assert_array_equal(run.status, np.where(others, Status.OK, Status.START_NOT_FINITE))


@pytest.mark.nojit
@pytest.mark.parametrize("block_lanes", [1, 2, 256])
def test_starts_are_left_as_they_are(block_lanes: int) -> None:
    """Three lanes: the last block of two has a single lane, whose column is contiguous as it stands."""
    starts = STARTS[:3].copy()
    states(block_lanes, 1, starts=starts)
    np.testing.assert_array_equal(starts, STARTS[:3])


@pytest.mark.nojit
def test_results_share_no_memory() -> None:
    starts, times = STARTS[:3].copy(), np.array([0.0, 0.1])
    kept = starts.copy()
    first = integrate(SCENE, starts, t_eval=times)
    second = integrate(SCENE, starts, t_eval=times)
    arrays = [starts, times, first.y, first.t, first.status, second.y, second.t, second.status]
    for i, a in enumerate(arrays):
        assert not any(np.shares_memory(a, b) for b in arrays[i + 1 :])
    np.testing.assert_array_equal(starts, kept)
    before = first.y.copy()
    second.y[:] = starts[:] = times[:] = 7.0
    np.testing.assert_array_equal(first.y, before)
    np.testing.assert_array_equal(first.t, [0.0, 0.1])


def test_default_threads_are_the_processors_allowed() -> None:
    assert thread_count(5) == 5
    if hasattr(os, "sched_getaffinity"):
        assert thread_count(None) == len(os.sched_getaffinity(0))
    else:
        assert thread_count(None) == os.cpu_count()
