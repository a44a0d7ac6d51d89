from __future__ import annotations

import numpy as np
import pytest

from fastmech.basins.measures.fractions import (
    basin_fractions,
    basin_stability,
    finite_time_basin_stability,
    wilson,
)
from fastmech.errors import InputError


def test_wilson_interval_solves_its_defining_equation() -> None:
    """Its ends are the p whose normal approximation just reaches k/n: (k/n - p)^2 = z^2 p (1 - p)/n."""
    for k, n in ((0, 10), (1, 10), (5, 10), (37, 200), (200, 200)):
        for p in wilson(np.array(k), n):
            assert (k / n - p) ** 2 == pytest.approx(1.959963984540054**2 * p * (1 - p) / n, abs=1e-14)


def test_wilson_intervals_cover_95_percent() -> None:
    """20,000 experiments of 200 starts with random true stabilities, and at four true ones."""
    rng = np.random.default_rng(11)
    p = rng.random(20_000)
    lower, upper = wilson(rng.binomial(200, p), 200)
    covered = np.mean((lower <= p) & (p <= upper))
    assert abs(covered - 0.95) < 4 * np.sqrt(0.95 * 0.05 / 20_000)
    for true in (0.02, 0.1, 0.5, 0.97):  # at one p coverage jumps with n: Brown, Cai, DasGupta 2001
        lower, upper = wilson(rng.binomial(200, true, 20_000), 200)
        assert 0.93 < np.mean((lower <= true) & (true <= upper)) < 0.98


def test_stability_of_a_disc_is_its_area() -> None:
    """400 experiments with 500 starts each: the share of the square that a disc covers is pi/16."""
    starts = np.random.default_rng(3).uniform(-1, 1, (400, 500, 2))
    labels = ((starts**2).sum(axis=2) < 0.25).astype(int)
    shares = [basin_stability(row, 1) for row in labels]
    covered = np.mean([s.lower <= np.pi / 16 <= s.upper for s in shares])
    assert abs(covered - 0.95) < 4 * np.sqrt(0.95 * 0.05 / 400)


def test_missing_labels_are_counted() -> None:
    which, shares = basin_fractions(np.array([[4, 4, -1], [9, -2, 4]]))
    assert which.tolist() == [4, 9]
    assert shares.count.tolist() == [3, 1]
    assert (shares.n, shares.missing) == (6, 2)
    np.testing.assert_array_equal(shares.fraction, [3 / 6, 1 / 6])
    np.testing.assert_array_equal(shares.at_most, [5 / 6, 3 / 6])
    np.testing.assert_array_equal(shares.lower, wilson(np.array([3, 1]), 6)[0])
    np.testing.assert_array_equal(shares.upper, wilson(np.array([5, 3]), 6)[1])
    alone = basin_stability([4, 4, -1, 9, -2, 4], 9)
    assert (alone.lower, alone.upper) == (shares.lower[1], shares.upper[1])


@pytest.mark.parametrize("hidden", [0, 1])
def test_intervals_cover_whichever_labels_are_missing(hidden: int) -> None:
    """Of 300 starts, half of which return, a third of one kind is not decided: the truth stays inside."""
    rng = np.random.default_rng(5)
    labels = rng.integers(0, 2, (2000, 300))
    labels = np.where((labels == hidden) & (rng.random(labels.shape) < 0.33), -1, labels)
    shares = [basin_stability(row, 0) for row in labels]
    assert np.mean([s.lower <= 0.5 <= s.upper for s in shares]) > 0.95


def test_a_map_without_labels_has_no_fractions() -> None:
    which, shares = basin_fractions([-1, -1])
    assert which.size == shares.fraction.size == 0
    assert shares.missing == 2


def test_finite_time_stability_rises_to_the_stability() -> None:
    labels, times = [0, 0, 0, 1, -1], [3.0, 1.0, 2.0, 0.5, np.nan]
    shares = finite_time_basin_stability(labels, times, 0, [0.5, 1.0, 2.5, np.inf])
    np.testing.assert_array_equal(shares.fraction, [0.0, 0.2, 0.4, 0.6])
    assert shares.fraction[-1] == basin_stability(labels, 0).fraction
    assert shares.missing == 1


def test_return_times_of_a_decay_follow_its_law() -> None:
    """x' = -x from x uniform in [0, 1] is within r after ln(x/r): P(T) = min(1, r e^T)."""
    x = np.random.default_rng(8).random(20_000)
    times = np.log(np.maximum(x / 0.1, 1.0))
    horizons = np.array([0.0, 1.0, 2.0, 3.0])
    shares = finite_time_basin_stability(np.zeros(20_000, dtype=int), times, 0, horizons, confidence=0.9999)
    true = np.minimum(1.0, 0.1 * np.exp(horizons))
    assert ((shares.lower <= true) & (true <= shares.upper + 1e-12)).all()


def test_wrong_arguments_are_refused() -> None:
    with pytest.raises(InputError, match=r"^times: has shape \(1,\)"):
        finite_time_basin_stability([0, 0], [1.0], 0, 1.0)
    with pytest.raises(InputError, match=r"^times, horizons: must not be NaN"):
        finite_time_basin_stability([0], [np.nan], 0, 1.0)
    with pytest.raises(InputError, match=r"^confidence = 1\.0: must be less than 1"):
        basin_fractions([0], confidence=1.0)
    with pytest.raises(InputError, match=r"^count: must be integers from 0 to n = 3"):
        wilson(np.array([4]), 3)
