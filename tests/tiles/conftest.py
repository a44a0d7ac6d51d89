from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from fastmech.runner import run_request
from fastmech.scan_types.request import RunContext
from fastmech.store.read import open_results
from fastmech.tiles.run import RunReport
from fastmech.tiles.section import _tiling

#: Eight tiles: a line's folds, six of its points, and a section that is not divided.
REQUEST = """
title = "tiles"
[scene]
alpha = 0.0
[scan.rest]
kind = "equilibria"
[scan.line]
kind = "equilibrium_map"
axes.c2 = { start = 1.0, stop = 900.0, num = 59 }
"""

TILES = 8

Run = Callable[..., RunReport]


@pytest.fixture(autouse=True)
def _small_tiles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fastmech.scan_types.equilibrium_map.TILE_POINTS", 10)
    _tiling.cache_clear()


@pytest.fixture
def request_file(tmp_path: Path) -> Path:
    path = tmp_path / "scan.toml"
    path.write_text(REQUEST, encoding="utf-8")
    return path


@pytest.fixture
def run(request_file: Path) -> Run:
    """Run the request; ``out`` is the result file's name."""

    def go(out: str = "scan.h5", threads: int = 2, **options: object) -> RunReport:
        context = RunContext(threads=threads)
        return run_request(request_file, request_file.parent / out, context=context, **options)

    return go


def content(path: Path) -> dict[tuple[str, str], tuple[object, ...]]:
    """Every value of a result file with what is said about it."""
    found: dict[tuple[str, str], tuple[object, ...]] = {}
    with open_results(path) as results:
        for section in results.groups:
            for name in results[section]:
                v = results[section][name]
                raw = v.data.tolist() if v.data.dtype == object else v.data.tobytes()
                found[section, name] = (v.dims, v.data.dtype.str, v.data.shape, v.units, v.long_name, raw)
    return found
