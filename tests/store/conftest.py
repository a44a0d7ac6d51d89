from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fastmech.results import Dataset, Variable, flags
from fastmech.store.provenance import provenance
from fastmech.store.write import write_results


class Kind(IntEnum):
    STABLE = 0
    UNSTABLE = 1
    DEGENERATE = 2


@pytest.fixture
def content() -> dict[str, Any]:
    """Everything that `write_results` takes, with small and large, plain and flagged variables."""
    rng = np.random.default_rng(7)
    equilibria = Dataset(
        {
            "phi": Variable(
                ("equilibrium",), np.array([0.5, -1.25, 2.0, np.nan]), "rad", "angle of the rod OM1"
            ),
            "kind": Variable(("equilibrium",), np.array([0, 1, 1, 1], np.int8), "1", "verdict", flags(Kind)),
            "label": Variable(("equilibrium",), ["A", "B", "", "Größe [N]"], "1", "name"),
            "complete": Variable((), True, "1", "whether none is missing"),
        },
        {"at": np.inf, "methods": ("grid", "newton")},
    )
    atlas = Dataset(
        {
            "energy": Variable(("F0", "c2", "index"), rng.normal(size=(40, 30, 2)), "J", "potential energy"),
            "F0": Variable(("F0",), np.linspace(0.0, 100.0, 40), "N", "force"),
            "c2": Variable(("c2",), np.linspace(0.0, 500.0, 30), "N/m", "stiffness"),
        }
    )
    return {
        "scene_parameters": {
            "m1": Variable((), 10.0, "kg", "mass of M1"),
            "l": Variable((), 1.25, "m", "length"),
        },
        "sections": {"equilibria": equilibria, "atlas": atlas},
        "attrs": {**provenance(threads=2), "title": "test", "request": "[scene]\nm1 = 10\n", "seed": 3},
    }


@pytest.fixture
def write(content: dict[str, Any], tmp_path: Path) -> Callable[[], Path]:
    """Writes that content to a new file."""

    def write_content() -> Path:
        path = tmp_path / "result.h5"
        write_results(path, **content)
        return path

    return write_content
