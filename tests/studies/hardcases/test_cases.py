"""Every case of the gallery, in its fast version, and what the report makes of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fastmech as fm
from fastmech.integrators.methods import METHODS
from fastmech.step_limits.warning import stable_step
from fastmech.studies.hardcases.cases import CASES
from fastmech.studies.hardcases.report import gallery_dataset, gallery_lines, verdict
from fastmech.studies.hardcases.walk import CaseRow, counted, explicit_calls, motion, path_eigenvalues


@pytest.mark.parametrize("name", CASES)
@pytest.mark.slow
def test_case(name: str) -> None:
    rows = CASES[name].run(True)
    assert rows
    assert [row for row in rows if not row.passed] == []


def test_the_gallery_is_large_and_described() -> None:
    assert len(CASES) >= 16
    for name, case in CASES.items():
        assert name == case.name
        assert case.hard
        assert case.oracle
        assert case.must


def row(**changes: object) -> CaseRow:
    values = {"method": "rk4", "dt": 0.1, "steps": 3, "error": 1e-9, "allowed": 1e-8, "drift": np.nan,
              "status": "ok"} | changes  # fmt: skip
    return CaseRow(**values)  # type: ignore[arg-type]


def test_what_passes() -> None:
    assert row().passed
    assert not row(error=1e-7).passed
    assert not row(error=np.nan).passed
    assert not row(status="not_finite").passed
    assert row(allowed=np.nan, status="not_finite", error=np.nan).passed
    assert not row(allowed=np.nan).passed


def test_a_failure_is_said_in_one_line_and_in_the_file(tmp_path: Path) -> None:
    case = CASES["chaos_reversed"]
    good, bad = (case, [row()]), (case, [row(), row(error=1.0, method="euler")])
    assert verdict([good]) == "all 1 cases passed (1 row)"
    assert verdict([good, bad]) == "1 of 2 cases failed: chaos_reversed"
    dataset = gallery_dataset([good, bad])
    assert dataset.attrs["failures"] == 1
    assert dataset["passed"].data.tolist() == [1, 1, 0]
    text = "\n".join(gallery_lines([bad]))
    assert "## chaos_reversed: FAILED" in text
    assert "| euler | 0.1 | 3 | 1.0e+00 | 1.0e-08 |  | ok | FAILED: claimed to 1e-08 |" in text


@pytest.mark.slow
def test_fifty_times_fewer_right_hand_sides_than_rk4_at_its_limit() -> None:
    """beta = 1e6: radau5 to 1e-8, every call counted, against 4 calls a step at RK4's limit on the way."""
    goal = motion("damping_1e6")
    calls, path = counted(goal, "radau5", 120)
    assert goal.error(path[-1]) < 1e-8
    assert calls >= 120 * 8  # three stages at least and five for the differences
    limits = [stable_step(METHODS["rk4"], values) for values in path_eigenvalues(goal, path)]
    # A fixed step must do at the narrowest place; even a step that followed the limit would need fifty times.
    assert 4 * goal.t_end / min(limits) >= explicit_calls(goal, path) > 50 * calls
    # RK4 just beyond the limit ends with a status, just within it does not.
    assert fm.integrate(goal.scene, goal.start, 0.05, 1.2 * min(limits[:2]), "rk4").status[0] != fm.Status.OK
    assert fm.integrate(goal.scene, goal.start, 0.05, 0.8 * min(limits), "rk4").status[0] == fm.Status.OK
