"""What the studies share: turns are told and counted, tables have their headings, columns their units."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from fastmech.studies.reporting import columns, in_turns, section

pytestmark = pytest.mark.nojit


def test_everyone_has_a_turn_before_anyone_is_counted() -> None:
    ticks, calls, told = iter(range(100)), list[str](), list[int]()

    def work(name: str) -> str:
        calls.append(name)
        return f"{name}{len(calls)}"

    works = {name: (lambda name=name: work(name)) for name in "ab"}
    seconds, results = in_turns(works, 2, told.append, lambda: float(next(ticks)))
    assert calls == ["a", "b"] * 3
    assert sum(told) == 6
    assert seconds == {"a": [1.0, 1.0], "b": [1.0, 1.0]}
    assert results == {"a": "a5", "b": "b6"}


def test_a_table_has_its_heading_and_its_text() -> None:
    assert section("# A", "Told.", "x | y", [(1, 2)]) == [
        "# A", "", "Told.", "", "| x | y |", "|---|---:|", "| 1 | 2 |", "",
    ]  # fmt: skip
    assert section("", "", "x | y", []) == ["| x | y |", "|---|---:|", ""]


class Contained(NamedTuple):
    method: str
    when: str
    span: float
    share: float
    failed: int
    same: bool


def test_columns_have_units_and_meanings() -> None:
    rows = [
        Contained("rk4", "early", 2.0, 0.9, 1, same=True),
        Contained("dop853", "late", 3.0, 1.0, 0, same=True),
    ]
    found = columns("row", rows, "containment")
    assert found["method"].data.tolist() == ["rk4", "dop853"]
    span = found["span"]
    assert (span.dims, span.units, span.data.tolist()) == (("row",), "s", [2.0, 3.0])
