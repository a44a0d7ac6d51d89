"""What becomes of a tile in hand when a run is stopped."""

from __future__ import annotations

import threading

import pytest
from tiles.conftest import Run
from tiles.test_run import stopped_after

from fastmech.interrupts import Stopped
from fastmech.scan_types.equilibrium_map import MapTiling
from fastmech.scan_types.request import RunContext

TOLD = "this process ends with the tiles in hand"


def stopped(run: Run, monkeypatch: pytest.MonkeyPatch, wait: object) -> str:
    """The message of a run that is stopped while a tile waits."""
    compute = MapTiling.compute

    def slow(self: MapTiling, index: int, context: RunContext) -> object:
        if index == 0:  # begun before any other is finished
            wait(context)  # type: ignore[operator]
        return compute(self, index, context)

    monkeypatch.setattr(MapTiling, "compute", slow)
    monkeypatch.setattr("fastmech.tiles.work.GRACE", 0.05)
    with stopped_after(3, KeyboardInterrupt()), pytest.raises(Stopped) as end:
        run()
    return str(end.value)


def test_it_is_left_where_it_can_be(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    left = threading.Event()

    def checking(context: RunContext) -> None:
        try:
            while True:
                context.check()
                threading.Event().wait(0.005)
        finally:
            left.set()

    assert TOLD not in stopped(run, monkeypatch, checking)
    assert left.is_set()


def test_that_it_is_waited_for_is_told(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    go_on = threading.Event()
    try:
        message = stopped(run, monkeypatch, lambda context: go_on.wait(20))
    finally:
        go_on.set()
    assert "3 of 8 tiles are kept" in message
    assert TOLD in message
