"""Random starts: uniform in the ball, decided by the seed alone."""

from __future__ import annotations

import numpy as np
import pytest
from disturbance.known import center, equilibria, known, oracle_size
from scipy.stats import kstest

from fastmech.basins.disturbed import disturb
from fastmech.disturbance.motion import uniform_ball, unit_directions
from fastmech.ensembles.integrate import integrate

SCENE = known("table_1")[0]
SHORT = {"t_end": 0.2, "dt": 0.05}


def test_starts_are_uniform_in_the_ball() -> None:
    """(size / radius)^4 is uniform on [0, 1]; so is every direction: the ball's marginals are known."""
    (e,) = equilibria("table_1", 0)
    run = disturb(SCENE, e, 20_000, radius=0.4, seed=5, **SHORT)
    sizes = oracle_size(SCENE, e, run.starts - center(e))
    assert sizes.max() <= 0.4 * (1 + 1e-12)
    assert kstest((sizes / 0.4) ** 4, "uniform").pvalue > 0.01
    points = uniform_ball(np.random.default_rng(5), 20_000)
    np.testing.assert_allclose(points.T @ points / 20_000, np.eye(4) / 6, atol=0.004)  # E x^2 = 1/(d + 2)
    np.testing.assert_allclose(points.mean(axis=0), 0.0, atol=0.012)


@pytest.mark.nojit
def test_directions_are_isotropic() -> None:
    """On the three-sphere (1 + x)/2 follows Beta(3/2, 3/2)."""
    directions = unit_directions(np.random.default_rng(3), 5000)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, rtol=1e-14)
    for x in directions.T:
        assert kstest((1 + x) / 2, "beta", args=(1.5, 1.5)).pvalue > 0.01


def test_the_seed_decides_and_threads_do_not() -> None:
    (e,) = equilibria("table_1", 0)
    first = disturb(SCENE, e, 700, seed=1, threads=1, t_end=5.0)
    again = disturb(SCENE, e, 700, seed=1, threads=2, t_end=5.0)
    other = disturb(SCENE, e, 700, seed=2, threads=1, t_end=5.0)
    for name in ("starts", "final", "outcome", "end_index", "turns", "time_to_return", "excursion"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
    assert not np.any(first.starts == other.starts)


@pytest.mark.nojit
@pytest.mark.parametrize("n", [1, 2, 3])
def test_starts_are_where_the_motions_began(n: int) -> None:
    (e,) = equilibria("table_1", 0)
    run = disturb(SCENE, e, n, radius=0.3, **SHORT)
    assert np.all(oracle_size(SCENE, e, run.starts - center(e)) <= 0.3)
    again = integrate(SCENE, run.starts, 0.2, dt=0.05, method="dop853")
    np.testing.assert_array_equal(again.y[0], run.final)


def test_starts_of_a_last_block_with_a_single_lane() -> None:
    (e,) = equilibria("table_1", 0)
    run = disturb(SCENE, e, 257, radius=0.3, **SHORT)
    np.testing.assert_array_equal(integrate(SCENE, run.starts, 0.2, dt=0.05, method="dop853").y[0], run.final)


@pytest.mark.nojit
def test_a_part_is_that_part_of_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """Parts within and across streams of random numbers, of which an ensemble of 20 has three here."""
    monkeypatch.setattr("fastmech.basins.disturbed.STREAM", 8)
    (e,) = equilibria("table_1", 0)
    whole = disturb(SCENE, e, 20, **SHORT)
    assert len(np.unique(whole.starts, axis=0)) == 20
    for part in (slice(0, 8), slice(3, 5), slice(6, 18), slice(19, 20), slice(None)):
        found = disturb(SCENE, e, 20, part=part, **SHORT)
        for name in ("starts", "final", "outcome", "turns", "time_to_return", "excursion"):
            np.testing.assert_array_equal(getattr(found, name), getattr(whole, name)[part])
