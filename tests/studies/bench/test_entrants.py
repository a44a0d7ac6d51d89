"""Every entrant solves the same problem: its final states agree with the 24-digit reference."""

from __future__ import annotations

import numpy as np
import pytest

from fastmech.integrators.methods import METHODS
from fastmech.studies.bench import peers
from fastmech.studies.bench.entrants import PACKAGE, SERIES, entrants, entrants_of, installed
from fastmech.studies.bench.measure import STARTS, fast_starts, rest_starts

FEW = 12


@pytest.mark.nojit
@pytest.mark.parametrize("make", [rest_starts, fast_starts])
def test_problems(make):
    problem = make(FEW)
    assert problem.starts.shape == problem.truth.shape == (FEW, 4)
    whole = make()
    assert len(whole.starts) == len(whole.truth) == STARTS
    assert np.array_equal(whole.starts[:FEW], problem.starts)
    rng = np.random.default_rng(1)  # the draws that the reference was computed for
    assert np.array_equal(whole.starts[:, 0], rng.uniform(0.5, 2.5, STARTS))
    assert np.array_equal(whole.starts[:, 1], rng.uniform(-1.0, 1.0, STARTS))
    assert np.abs(whole.starts[:, 2:]).max() <= 10.0


@pytest.mark.nojit
def test_entrants_are_distinct_and_the_methods_exist():
    everyone = list(entrants(rest_starts(1), quick=False))
    names = [(entrant.family, entrant.setting) for entrant in everyone]
    assert len(set(names)) == len(names)
    kinds = ("steps", "fitted", "single", "single_fitted")
    assert {method for kind in kinds for method in PACKAGE[kind]} <= set(METHODS)
    loops = [series for series in SERIES["fastmech"] if series["prepare"] == "fused"]
    assert all(series["dt"] == PACKAGE["steps"][series["given"][0]] for series in loops)


def solved(entrant, problem):
    final = entrant.prepare(problem)(problem.starts)
    return np.abs(final - problem.truth).max(axis=1)


@pytest.mark.parametrize(
    ("family", "setting", "most"),
    [
        ("fastmech rk4", "dt = 0.01 s", 1e-5),
        ("fastmech dop853", "dt = 0.05 s", 1e-7),
        ("hand-fused rk4", "dt = 0.01 s", 1e-5),
        ("Numba RK4, one at a time", "dt = 0.01 s", 1e-5),
        ("SciPy LSODA", "rtol = 1e-08", 1e-6),
    ],
)
def test_errors_are_what_order_and_tolerance_promise(family, setting, most):
    problem = rest_starts(FEW)
    (entrant,) = (e for e in entrants_of("fastmech", problem) if (e.family, e.setting) == (family, setting))
    errors = solved(entrant, problem)
    assert 0.0 < np.median(errors) <= errors.max() < most


def test_the_hand_fused_loop_solves_the_hard_problem_in_blocks_that_are_not_full():
    problem = fast_starts(300)
    entrant = next(e for e in entrants_of("fastmech", problem) if e.family == "hand-fused rk4")
    finer = peers.fused("rk4", 0.0005, problem)(problem.starts)
    assert np.median(np.abs(finer - problem.truth).max(axis=1)) < 1e-9
    assert entrant.prepare(problem)(problem.starts).shape == (300, 4)


def test_heyoka():
    pytest.importorskip("heyoka")
    whole = rest_starts(32)
    problem = whole._replace(starts=whole.starts[16:], truth=whole.truth[16:])
    final = peers.heyoka(1e-12, problem)(problem.starts)
    assert np.abs(final - problem.truth).max() < 1e-11


@pytest.mark.parametrize("library", [name for name in installed() if name != "heyoka"])
def test_other_libraries(library):
    """The last setting of each is an accurate one."""
    problem = rest_starts(FEW)
    *_, entrant = entrants_of(library, problem)
    starts = np.tile(problem.starts, (max(1, -(-entrant.least // FEW)), 1))
    final = entrant.prepare(problem)(starts)
    assert np.abs(final[:FEW] - problem.truth).max() < 1e-5
