"""Where rounding rules: errors by the median of several runs, against extended precision."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from ensembles.references import errors, motions_of, rest_starts

import fastmech as fm
from fastmech.bench.extended import extended_truth
from fastmech.ensembles import rounding
from fastmech.ensembles.doubling import Doubling
from fastmech.ensembles.problem import scene_problem
from fastmech.ensembles.solve import Settings
from fastmech.integrators.methods import find_method
from fastmech.scene import Scene

OUTPUTS = np.array([4.0])
SCENE = Scene(beta=0.0, alpha=0.0)


def rounded(n: int, method: str = "abm12") -> Doubling:
    """Trajectories with a tolerance that doubles cannot keep."""
    starts = rest_starts(n, seed=11)
    settings = Settings(find_method(method), 0.004, (0.0,), bounded=False)
    return Doubling(scene_problem(SCENE, n, {}, "lagrange"), starts, OUTPUTS, settings, 1e-15, 1)


def test_errors_that_rounding_makes_are_told() -> None:
    """Single ones within their scatter: a typical one of six and its distance from their median."""
    doubling = rounded(12)
    solution, estimates, remark = doubling.run(None)
    right, doubts = extended_truth(SCENE, doubling.starts, float(OUTPUTS[-1]))
    true = np.abs(solution.y[-1] - right).max(axis=1)
    known = doubts < 0.25 * true
    assert known.sum() > 8
    assert known[[true.argmax(), estimates.argmax()]].all()
    assert "12 of 12 miss it" in remark
    ratios = estimates[known] / true[known]
    assert 1.0 / 3.0 < np.median(ratios) < 3.0
    assert 1.0 / 3.0 < estimates.max() / true.max() < 3.0
    assert np.mean((ratios > 0.1) & (ratios < 10.0)) > 0.9


def test_parts_make_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    whole, estimates, _ = rounded(40).run(None)
    monkeypatch.setattr(rounding, "PART", 16 * 4)
    parts, others, _ = rounded(40).run(None)
    np.testing.assert_array_equal(whole.y, parts.y)
    np.testing.assert_array_equal(estimates, others)


def test_a_run_that_is_lost_leaves_what_was_there() -> None:
    """The longest of the six steps is beyond the method's stability: their median tells nothing."""
    doubling = rounded(4)
    doubling.settings = replace(doubling.settings, dt=3.0)
    doubling.shares = np.ones(4)
    told = list(rounding.typical_runs(doubling, np.arange(4)))
    assert sum(typical.who.size for typical in told) == 4
    assert all(np.isinf(typical.error).all() for typical in told)


@pytest.mark.parametrize("quantile", [0.99, 1.0])
@pytest.mark.parametrize("rate", [3e4, 1e5, 1e6, 1e12])
def test_starts_too_fast_for_steps_leave_others_alone(rate: float, quantile: float) -> None:
    """Whatever steps the tolerance asks for: nobody waits for them, and the estimate is the others'."""
    starts = rest_starts(60, seed=3)
    right = fm.integrate(SCENE, starts, 10.0, tol=1e-5, quantile=quantile)
    with_fast = np.insert(starts, 7, [1.0, 0.0, rate, 0.0], axis=0)
    run, others = fm.integrate(SCENE, with_fast, 10.0, tol=1e-5, quantile=quantile), np.arange(61) != 7
    np.testing.assert_array_equal(run.status == fm.Status.STEP_TOO_LARGE, ~others)
    np.testing.assert_array_equal(run.y[:, others], right.y)
    np.testing.assert_array_equal(run.last[~others], with_fast[~others])
    assert run.error_estimate == right.error_estimate
    assert run.reason == right.reason
    assert errors(run.y[:, others], motions_of(SCENE, starts, [10.0])).max() < 2e-5
