from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from fastmech.cli import main
from fastmech.tiles.section import _tiling

TINY = """
title = "a tiny request"

[scene]
c1 = 150.0

[scan.swing]
kind = "motion"
t_end = 0.1
outputs = 5

[scan.rest]
kind = "equilibria"
scene = { alpha = 0.0 }
"""

Invoke = Callable[..., Result]


@pytest.fixture(autouse=True)
def _in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for pause in ("compiling.SILENT", "cli.progress.LOG_PERIOD"):  # are kernels there already: no matter here
        monkeypatch.setattr(f"fastmech.{pause}", math.inf)
    _tiling.cache_clear()


@pytest.fixture
def invoke() -> Invoke:
    """Run the command line; an exception that is no exit would fail the test."""

    def run(*arguments: str | Path) -> Result:
        return CliRunner().invoke(main, [str(a) for a in arguments], catch_exceptions=False)

    return run


@pytest.fixture
def tiny() -> Path:
    path = Path("tiny.toml")
    path.write_text(TINY, encoding="utf-8")
    return path
