from __future__ import annotations

import pytest

from fastmech.errors import shown

pytestmark = pytest.mark.nojit


@pytest.mark.parametrize(
    "value",
    ["x" * 3_000_000, list(range(100_000)), 10**5000, "a\nb\x1b[31m", b"\x00" * 500, {"a": 10**5000}],
    ids=["text", "list", "integer", "control", "bytes", "inside"],
)
def test_values_are_shown_on_one_short_line(value: object) -> None:
    line = shown(value)
    assert len(line) <= 80
    assert line.isprintable()


def test_short_values_are_shown_whole() -> None:
    assert shown("rk4") == "'rk4'"
    assert shown(-3.0) == "-3.0"
