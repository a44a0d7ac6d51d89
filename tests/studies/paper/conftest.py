from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest

from fastmech.studies.paper.compute import Computed, compute
from fastmech.studies.paper.report import PaperReport, write_paper
from fastmech.studies.reporting import content


@pytest.fixture(scope="session")
def print_() -> dict[str, Any]:
    """The print; not to be changed."""
    return content("fastmech.studies.paper", "printed.toml")


@pytest.fixture
def changed(print_: dict[str, Any]) -> dict[str, Any]:
    """A copy of the print for a test that mends or spoils it."""
    return deepcopy(print_)


@pytest.fixture(scope="session")
def computed(print_: dict[str, Any]) -> Computed:
    return compute(print_)


@pytest.fixture(scope="session")
def told() -> list[int]:
    """Of how many pieces of work the report told, and when each was done."""
    return []


@pytest.fixture(scope="session")
def report(tmp_path_factory: pytest.TempPathFactory, told: list[int]) -> PaperReport:
    out: Path = tmp_path_factory.mktemp("paper") / "report"

    def stage(name: str, total: int) -> Callable[[int], None]:
        told.append(total)
        return told.append

    return write_paper(out, stage=stage)
