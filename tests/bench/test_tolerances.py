"""The study of the estimates: its truth, its cases, and what it says."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fastmech.bench.extrapolation import truth
from fastmech.bench.problem import rest_starts
from fastmech.bench.tolerances import Estimate, estimates, random_case, report
from fastmech.mechanism.lagrange import angular_accelerations
from fastmech.scene import Scene


def test_the_truth_is_that_of_the_bench() -> None:
    problem = rest_starts(8)
    found, uncertainty = truth(problem.scene, problem.starts, problem.t_end)
    assert np.abs(found - problem.truth).max() < 1e-11
    assert uncertainty.max() < 1e-11


def test_the_truth_knows_the_decay() -> None:
    scene, start = Scene(alpha=0.7), np.array([1.0, 0.5, 0.2, -0.1])

    def rates(t, y):
        return np.concatenate([y[2:], angular_accelerations(scene, y[None], t)[0]])

    right = solve_ivp(rates, (0.0, 2.0), start, "Radau", rtol=1e-9, atol=1e-10).y[:, -1]
    assert np.abs(truth(scene, start[None], 2.0)[0][0] - right).max() < 1e-6


@pytest.mark.nojit
def test_cases_differ_and_repeat() -> None:
    first, again = (random_case(np.random.default_rng(3), 4) for _ in range(2))
    assert first[0] == again[0]
    np.testing.assert_array_equal(first[1], again[1])
    assert 1e-8 <= first[3] <= 1e-3


@pytest.mark.nojit
def test_what_is_beyond_the_factor_is_listed() -> None:
    good = [Estimate(0, q, 1e-3, "rk4", 2e-4, 1e-4, 1e-13, 0.1) for q in (0.5, 0.99, 1.0)]
    bad = [Estimate(1, q, 1e-3, "rk4", 1e-5, 1e-4, 1e-13, 0.1) for q in (0.5, 0.99, 1.0)]
    text = "\n".join(report(good + bad, 4))
    assert text.count("50%") == 4  # three rows, and one quantile's name
    assert "| 1 | 1 | rk4 | 1.0e-03 | 1.0e-05 | 1.0e-04 | 1e-13 |" in text


def test_estimates_of_a_few_scenes_are_right() -> None:
    found = estimates(4, 24, lambda done: None)
    assert len(found) == 12
    assert np.mean([e.right for e in found]) >= 0.9
