"""The loads at which each resting position of the scene disappears."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from pydantic import Field

from fastmech.atlas.snap import find_snap
from fastmech.equilibria.find import find_equilibria
from fastmech.results import Dataset, Variable
from fastmech.scan_types.request import RunContext, Scan
from fastmech.scene import Scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class SnapScan(Scan):
    """Constant loads F0, below and above the present one, at which a stable position merges with a saddle."""

    kind: ClassVar[str] = "snap"

    searched: list[float] | None = Field(None, min_length=2, max_length=2, description="loads to search [N]")

    def run(self, scene: Scene, context: RunContext) -> Dataset:
        """Follow every stable position as the load changes."""
        stable = [e for e in find_equilibria(scene) if e.morse_index == 0]
        advance = context.stage("snap", len(stable))
        found = []
        limits = (self.searched[0], self.searched[1]) if self.searched is not None else None
        for equilibrium in stable:
            found.append(find_snap(scene, equilibrium, limits))
            advance(1)
        each = ("equilibrium",)

        def loads(values: list[float | None]) -> np.ndarray:
            return np.array([np.nan if value is None else value for value in values], dtype=np.float64)

        return Dataset(
            {
                "phi": Variable(each, np.array([s.phi for s in found]), "rad", "angle phi"),
                "theta": Variable(each, np.array([s.theta for s in found]), "rad", "angle theta"),
                "snap_below": Variable(
                    each,
                    loads([s.below for s in found]),
                    "N",
                    "it disappears when the load falls to; NaN: at no load searched",
                ),
                "snap_above": Variable(
                    each,
                    loads([s.above for s in found]),
                    "N",
                    "it disappears when the load rises to; NaN: at no load searched",
                ),
                "searched": Variable(
                    (*each, "end"),
                    np.array([s.searched for s in found]).reshape(-1, 2),
                    "N",
                    "lowest and highest load searched",
                ),
                "sentence": Variable(
                    each, np.array([s.sentence for s in found], dtype=object), "1", "the answer in words"
                ),
            },
        )

    @staticmethod
    def draw(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
        """Nothing to draw: the bifurcation diagram of an equilibrium map over F0 shows it."""
        return {}
