"""``fastmech hardcases``: what it writes and how it ends; the cases themselves are walked elsewhere."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fastmech import open_results
from fastmech.integrators.methods import METHODS
from fastmech.studies.hardcases import report
from fastmech.studies.hardcases.report import CONTAINED, NUMBER, ONE_IN
from fastmech.studies.hardcases.walk import CaseRow, HardCase


@pytest.fixture
def one_case(monkeypatch: pytest.MonkeyPatch):
    """A gallery of one quick case whose error is given, and limits of few methods."""

    def gallery_of(error: float, *methods: str) -> None:
        row = CaseRow("rk4", 0.1, 3, error, 1e-8, np.nan, "ok")
        cases = {"easy": HardCase("easy", "nothing", "a closed form", "pass", lambda quick: [row])}
        monkeypatch.setattr(report, "CASES", cases)
        monkeypatch.setattr(report, "METHODS", {name: METHODS[name] for name in ("rk4", *methods)})

    return gallery_of


def test_table_result_file_and_pictures(invoke, one_case, monkeypatch):
    one_case(1e-9, "dop853", "gauss6")
    monkeypatch.setattr(report, "CONTAINED", {name: CONTAINED[name] for name in ("rk4", "abm8", "gauss6")})
    result = invoke("hardcases", "--quick", "--out", "hard")
    assert result.exit_code == 0
    assert result.stdout.splitlines()[-1] == "all 1 cases passed (1 row)"
    names = {"hardcases.md", "hardcases.h5", "stability_explicit.png", "stability_implicit.png"}
    assert {path.name for path in Path("hard").iterdir()} == names
    text = Path("hard/hardcases.md").read_text(encoding="utf-8")
    assert "## easy: passed" in text
    assert "## Step limits" in text
    assert "## Failing neighbours" in text
    with open_results("hard/hardcases.h5") as results:
        assert results.sections == ("gallery", "step_limits", "containment")
        assert results.attrs["verdict"] == "all 1 cases passed (1 row)"
        limits = results["step_limits"]
        np.testing.assert_allclose(
            limits["measured_step"].data[:2], limits["predicted_step"].data[:2], rtol=0.02
        )
        beside = results["containment"]
        assert [*dict.fromkeys(beside["method"].data)] == ["rk4", "abm8", "gauss6"]
        assert (beside["failed"].data == NUMBER // ONE_IN).all()
        assert beside["same"].data.all()


def test_a_case_that_fails_ends_with_code_1(invoke, one_case, monkeypatch):
    one_case(1e-7)
    monkeypatch.setattr(report, "CONTAINED", {"rk4": 0.02})
    result = invoke("hardcases", "--quick", "--out", "hard")
    assert result.exit_code == 1
    assert result.stdout.splitlines()[-1] == "1 of 1 cases failed: easy"


def test_neighbours_that_get_a_status_end_with_code_1(invoke, one_case, monkeypatch):
    """At 0.05 s the Adams method is beyond its limit: healthy trajectories have a status too."""
    one_case(1e-9)
    monkeypatch.setattr(report, "CONTAINED", {"ab6": 0.05})
    result = invoke("hardcases", "--quick", "--out", "hard")
    assert result.exit_code == 1
    assert result.stdout.splitlines()[-1].endswith("failing trajectories are not contained")
    assert "the same to the bit: NO" in Path("hard/hardcases.md").read_text(encoding="utf-8")


def test_a_folder_that_cannot_be_made(invoke):
    Path("file").write_text("", encoding="utf-8")
    result = invoke("hardcases", "--out", "file/hard")
    assert result.exit_code == 2
    assert result.stderr.startswith("fastmech: file/hard/hardcases.h5: cannot be written")
