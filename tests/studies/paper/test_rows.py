from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from oracles import TABLE_1, oracle

from fastmech.slider.equilibria import find_equilibria
from fastmech.studies.paper.compare import CASES, Agreement, PaperRow, agrees
from fastmech.studies.paper.compute import STATIC_SCENE, Computed, nearest
from fastmech.studies.paper.misprints import candidates
from fastmech.studies.paper.rows import all_rows


@pytest.fixture(scope="module")
def rows(print_: dict[str, Any], computed: Computed) -> list[PaperRow]:
    return compared(print_, computed)


def compared(printed: dict[str, Any], computed: Computed) -> list[PaperRow]:
    return all_rows(printed, computed, {m.key for m in candidates(printed, computed) if m.confirmed})


def section(rows: list[PaperRow], name: str, place: str = "") -> list[PaperRow]:
    return [row for row in rows if row.section == name and place in row.place]


def count_of_numbers(printed: Any) -> int:
    """Strings of digits in a part of the print, notes and expressions apart."""
    if isinstance(printed, dict):
        skipped = {"note", "factor", "exact", "read_as", "units", "verdict"}
        return sum(count_of_numbers(value) for key, value in printed.items() if key not in skipped)
    if isinstance(printed, list):
        return sum(count_of_numbers(value) for value in printed)
    return 1


def test_every_printed_number_has_a_row(rows: list[PaperRow], print_: dict[str, Any]) -> None:
    expected = {
        "Table 1": "table_1",
        "Equation (16)": "equation_16",
        "Equation (20)": "equation_20",
        "Table 2": "table_2",
        "Table 3": "table_3",
        "Table 4": "table_4",
    }
    for name, key in expected.items():
        assert sum(row.is_number for row in section(rows, name)) == count_of_numbers(print_[key]), name
    # The text's numbers are its strings; its lists are words.
    text = [value for value in print_["text"].values() if isinstance(value, str)]
    assert sum(row.is_number for row in section(rows, "Text")) == len(text)


def test_nothing_differs_unexplained(rows: list[PaperRow]) -> None:
    assert [row for row in rows if row.verdict == Agreement.DIFFERS] == []


def test_table_2_agrees_to_the_printed_digit(rows: list[PaperRow]) -> None:
    assert {row.verdict for row in section(rows, "Table 2")} == {Agreement.AGREES}


def test_table_3_agrees_to_a_hundredth_but_for_case_1(rows: list[PaperRow]) -> None:
    for case in ("Case 2", "Case 3", "Case 4"):
        for row in section(rows, "Table 3", case):
            assert not row.is_number or abs(row.difference) < 0.01


def test_table_3_has_the_known_misprints(rows: list[PaperRow]) -> None:
    wrong = [(row.place, row.symbol) for row in section(rows, "Table 3") if row.verdict == Agreement.MISPRINT]
    case_1 = [("Case 1", symbol) for symbol in ("c11", "c12", "c21", "c22")]
    assert wrong == [*case_1, ("Case 4", "c12"), ("Case 4", "c22")]


def test_table_4_agrees_in_every_legible_digit_but_for_case_1(rows: list[PaperRow]) -> None:
    for row in section(rows, "Table 4"):
        if row.place == "Case 1" and "*" in row.printed:
            assert (row.verdict, row.see) == (Agreement.MISPRINT, "table_4_case_1")
        else:
            assert row.verdict.good


def test_verdicts_of_stability_agree(rows: list[PaperRow]) -> None:
    words = [row for row in rows if not row.is_number]
    assert len(words) == 9
    assert {row.verdict for row in words} == {Agreement.SAME}


def test_the_stiffness_is_called_a_rounding(rows: list[PaperRow]) -> None:
    assert [row.symbol for row in rows if row.verdict == Agreement.ROUNDING] == ["c2"]


def test_computed_hessians_are_the_oracles(rows: list[PaperRow], computed: Computed) -> None:
    for case in computed.cases:
        q = (case.equilibrium.phi, case.equilibrium.theta)
        true = np.array(oracle().hessian(TABLE_1, q, F=100), dtype=float).ravel()
        found = [row.computed for row in section(rows, "Table 3", f"Case {case.number}") if row.is_number]
        np.testing.assert_allclose(found, true, rtol=1e-12)


def test_computed_polynomials_are_the_oracles(rows: list[PaperRow], computed: Computed) -> None:
    for case in computed.cases:
        q = (case.equilibrium.phi, case.equilibrium.theta)
        true = np.array(oracle().characteristic_polynomial(TABLE_1, q, F=100), dtype=float)
        found = [row.computed for row in section(rows, "Table 4", f"Case {case.number}") if row.is_number]
        np.testing.assert_allclose(found, -true[::-1], rtol=1e-11)


def test_a_wrong_digit_is_noticed(changed: dict[str, Any], computed: Computed) -> None:
    changed["table_2"]["case_2"]["phi"] = "1.45068"
    changed["equation_20"]["phi"][2]["value"] = "126"
    changed["table_4"]["case_3"]["coefficients"][1] = "-36.7*94"
    changed["text"]["equilibria"] = "5"
    changed["table_3"]["case_2"]["verdict"] = "unstable"
    differing = [row.printed for row in compared(changed, computed) if row.verdict == Agreement.DIFFERS]
    assert differing == ["5", "1.45068", "126", "unstable", "-36.7*94"]


def test_the_paper_computed_with_the_unrounded_stiffness(print_: dict[str, Any]) -> None:
    """With the printed c2, or another g, angles of Table 2 miss their last digit."""

    def agreeing(**changes: float) -> int:
        found = find_equilibria(STATIC_SCENE.replace(**changes))
        entries = [print_["table_2"][name] for name in CASES]
        pairs = [(entry, nearest(found, entry)) for entry in entries]
        return sum(agrees(entry["phi"], e.phi) + agrees(entry["theta"], e.theta) for entry, e in pairs)

    assert (agreeing(), agreeing(c2=float(print_["table_1"]["c2"]))) == (8, 3)
    assert agreeing(g=9.81) < 8
