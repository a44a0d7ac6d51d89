"""The study of own systems: its equations, its truth, and what it compares."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fastmech.studies.bench import systems
from fastmech.studies.bench.measure import Row, measure
from fastmech.studies.bench.own_systems import MU, SYSTEMS, spoken
from fastmech.studies.bench.peers import scalar_rhs
from fastmech.studies.bench.report import run_study
from fastmech.studies.bench.systems import (
    Measured,
    estimate_ratios,
    problem_named,
    ratios,
    report,
)

NAMES = {name.split(",")[0]: name for name in SYSTEMS}


def henon_heiles(x, y, u, v):
    return (u**2 + v**2 + x**2 + y**2) / 2 + x**2 * y - y**3 / 3


def jacobi(x, y, u, v):
    distances = np.hypot(x + MU, y), np.hypot(x - 1 + MU, y)
    return x**2 + y**2 + 2 * (1 - MU) / distances[0] + 2 * MU / distances[1] - u**2 - v**2


def double_pendulum(a, b, u, v):
    return u**2 + v**2 / 2 + u * v * np.cos(a - b) - 9.81 * (2 * np.cos(a) + np.cos(b))


def chain(*y):
    q, p = np.array(y[:4]), np.array(y[4:])
    return (p**2 / 2 - np.cos(q)).sum(axis=0) + 0.25 * (np.diff(q, axis=0) ** 2).sum(axis=0)


@pytest.mark.skipif(np.finfo(np.longdouble).eps > 1e-18, reason="longdouble is no more than double here")
@pytest.mark.parametrize(
    ("name", "conserved"),
    [
        ("Henon-Heiles", henon_heiles),
        ("three bodies", jacobi),
        ("double pendulum", double_pendulum),
        ("four pendulums", chain),
    ],
)
def test_motions_keep_what_theory_says_they_keep(name, conserved):
    problem = problem_named(NAMES[name], 64)
    before, after = (conserved(*y.T) for y in (problem.starts, problem.truth))
    assert np.ptp(before) > 1e-3
    assert np.abs(after - before).max() < 2e-14 * np.abs(before).max()


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_truth_is_scipy_s(name):
    own = SYSTEMS[name]
    problem, rhs = problem_named(name, 2), spoken(own.rhs, sin=np.sin, cos=np.cos)
    for start, end in zip(problem.starts, problem.truth, strict=True):
        run = solve_ivp(lambda t, y: rhs(t, *y), (0, own.t_end), start, "DOP853", rtol=1e-13, atol=1e-13)
        assert np.abs(run.y[:, -1] - end).max() < 1e-9


def test_the_mechanism_s_truth_is_scipy_s():
    problem = problem_named("Table 1, moving", 2)
    p = np.array(problem.coefficients)
    for start, end in zip(problem.starts, problem.truth, strict=True):
        run = solve_ivp(scalar_rhs, (0, 10.0), start, "DOP853", args=(p,), rtol=1e-13, atol=1e-13)
        assert np.abs(run.y[:, -1] - end).max() < 1e-9


def row(family: str, rate: float, *errors: float) -> Row:
    return Row("x", family, "", 1000, 1000 / rate, 1000 / rate, 0.1, np.array(errors))


def made(n: int = 16) -> Measured:
    """A loop that is right to 1e-3 at 800/s and to 1e-5 at 80/s, in its 99 % ten times better."""
    fixed = [row("fastmech a", 800.0, *[1e-4] * 999, 1e-3), row("fastmech a", 80.0, *[1e-6] * 999, 1e-5)]
    tol = {(n, level, t): row("tol", 50.0, t / 2) for level in (0.99, 1.0) for t in (1e-3, 1e-5)}
    estimates = {key: key[2] for key in tol}
    return Measured(
        "made", {n: fixed}, tol, estimates, [row("heyoka", 200.0, 1e-3), row("heyoka", 20.0, 1e-5)], 0.001
    )


@pytest.mark.nojit
def test_ratios_are_at_equal_errors():
    told = ratios(made(), 1e-3)
    assert told["fixed over heyoka"] == pytest.approx(4.0)
    assert told["the same, its calls free"] == pytest.approx(800.0 * (1 / 200 - 0.001))
    assert told["`tol`, largest, over heyoka"] == pytest.approx(0.25)
    assert told["time of `tol` over fixed, largest, 16"] == pytest.approx(16.0)
    # Of 99 % the error is 1e-4 and 1e-6: at 1e-5 the rate lies between in logarithms.
    assert ratios(made(), 1e-5)["time of `tol` over fixed, 99 %, 16"] == pytest.approx(np.sqrt(800 * 80) / 50)
    assert estimate_ratios(made()) == pytest.approx([2.0] * 4)


@pytest.mark.nojit
def test_the_mean_is_geometric_and_the_worst_is_named():
    slow = made()._replace(
        name="slow, 2 states", heyoka=[row("heyoka", 800.0, 1e-3), row("heyoka", 80.0, 1e-5)]
    )
    text = "\n".join(report([made(), slow], (1e-3, 1e-5)))
    assert "| fixed over heyoka | 2.00 (slow 1.00) | 2.00 (slow 1.00) |" in text
    assert "within a factor 3 of the truth in 8 of 8 runs (2 to 2 times it)" in text
    assert "# Mechanisms" not in text
    assert "# Mechanisms beside heyoka" in report([made()], (1e-3, 1e-5), [slow])
    assert "Not installed" in "\n".join(report([made()._replace(heyoka=[])], (1e-3, 1e-5)))


@pytest.mark.slow
def test_a_quick_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(systems, "measure", partial(measure, budget=0.05))
    text = run_study("systems", tmp_path, quick=True).read_text()
    assert "## Lorenz, 3 states" in text
    assert "time of `tol` over fixed, 99 %, 256" in text
