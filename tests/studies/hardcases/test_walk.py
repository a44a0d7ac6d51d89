"""What a method claims, and what one that claims nothing must end with."""

from __future__ import annotations

import numpy as np
import pytest

from fastmech.ensembles.integrate import integrate
from fastmech.integrators.methods import METHODS, Adams, ImplicitRungeKutta, RungeKutta
from fastmech.scene import Scene
from fastmech.step_limits.warning import step_warning
from fastmech.studies.hardcases.walk import (
    FAMILIES,
    REFUSED,
    ROUNDED,
    Goal,
    admitted_step,
    claimed_row,
    status_row,
    walked,
)

SCENE = Scene(c2=1100 / 3, alpha=0.0)
START = np.array([1.0, 0.5, 0.0, 0.0])


def goal(scene: Scene = SCENE, t_end: float = 1.0) -> Goal:
    """The end by DOP853's formula at a fine step stands in for the truth where claims alone are tested."""
    return Goal(scene, START, t_end, integrate(scene, START, t_end, 1e-3, "dop853").y[-1, 0])


def test_quick_versions_walk_every_family() -> None:
    formulas = [METHODS[name] for name in FAMILIES]
    for family in (RungeKutta, Adams, ImplicitRungeKutta):
        assert any(isinstance(formula, family) for formula in formulas)
    assert {formula.order for formula in formulas} >= {1, 4, 8}
    assert walked(False) == tuple(METHODS)


@pytest.mark.parametrize("method", ["rk4", "midpoint", "radau3"])
def test_a_claim_is_twice_what_halving_the_step_tells(method: str) -> None:
    row = claimed_row(goal(), method, 0.02, 1.0)
    assert row.claimed
    assert row.passed
    # Richardson's estimate is the error itself but for higher orders: the claim is near twice the error.
    assert row.allowed == pytest.approx(2.0 * row.error, rel=0.2)
    assert row.allowed > ROUNDED


def test_a_wrong_end_breaks_the_claim() -> None:
    here = goal()
    row = claimed_row(here._replace(expected=here.expected + 1e-3), "rk4", 0.02, 1.0)
    assert row.claimed
    assert not row.passed
    assert row.verdict.startswith("FAILED: claimed to ")


@pytest.mark.slow
def test_a_method_that_claims_nothing_ends_with_a_status() -> None:
    undamped = SCENE.replace(beta=0.0)
    assert admitted_step(undamped, "euler", 0.01) == 0.0
    row = claimed_row(goal(undamped, 5.0), "euler", 0.01, 1.0)
    assert not row.claimed
    assert row.passed
    assert row.status != "ok"
    assert row.verdict == "a status, as it must"
    silent = status_row(goal(undamped, 5.0), "euler", 1e-3, "too small a step to be noticed")
    assert silent.status == "ok"
    assert not silent.passed
    assert silent.verdict.startswith("FAILED: not claimed, error ")


def test_steps_within_the_limits() -> None:
    for method in METHODS:
        dt = admitted_step(SCENE, method, 0.05)
        assert 0.0 < dt <= 0.05
        assert step_warning(SCENE, dt, method) is None


def test_what_is_refused_counts_as_not_claimed() -> None:
    row = status_row(goal(), "radau5", 0.01, "float32 is not offered", "float32")
    assert row.status == REFUSED
    assert row.passed
    assert "not with the implicit method radau5" in row.remark
