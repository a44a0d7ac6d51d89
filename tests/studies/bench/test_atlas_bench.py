"""The atlas's benchmark counts what multistart misses, and tells every ratio with its spread."""

from __future__ import annotations

import pytest

from fastmech.studies.bench.atlas import SCENE, TOLD, markdown, multistart, row_of, side_by_side


def test_what_one_start_cannot_find_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bistable scene has six equilibria, and a start finds one at most."""
    monkeypatch.setattr("fastmech.studies.bench.atlas.STARTS", 2)
    monkeypatch.setattr("fastmech.studies.bench.atlas.TOLD", (1, 2))
    finished: list[int] = []
    row = row_of(multistart([SCENE] * 3, finished.append))
    assert sum(finished) == row.points == row.incomplete == 3
    after_one, after_two = row.missed
    assert 15 <= after_one <= 18
    assert after_two <= after_one
    assert row.found == 18 - after_two


def test_turns_and_table() -> None:
    finished: list[int] = []
    rows, ratios = side_by_side(6, [SCENE] * 3, finished.append)
    assert sum(finished) == 3
    assert [row.points for row in rows] == [36] * len(ratios) + [3]
    assert all(low <= middle <= high for low, middle, high in ratios.values())
    assert rows[-1].missed[-1] <= rows[-1].missed[0]
    text = "\n".join(markdown(rows, ratios))
    assert all(f"after {', '.join(map(str, TOLD))} starts" in text for _ in ratios)
    assert text.count("times as many points a second as multistart") == len(ratios)
