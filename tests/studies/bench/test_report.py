"""A tiny run writes what it measured, and says what failed."""

from __future__ import annotations

import re

import h5py
import numpy as np
import pytest

from fastmech.studies.bench import entrants as everyone
from fastmech.studies.bench import report
from fastmech.studies.bench.machine import multiply_adds
from fastmech.studies.bench.measure import Entrant, Row, measure, rest_starts


def exact(problem):
    return lambda starts: np.resize(problem.truth, starts.shape)


def one_off(problem):
    def solve(starts):
        final = np.resize(problem.truth, starts.shape).copy()
        final[0, 2] += 0.25
        return final

    return solve


def impossible(problem):
    raise RuntimeError("no such solver")


def overflowing(problem):
    return lambda starts: np.full_like(starts, np.nan)


@pytest.mark.nojit
def test_errors_are_the_largest_component_of_each_trajectory():
    (row,), _ = measure(rest_starts(8), [Entrant("a", "b", one_off, most=64)])
    assert row.max_error == pytest.approx(0.25)
    assert row.median_error == 0.0
    assert row.trajectories == 64  # short calls are given copies of the starts
    assert row.rate == pytest.approx(row.trajectories / row.processor)


@pytest.mark.nojit
def test_a_batch_that_needs_many_lanes_is_given_copies():
    (row,), _ = measure(rest_starts(8), [Entrant("a", "b", exact, most=104, least=100)])
    assert row.trajectories == 104
    assert row.errors.shape == (8,)


@pytest.mark.nojit
def test_what_is_not_finite_has_no_finite_error():
    (row,), _ = measure(rest_starts(4), [Entrant("a", "b", overflowing)])
    assert row.max_error == np.inf


@pytest.mark.nojit
def test_failures_are_told():
    done = []
    entrants = [Entrant("a", "b", impossible), Entrant("c", "d", exact)]
    rows, failed = measure(rest_starts(4), entrants, done.append)
    assert [row.family for row in rows] == ["c"]
    assert [(entrant.family, str(error)) for entrant, error in failed] == [("a", "no such solver")]
    assert sum(done) == 4


def test_the_peak_is_measured_by_packed_instructions():
    """Fused multiply-adds of doubles in x86 (AVX2, AVX-512) or Arm code."""
    (code,) = multiply_adds().inspect_asm().values()
    assert len(re.findall(r"vfn?madd\d+pd|\bfmla\s+v", code)) >= 100


@pytest.mark.slow
def test_a_tiny_run(tmp_path, monkeypatch):
    def few(problem, quick):
        chosen = {"fastmech rk4", "hand-fused rk4", "Numba RK4, one at a time", "SciPy LSODA"}
        for family in sorted(chosen):
            yield next(e for e in everyone.entrants(problem, quick=True) if e.family == family)
        yield Entrant("broken", "always", impossible)

    monkeypatch.setattr(report, "entrants", few)
    monkeypatch.setattr(report, "QUICK_STARTS", 8)
    monkeypatch.setattr(report, "STUDIES", {})
    table, picture, data = report.run_bench(tmp_path, quick=True)
    text = table.read_text()
    assert "A quick run" in text
    assert "- broken, always: RuntimeError: no such solver" in text
    assert "fused multiply-adds of doubles per core second" in text
    assert "every trajectory its own ten parameters" in text
    assert picture.stat().st_size > 10_000
    with h5py.File(data) as file:
        speed = file["speed"]
        errors = speed["error"][:]
        assert np.nanmax(errors[0]) == speed["max_error"][0]
        assert (speed["processor"][:] > 0.0).all()


@pytest.mark.nojit
@pytest.mark.parametrize(("seconds", "shown"), [(0.02, True), (0.001, False)])
def test_a_loop_is_not_compared_with_the_engine_by_calls_that_are_too_short(seconds, shown):
    """What stands around a call would be compared; the report says how many it leaves out."""
    rows = [
        Row("rest", family, "dt = 0.08 s", 48, seconds, seconds, 1.0, np.zeros(8))
        for family in ("fastmech rk4", "hand-fused rk4")
    ]
    text = "\n".join(report.same_step(rows))
    assert ("| hand-fused rk4, dt = 0.08 s |" in text) == shown
    assert ("Left out: 1 whose calls are shorter than 0.01 s." in text) != shown
