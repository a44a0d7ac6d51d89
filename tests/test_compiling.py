"""What compiles is told on a terminal, and nowhere else."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numba
import pytest

from fastmech.compiling import Preparation, TerminalLine
from fastmech.jit import kernel

pytestmark = pytest.mark.nojit


@pytest.fixture(autouse=True)
def _at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fastmech.compiling.LOOK", 0.001)
    monkeypatch.setattr("fastmech.compiling.SILENT", 0.0)


def shown_until(enough: Callable[[str], bool], capsys: pytest.CaptureFixture[str]) -> str:
    """What standard error shows until it is enough, or for a minute."""
    shown, until = "", time.monotonic() + 60.0
    while not enough(shown) and time.monotonic() < until:
        time.sleep(0.01)
        shown += capsys.readouterr().err
    return shown


def test_a_terminal_says_what_compiles(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    line, told = TerminalLine(), "fastmech: compiling a_kernel_with_a_long_name (kernel 1), 0 s so far"
    line.tell("a_kernel_with_a_long_name")
    assert told in shown_until(lambda shown: told in shown, capsys)
    line.tell("a_part")
    assert "compiling a_part (kernel 2)" in shown_until(lambda shown: "a_part" in shown, capsys)
    line.tell(None)
    line.tell(None)
    *_, spaces, empty, end = capsys.readouterr().err.split("\r")
    assert (spaces, empty, end) == (" " * len(told), "", "")


def test_a_later_call_says_so_too(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    line = TerminalLine()
    for name in ("first", "second"):
        line.tell(name)
        assert name in shown_until(lambda shown: f" {name} " in shown, capsys)  # noqa: B023
        line.tell(None)
        assert capsys.readouterr().err.endswith("\r")
        time.sleep(0.1)


def test_a_terminal_says_what_lasts(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    """Also what is within it, once that lasts too."""
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    line = TerminalLine()
    with line.work("looking") as say:
        assert "fastmech: looking, 0 s so far" in shown_until(lambda shown: "looking" in shown, capsys)
        say("found 3")
        assert "found 3" in shown_until(lambda shown: "found 3" in shown, capsys)
        with line.work("following"):
            assert "following" in shown_until(lambda shown: "following" in shown, capsys)
        line.tell("a_kernel")
        assert "compiling a_kernel" in shown_until(lambda shown: "a_kernel" in shown, capsys)
        line.tell(None)
    assert capsys.readouterr().err.endswith("\r")


def test_nothing_is_written_where_nobody_looks_on(capsys: pytest.CaptureFixture[str]):
    line = TerminalLine()
    line.tell("kernel")
    time.sleep(0.1)
    line.tell(None)
    assert capsys.readouterr() == ("", "")


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled there")
def test_what_cannot_be_compiled_is_not_in_hand_any_more(monkeypatch: pytest.MonkeyPatch):
    told: list[str | None] = []
    monkeypatch.setattr("fastmech.jit.listeners", [told.append])

    @kernel(numba.float64(numba.float64))
    def impossible(x):
        return x.colour

    for _ in range(2):
        with pytest.raises(numba.core.errors.TypingError):
            impossible(1.0)
    assert told == ["impossible", None] * 2


def test_seconds_of_kernels_count_once(monkeypatch: pytest.MonkeyPatch):
    """Of kernels within kernels the outer one's seconds; what lies between two is no preparing."""
    now = [0.0]
    monkeypatch.setattr("fastmech.compiling.time.perf_counter", lambda: now[0])
    preparation = Preparation()
    for seconds, name in ((1.0, "outer"), (2.0, "inner"), (4.0, None), (8.0, None), (16.0, "last")):
        now[0] += seconds
        preparation.tell(name)
    now[0] += 32.0
    assert preparation.look() == ("last", 2.0 + 4.0 + 8.0 + 32.0)
    preparation.tell(None)
    now[0] += 64.0
    assert preparation.look() == (None, 46.0)
