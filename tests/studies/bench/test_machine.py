"""The study of threads: what is compared, and that all of it is told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fastmech.studies.bench import machine
from fastmech.studies.bench.report import run_study


def test_every_run_and_the_yardstick_have_a_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ran: list[tuple[str, int]] = []

    def case(name: str) -> machine.Run:
        return lambda number: ran.append((name, number))

    monkeypatch.setattr(machine, "thread_count", lambda threads: 3)
    monkeypatch.setattr(machine, "cases", lambda n, turns: {name: case(name) for name in "ab"})
    told: list[int] = []
    path = run_study("threads", tmp_path, quick=True, stage=lambda name, total: told.append)
    assert ran == [("a", 1), ("a", 3), ("b", 1), ("b", 3)] * 2  # one turn warms up
    assert sum(told) == len(ran)
    lines = path.read_text(encoding="utf-8").splitlines()
    assert [line.split("|")[1].strip() for line in lines if line.startswith("| ")][1:] == ["a", "b"]


def test_the_yardstick_does_the_same_work_on_any_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    turns: list[int] = []
    monkeypatch.setattr(machine, "multiply_adds", lambda: lambda x, n, factor: turns.append(n))
    (yardstick, *_) = machine.cases(8, 12).values()
    for number in (1, 2, 3):
        turns.clear()
        yardstick(number)
        assert turns == [12 // number] * number


def test_ensembles_run_to_the_end() -> None:
    _, run, *_ = machine.cases(4, 12).values()
    final = run(1)
    assert np.isfinite(final).all()
    np.testing.assert_array_equal(final, run(2))
