"""What durability and Dask cost is measured on the same values."""

from __future__ import annotations

from pathlib import Path

import pytest
from tiles.conftest import content

from fastmech.runner import run_request
from fastmech.studies.faults import overhead
from fastmech.studies.faults.overhead import _in_memory, _ratio


def test_the_scan_in_memory_is_the_durable_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fastmech.scan_types.equilibrium_map.TILE_POINTS", 1500)
    request = tmp_path / "scan.toml"
    request.write_text(overhead._REQUEST.format(num=7), encoding="utf-8")
    assert run_request(request, tmp_path / "durable.h5").tiles == 4
    _in_memory(request, tmp_path / "memory.h5")
    assert content(tmp_path / "memory.h5") == content(tmp_path / "durable.h5")


def test_ratios_are_of_neighbours(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [0.0]
    monkeypatch.setattr("fastmech.studies.faults.overhead.time.perf_counter", lambda: clock[0])
    slower = iter([3.0, 4.0, 8.0])
    faster = iter([2.0, 2.0, 4.0])

    def taking(seconds: object) -> overhead.Run:
        def run() -> None:
            clock[0] += next(seconds)  # type: ignore[call-overload]

        return run

    runs: list[int] = []
    found = _ratio("one over other", taking(slower), taking(faster), runs.append)
    assert found.value == pytest.approx((1.5 + 2.0 + 2.0) / 3)
    assert found.error == pytest.approx(0.5 / 3)
    assert (found.seconds, runs) == (pytest.approx(8 / 3), [1] * 6)
