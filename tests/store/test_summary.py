from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from fastmech.results import NO_CODE, Dataset, Variable
from fastmech.store.read import open_results
from fastmech.store.summary import describe_values, summarize

FLAGS = {"flag_values": np.array([0, 1], np.int8), "flag_meanings": "stable unstable"}


def page(path: Path, section: str | None = None) -> str:
    out = io.StringIO()
    with open_results(path) as results:
        Console(file=out, width=100).print(summarize(results, section))
    return out.getvalue()


def test_page(write: Callable[[], Path]) -> None:
    text = page(write())
    for expected in ("fastmech results", "created", "title", "2 lines of text", "mass of M1", "1.25", "kg"):
        assert expected in text
    words = " ".join(text.split())
    for expected in (
        "equilibrium 4 phi [rad], kind, label",
        "single complete",
        "F0 40, c2 30, index 2 energy [J]",
        "grid",
    ):
        assert expected in words
    assert "asked_for" not in text
    assert max(map(len, text.splitlines())) <= 100


def test_a_section_in_full(write: Callable[[], Path]) -> None:
    text = page(write(), "equilibria")
    shown = (
        "equilibrium 4",
        "stable 1, unstable 3",
        "-1.25 .. 2, 1 nan",
        "angle of the rod OM1",
        "Größe [N]",
    )
    for expected in shown:
        assert expected in text
    assert "mass of M1" not in text


def test_variables_that_only_a_number_tells_apart_are_named_together(
    write: Callable[[], Path], content: dict[str, Any]
) -> None:
    rows = {f"rate_{k}": Variable(("n",), np.zeros(2), "1/s") for k in (1, 2, 3)}
    powers = {f"power_{k}": Variable(("n",), np.zeros(2), f"s-{k}") for k in (1, 2)}
    content["sections"] = {"modes": Dataset(rows | powers)}
    assert "n 2 rate_1 to 3 [1/s], power_1 to 2" in " ".join(page(write()).split())


def test_markup_and_control_characters_are_shown_not_obeyed(
    write: Callable[[], Path], content: dict[str, Any]
) -> None:
    content["attrs"]["title"] = "[red]x[/red] \x1b[2J"
    text = page(write())
    assert r"[red]x[/red] \x1b[2J" in text
    assert "\x1b" not in text


@pytest.mark.parametrize(
    ("variable", "expected"),
    [
        (Variable(("n",), np.array([3, 1, 2])), "1 .. 3"),
        (Variable((), 2.5), "2.5"),
        (Variable(("n",), np.full(2, np.nan)), "2 nan"),
        (Variable(("n",), np.zeros(0)), "empty"),
        (Variable(("n",), np.array([0, 0, 7], np.int8), attrs=FLAGS), "stable 2, unexplained 1"),
        (Variable(("n",), np.array([0, -1], np.int8), attrs=FLAGS | NO_CODE), "none 1, stable 1"),
        (Variable(("n",), np.array([3, -1, 5], np.int32), attrs=NO_CODE), "3 .. 5, 1 none"),
        (Variable(("n",), ["b", "a", "b"]), "b, a"),
        (Variable(("n",), list("abcdef")), "a, b, c, d, ... (6 distinct)"),
        (Variable(("n",), np.array([-np.inf, 1.0])), "-inf .. 1"),
    ],
)
def test_values(variable: Variable, expected: str) -> None:
    assert describe_values(variable) == expected
