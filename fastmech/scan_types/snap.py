"""The loads, or the values of another parameter, at which resting positions of the scene end."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from pydantic import AfterValidator, Field

from fastmech.atlas.snap import find_snap
from fastmech.errors import InputError
from fastmech.results import Dataset, Variable, columns
from fastmech.scan_types.request import Each, Scan, Tiling, tile_of
from fastmech.scene import Number, Scene, nearest
from fastmech.slider.atlas.snap import MOVING, stable_at
from fastmech.slider.equilibria import Equilibrium, find_equilibria


def _moving(name: str) -> str:
    if name not in MOVING:
        raise ValueError(f"must be one that moves equilibria; {nearest(name, list(MOVING))}")
    return name


class SnapScan(Scan):
    """Values of a parameter, below and above the present one, at which a stable position ends.

    Nothing is drawn: the bifurcation diagram of an equilibrium map over the parameter shows it.
    """

    kind: ClassVar[str] = "snap"

    parameter: Annotated[str, AfterValidator(_moving)] = Field(
        "F0", description=f"what changes: one of {', '.join(MOVING)}"
    )
    position: list[Number] | None = Field(
        None,
        min_length=2,
        max_length=2,
        description="about where the stable position is [rad], all by default",
    )
    searched: list[Number] | None = Field(
        None, min_length=2, max_length=2, description="values to search [the parameter's unit]"
    )

    def check(self, scene: Scene) -> None:
        """The range must hold the present value, and the scene accept its ends."""
        if self.searched is None:
            return
        for end in self.searched:
            scene.replace(**{self.parameter: end})
        present = getattr(scene.replace(F0=scene.F0 if scene.alpha == 0.0 else 0.0), self.parameter)
        low, high = self.searched
        if not (low < high and low <= present <= high):
            told = f"must be a range of {self.parameter} that holds {present:g}"
            raise InputError(f"searched = {self.searched}: {told}")

    def tiling(self, scene: Scene) -> Tiling:
        """The stable positions one by one."""
        found = find_equilibria(scene)
        stable = [e for e in found if e.morse_index == 0]
        if self.position is not None:
            stable = [stable_at(found, self.position)]
        which = [found.index_of(e) for e in stable]
        return Each(
            "stable positions",
            len(stable),
            lambda k: self._one(scene, stable[k]),
            lambda tiles: self._joined(which, tiles),
        )

    def _one(self, scene: Scene, position: Equilibrium) -> Dataset:
        """Follow one stable position as the parameter changes; NaN stands for no value."""
        limits = (self.searched[0], self.searched[1]) if self.searched is not None else None
        found = find_snap(scene, position, limits, parameter=self.parameter)
        ends = [np.nan if value is None else value for value in (found.below, found.above)]
        row = np.array([*found.position, *ends, *found.searched], dtype=np.float64)
        unstable = np.array([how == "turns unstable" for how in found.how])
        return tile_of({"row": row, "unstable": unstable}, {"sentence": found.sentence, "unit": found.unit})

    def _joined(self, which: list[int], tiles: list[Dataset]) -> Dataset:
        rows = np.array([tile["row"].data for tile in tiles]).reshape(-1, 6)
        unstable = np.array([tile["unstable"].data for tile in tiles], dtype=np.bool_).reshape(-1, 2)
        sentences = np.array([tile.attrs["sentence"] for tile in tiles], dtype=object)
        unit = str(tiles[0].attrs["unit"]) if tiles else "1"
        name, ends = self.parameter, np.array(["lowest", "highest"], object)
        gone = f"it ends when {name} {{}} to; NaN: at no value searched"
        each = {
            "phi": (rows[:, 0], "rad", "angle phi"),
            "theta": (rows[:, 1], "rad", "angle theta"),
            "snap_below": (rows[:, 2], unit, gone.format("falls")),
            "snap_above": (rows[:, 3], unit, gone.format("rises")),
        }
        both = {
            "turns_unstable": (unstable, "1", "it goes on there as an unstable one and does not disappear"),
            "searched": (rows[:, 4:], unit, f"lowest and highest {name} searched"),
        }
        about = {"equilibrium": (np.array(which, np.int32), "1", "number of the equilibrium")}
        words = {"sentence": (sentences, "1", "the answer in words")}
        variables = {
            **columns(("equilibrium",), about),
            "end": Variable(("end",), ends, "1", "end of the search"),
            **columns(("equilibrium",), each),
            **columns(("equilibrium", "end"), both),
            **columns(("equilibrium",), words),
        }
        return Dataset(variables, {"parameter": name})
