"""Progress bars: on a terminal only."""

from __future__ import annotations

import sys
import time

import pytest

from fastmech.cli.progress import ProgressBars, Stage
from fastmech.compiling import LOADING
from fastmech.jit import listeners


def use(bars: ProgressBars) -> None:
    with bars:
        advance = bars.stage("pictures", 3)
        advance(1)
        advance(2)
        advance = bars.stage("map: points", 2000)
        advance(500)
        advance(1500)


def test_bars_on_a_terminal(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    use(ProgressBars())
    shown = capsys.readouterr()
    assert shown.out == ""
    assert "pictures" in shown.err
    assert "map: points" in shown.err
    assert "100%" in shown.err
    assert "took" in shown.err


@pytest.mark.parametrize(("terminal", "quiet"), [(False, False), (False, True), (True, True)])
def test_silence(terminal, quiet, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    use(ProgressBars(quiet))
    assert capsys.readouterr() == ("", "")


def test_a_line_every_so_often_in_a_log(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    clock = iter(float(second) for second in range(0, 1000, 10))
    monkeypatch.setattr("fastmech.cli.progress.time.monotonic", lambda: next(clock))
    monkeypatch.setattr("fastmech.cli.progress.LOG_PERIOD", 500.0)
    use(ProgressBars())
    lines = capsys.readouterr().err.splitlines()
    assert lines == []
    monkeypatch.setattr("fastmech.cli.progress.LOG_PERIOD", 50.0)
    with ProgressBars() as bars:
        both = bars.stage("map: points", 8), bars.stage("pictures", 8)
        for _ in range(8):
            for advance in both:
                advance(1)
    lines = capsys.readouterr().err.splitlines()
    assert any(line.startswith("fastmech: map: points: ") and line.endswith(" left") for line in lines)
    assert any(line.startswith("fastmech: pictures: ") and "/s, " in line for line in lines)
    assert 2 <= len(lines) <= 8


def test_a_log_says_that_a_long_item_goes_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("fastmech.compiling.LOOK", 0.01)
    monkeypatch.setattr("fastmech.cli.progress.LOG_PERIOD", 0.05)
    with ProgressBars() as bars:
        with bars.preparing():
            pass
        advance = bars.stage("parts of the report", 2)
        advance(1)
        time.sleep(0.5)
    lines = [line for line in capsys.readouterr().err.splitlines() if "parts of the report: 50%" in line]
    assert len(lines) >= 2


def counted_at(seconds: float, done: int, monkeypatch: pytest.MonkeyPatch) -> Stage:
    """Four parts of which some are done after some time; lines come every 30 s."""
    monkeypatch.setattr("fastmech.cli.progress.LOG_PERIOD", 30.0)
    clock = [0.0]
    stage = Stage("parts", 4, lambda: clock[0])
    clock[0] = seconds
    stage.count(done, 0.0)
    return stage


def test_lines_of_a_long_item_differ(monkeypatch: pytest.MonkeyPatch) -> None:
    stage = counted_at(40.0, 1, monkeypatch)
    told = [stage.log_line(now) for now in (40.0, 75.0, 90.0, 110.0)]
    assert told == [
        "parts: 25%, 0.025/s, 0:02:00 left",
        "parts: 25%, 0.025/s, no more done for 35 s",
        None,
        "parts: 25%, 0.025/s, no more done for 70 s",
    ]
    assert [stage.columns(now)["time"] for now in (40.0, 69.0, 71.0)] == ["0:02:00 left"] * 2 + [""]


def test_a_forecast_that_is_over_is_not_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    stage = counted_at(30.0, 3, monkeypatch)  # 10 s are left
    assert [stage.columns(now)["time"] for now in (30.0, 39.0, 41.0)] == ["0:00:10 left"] * 2 + [""]
    assert stage.log_line(45.0) == "parts: 75%, 0.1/s"


def test_bars_drop_a_forecast_that_is_over(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fastmech.compiling.LOOK", 0.01)
    with ProgressBars() as bars:
        with bars.preparing():
            pass
        time.sleep(0.02)
        bars.stage("parts", 2)(1)
        (task,) = bars._progress.tasks
        assert task.fields["time"] == "0:00:00 left"
        time.sleep(0.3)
        assert task.fields["time"] == ""


def test_many_short_stages_are_told_every_so_often(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("fastmech.cli.progress.LOG_PERIOD", 0.05)
    with ProgressBars() as bars:
        for number in range(6):
            advance = bars.stage(f"part {number}", 1)
            time.sleep(0.03)
            advance(1)
    assert 2 <= len(capsys.readouterr().err.splitlines()) <= 4


def test_what_goes_on_without_an_item_done_is_not_idle(monkeypatch: pytest.MonkeyPatch) -> None:
    stage = counted_at(25.0, 0, monkeypatch)
    assert [stage.log_line(now) for now in (40.0, 70.0)] == [
        "parts: 0%",
        "parts: 0%, no more done for 45 s",
    ]
    assert stage.columns(70.0) == {"rate": "", "time": ""}


@pytest.mark.parametrize(("terminal", "kind"), [(False, "xterm"), (True, "xterm"), (True, "dumb")])
def test_long_preparing_is_told(
    terminal, kind, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    monkeypatch.setenv("TERM", kind)
    monkeypatch.setattr("fastmech.compiling.LOOK", 0.001)
    monkeypatch.setattr("fastmech.compiling.SILENT", 0.0)
    monkeypatch.setattr("fastmech.cli.progress.LOG_PERIOD", 0.0)
    shown = ""
    with ProgressBars() as bars:

        def wait_for(word: str) -> None:
            nonlocal shown
            until = time.monotonic() + 60.0
            while word not in shown and time.monotonic() < until:
                time.sleep(0.01)
                shown += capsys.readouterr().err
            assert word in shown

        with bars.preparing():
            wait_for(LOADING)
        (tell,) = listeners
        tell("integrate_blocks")
        wait_for("compiling integrate_blocks")
        tell("a_part_of_it")
        wait_for("compiling a_part_of_it")
        tell(None)
        tell(None)
    assert listeners == []
    assert bars.stages() == []


def test_short_preparing_is_not(capsys: pytest.CaptureFixture[str]):
    with ProgressBars() as bars, bars.preparing():
        pass
    assert capsys.readouterr() == ("", "")


def test_pieces_of_work_do_not_take_the_seconds_of_kernels(monkeypatch: pytest.MonkeyPatch):
    now = [0.0]
    for clock in ("perf_counter", "monotonic"):
        monkeypatch.setattr(f"time.{clock}", lambda: now[0])
    bars = ProgressBars(quiet=True)
    advance = bars.stage("map: points", 4)
    for seconds, tell in ((1.0, "solve"), (20.0, None)):
        now[0] += seconds
        bars._preparation.tell(tell)
    now[0] += 3.0
    advance(4)
    (stage,) = bars.stages()
    assert (stage["seconds"], stage["rate"], bars.prepared) == (4.0, 1.0, 20.0)
    assert bars._preparation.kernels == 1
