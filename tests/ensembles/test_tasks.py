"""How trajectories are shared in tasks: everyone once, the costliest first, workers busy alike."""

from __future__ import annotations

import numpy as np
import pytest

from fastmech.ensembles.lanes import SHARES, Task, tasks_of

pytestmark = pytest.mark.nojit

TIMES = np.array([0.0, 10.0])


def cost(task: Task) -> int:
    return task.members.size * int(task.way.steps.sum())


def longest_worker(tasks: list[Task], workers: int) -> float:
    """When the last of the workers that take tasks from a queue is done, over an even share of the work."""
    busy = np.zeros(workers)
    for task in tasks:
        busy[np.argmin(busy)] += cost(task)
    return float(busy.max() / busy.mean())


@pytest.mark.parametrize("workers", [1, 2, 3, 8])
@pytest.mark.parametrize("n", [1, 17, 1000, 20_000])
@pytest.mark.parametrize("steps", [1, 2, 12])
def test_everyone_who_is_usable_is_in_one_task(n: int, workers: int, steps: int) -> None:
    random = np.random.default_rng(n)
    dt = 0.02 * 2.0 ** -random.integers(steps, size=n)
    usable = random.uniform(size=n) < 0.9
    tasks = tasks_of(dt, usable, TIMES, workers, 4096)
    together = np.concatenate([task.members for task in tasks]) if tasks else np.arange(0)
    np.testing.assert_array_equal(np.sort(together), np.flatnonzero(usable))
    for task in tasks:
        assert np.unique(dt[task.members]).size == 1
        assert task.way.steps.sum() == round(10.0 / dt[task.members[0]])
        assert task.members.size <= 4096
        assert (np.diff(task.members) > 0).all()
    assert [cost(task) for task in tasks] == sorted(map(cost, tasks), reverse=True)


@pytest.mark.parametrize("workers", [1, 2, 4])
def test_one_step_is_shared_by_all_workers(workers: int) -> None:
    tasks = tasks_of(np.full(8192, 0.02), np.ones(8192, dtype=np.bool_), TIMES, workers, 8192)
    assert [task.members.size for task in tasks] == [8192 // workers] * workers


@pytest.mark.parametrize("workers", [2, 4])
def test_of_many_steps_workers_are_busy_alike_and_tasks_few(workers: int) -> None:
    random = np.random.default_rng(7)
    for _ in range(50):
        rungs = random.integers(2, 16)
        dt = 0.02 * 2.0 ** (-random.integers(rungs, size=8192) / 4)
        tasks = tasks_of(dt, np.ones(8192, dtype=np.bool_), TIMES, workers, 8192)
        assert longest_worker(tasks, workers) < 1.0 + 1.0 / SHARES
        assert len(tasks) <= rungs + SHARES * workers
