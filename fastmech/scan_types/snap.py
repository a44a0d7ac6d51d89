"""The loads at which each resting position of the scene disappears."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from pydantic import Field

from fastmech.atlas.snap import find_snap
from fastmech.equilibria.find import Equilibrium, find_equilibria
from fastmech.errors import InputError
from fastmech.results import Dataset, Variable
from fastmech.scan_types.each import Each
from fastmech.scan_types.request import TiledScan
from fastmech.scan_types.tiling import Tiling
from fastmech.scene import Number, Scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class SnapScan(TiledScan):
    """Constant loads F0, below and above the present one, at which a stable position merges with a saddle."""

    kind: ClassVar[str] = "snap"

    searched: list[Number] | None = Field(None, min_length=2, max_length=2, description="loads to search [N]")

    def check(self, scene: Scene) -> None:
        """The range must hold the present load."""
        present = scene.F0 if scene.alpha == 0.0 else 0.0
        if self.searched is not None and not self.searched[0] <= present <= self.searched[1]:
            raise InputError(
                f"searched = {self.searched}: must be a range of forces that holds {present:g} N"
            )

    def tiling(self, scene: Scene) -> Tiling:
        """The stable positions one by one."""
        stable = {k: e for k, e in enumerate(find_equilibria(scene)) if e.morse_index == 0}
        each = list(stable.values())
        return Each(
            "stable positions",
            len(each),
            lambda k: self._one(scene, each[k]),
            lambda tiles: _joined(list(stable), tiles),
        )

    def _one(self, scene: Scene, equilibrium: Equilibrium) -> Dataset:
        """Follow one stable position as the load changes; NaN stands for no load."""
        limits = (self.searched[0], self.searched[1]) if self.searched is not None else None
        found = find_snap(scene, equilibrium, limits)
        ends = [np.nan if load is None else load for load in (found.below, found.above)]
        row = np.array([found.phi, found.theta, *ends, *found.searched], dtype=np.float64)
        return Dataset({"row": Variable(("entry",), row)}, {"sentence": found.sentence})

    @staticmethod
    def draw(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
        """Nothing to draw: the bifurcation diagram of an equilibrium map over F0 shows it."""
        return {}


def _joined(which: list[int], tiles: list[Dataset]) -> Dataset:
    rows = np.array([tile["row"].data for tile in tiles]).reshape(-1, 6)
    each = ("equilibrium",)
    sentences = np.array([tile.attrs["sentence"] for tile in tiles], dtype=object)
    gone = "it disappears when the load {} to; NaN: at no load searched"
    return Dataset(
        {
            "equilibrium": Variable(each, np.array(which, np.int32), "1", "number of the equilibrium"),
            "end": Variable(("end",), np.array(["lowest", "highest"], object), "1", "end of the search"),
            "phi": Variable(each, rows[:, 0], "rad", "angle phi"),
            "theta": Variable(each, rows[:, 1], "rad", "angle theta"),
            "snap_below": Variable(each, rows[:, 2], "N", gone.format("falls")),
            "snap_above": Variable(each, rows[:, 3], "N", gone.format("rises")),
            "searched": Variable((*each, "end"), rows[:, 4:], "N", "lowest and highest load searched"),
            "sentence": Variable(each, sentences, "1", "the answer in words"),
        }
    )
