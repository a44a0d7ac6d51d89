"""The atlas's benchmark counts what multistart misses, and tells every ratio with its spread."""

from __future__ import annotations

import pytest

from fastmech.ensembles.threads import thread_count
from fastmech.studies.bench.atlas import SCENE, TOLD, multistart, side_by_side


def test_what_one_start_cannot_find_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bistable scene has six equilibria, and a start finds one at most."""
    monkeypatch.setattr("fastmech.studies.bench.atlas.STARTS", 2)
    monkeypatch.setattr("fastmech.studies.bench.atlas.TOLD", (1, 2))
    finished: list[int] = []
    seconds, found, lacking = multistart([SCENE] * 3, finished.append)
    assert sum(finished) == len(lacking) == 3
    assert seconds > 0.0
    after_one, after_two = lacking.sum(axis=0)
    assert 15 <= after_one <= 18
    assert after_two <= after_one
    assert found == 18 - after_two


def test_turns_and_table() -> None:
    finished: list[int] = []
    lines = side_by_side(6, [SCENE] * 3, finished.append)
    assert sum(finished) == 3
    ways = len({1, thread_count(None)})
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("| ")]
    assert [row[2] for row in cells[1:]] == ["36"] * ways + ["3"]
    text = "\n".join(lines)
    assert f"after {', '.join(map(str, TOLD))} starts" in text
    assert text.count("times as many points a second as multistart") == ways
