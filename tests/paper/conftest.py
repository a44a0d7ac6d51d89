from __future__ import annotations

from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest

from fastmech.paper.compute import Computed, compute
from fastmech.paper.printed import load_printed
from fastmech.paper.report import PaperReport, write_paper


@pytest.fixture(scope="session")
def print_() -> dict[str, Any]:
    """The print; not to be changed."""
    return load_printed()


@pytest.fixture
def changed(print_: dict[str, Any]) -> dict[str, Any]:
    """A copy of the print for a test that mends or spoils it."""
    return deepcopy(print_)


@pytest.fixture(scope="session")
def computed(print_: dict[str, Any]) -> Computed:
    return compute(print_)


@pytest.fixture(scope="session")
def told() -> list[tuple[int, int]]:
    """What the report's progress was told."""
    return []


@pytest.fixture(scope="session")
def report(tmp_path_factory: pytest.TempPathFactory, told: list[tuple[int, int]]) -> PaperReport:
    out: Path = tmp_path_factory.mktemp("paper") / "report"
    return write_paper(out, progress=lambda done, total: told.append((done, total)))
