"""The study of the estimates: its truth, its cases, and what it says."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fastmech.scene import Scene
from fastmech.slider.lagrange import angular_accelerations
from fastmech.studies.bench.measure import fast_starts
from fastmech.studies.bench.tolerances import (
    Estimate,
    estimates,
    extended_truth,
    random_case,
    report,
    scene_rates,
)


@pytest.mark.skipif(np.finfo(np.longdouble).eps > 1e-18, reason="longdouble is no more than double here")
def test_extended_precision_knows_every_digit_of_a_double() -> None:
    """Passages close to saddles magnify rounding; the reference has 24 digits."""
    problem = fast_starts(4)
    found, uncertainty = extended_truth(scene_rates(problem.scene), problem.starts, problem.t_end)
    assert np.abs(found - problem.truth).max() < 1e-14
    assert uncertainty.max() < 1e-14


@pytest.mark.nojit
def test_extended_precision_knows_the_decay() -> None:
    scene, start = Scene(alpha=0.7), np.array([1.0, 0.5, 0.2, -0.1])

    def rates(t, y):
        return np.concatenate([y[2:], angular_accelerations(scene, y[None], t)[0]])

    right = solve_ivp(rates, (0.0, 0.5), start, "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    assert np.abs(extended_truth(scene_rates(scene), start[None], 0.5)[0][0] - right).max() < 1e-9


@pytest.mark.nojit
def test_cases_differ_and_repeat() -> None:
    first, again = (random_case(np.random.default_rng(3), 4) for _ in range(2))
    assert first[0] == again[0]
    np.testing.assert_array_equal(first[1], again[1])
    assert 1e-8 <= first[3] <= 1e-3


@pytest.mark.nojit
def test_what_is_beyond_the_factor_is_listed() -> None:
    good = [Estimate(0, q, 1e-3, "rk4", 2e-4, 1e-4, 1e-13) for q in (0.5, 0.99, 1.0)]
    bad = [Estimate(1, q, 1e-3, "rk4", 1e-5, 1e-4, 1e-13) for q in (0.5, 0.99, 1.0)]
    text = "\n".join(report(good + bad, 4))
    assert text.count("| 2 of 2 | 50% | 100% | 0% | 0% |") == 3
    assert "| 1 | 1 | rk4 | 1.0e-03 | 1.0e-05 | 1.0e-04 | 1e-13 | estimate too small |" in text


@pytest.mark.nojit
def test_a_truth_that_is_not_known_is_counted_apart() -> None:
    good = Estimate(0, 1.0, 1e-3, "rk4", 2e-4, 1e-4, 1e-13)
    unknown = Estimate(1, 1.0, 1e-3, "rk4", 1e-5, 1e-4, 2e-5)
    text = "\n".join(report([good, unknown], 4))
    assert "| largest error | 1 of 2 | 100% | 100% | 0% | 0% | 2 | 2 | 2 |" in text
    assert "| 1 | 1 | rk4 | 1.0e-03 | 1.0e-05 | 1.0e-04 | 2e-05 | truth not known |" in text


@pytest.mark.nojit
def test_a_miss_that_is_said_is_told_from_one_that_is_not() -> None:
    said = Estimate(0, 1.0, 1e-3, "rk4", 2e-3, 4e-3, 1e-13)
    unsaid = Estimate(1, 1.0, 1e-3, "rk4", 1e-4, 4e-3, 1e-13)
    assert said.verdict == "misses `tol` and says so"
    assert unsaid.verdict == "estimate too small, misses `tol` unsaid"
    text = "\n".join(report([said, unsaid], 4))
    assert "| largest error | 2 of 2 | 50% | 0% | 50% | 50% |" in text


@pytest.mark.slow
def test_estimates_of_a_few_scenes_are_right() -> None:
    found = estimates(2, 4, lambda done: None)
    assert len(found) == 6
    assert all(e.known for e in found)
    assert np.mean([e.right for e in found]) >= 0.9
