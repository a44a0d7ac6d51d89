"""What durability and Dask cost is measured on the same values."""

from __future__ import annotations

from pathlib import Path

import pytest
from faults import overhead
from tiles.conftest import content

from fastmech.runner import run_request


def test_the_scan_in_memory_is_the_durable_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fastmech.scan_types.equilibrium_map.TILE_POINTS", 1500)
    request = tmp_path / "scan.toml"
    request.write_text(overhead.REQUEST.format(num=7), encoding="utf-8")
    assert run_request(request, tmp_path / "durable.h5").tiles == 4
    overhead.in_memory(request, tmp_path / "memory.h5")
    assert content(tmp_path / "memory.h5") == content(tmp_path / "durable.h5")


@pytest.mark.slow
def test_every_way_has_its_turns(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fastmech.scan_types.equilibrium_map.TILE_POINTS", 1500)
    monkeypatch.setattr(overhead, "REQUEST", overhead.REQUEST.replace("num = 500", "num = 20"))
    monkeypatch.setattr(overhead, "CALIBRATION", 7)
    told: list[int] = []
    found = overhead.overheads(0.01, told.append)
    assert sum(told) == overhead.RUNS
    assert set(found.facts) == {what for what, _, _ in overhead.PAIRS}
    assert all(mean > 0.0 and error >= 0.0 for mean, error in found.facts.values())
    assert all("3 turns" in sentence for sentence in found.sentences)
