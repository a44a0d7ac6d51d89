"""The loads, or the values of another parameter, at which resting positions of the scene end."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from fastmech.atlas.snap import find_snap, moved_by, range_searched, stable_place, stable_places
from fastmech.errors import InputError
from fastmech.models.mechanism import Mechanism
from fastmech.objects import coordinate_units
from fastmech.results import Dataset, Variable, columns, told
from fastmech.scan_types.request import Each, Scan, Tiling, check_names, tile_of
from fastmech.scene import Number, Scene
from fastmech.slider.atlas.snap import MOVING

_ENDS = ("snap_below", "snap_above", "turns_unstable", "searched")


class SnapScan(Scan):
    """Values of a parameter, below and above the present one, at which a stable position ends.

    A mechanism that is not the paper's needs the name of the parameter.

    Nothing is drawn: the branches of an equilibrium map over the parameter show it.
    """

    kind: ClassVar[str] = "snap"
    of_mechanisms = True
    instead: ClassVar[str] = "; an equilibrium_map over its parameter alone shows where positions end"
    taken = frozenset({"equilibrium", "end", "sentence", *_ENDS})

    parameter: str = Field("F0", description=f"what changes: of the paper's one of {', '.join(MOVING)}")
    position: list[Number] | None = Field(
        None, description="about where the stable position is [rad or m], all by default"
    )
    searched: list[Number] | None = Field(
        None,
        min_length=2,
        max_length=2,
        description="values to search [the parameter's unit], by default as find_snap",
    )

    def check(self, scene: Scene | Mechanism) -> None:
        """The range must hold the present value, and the scene accept its ends."""
        if isinstance(scene, Mechanism):
            moved_by(scene, self.parameter if "parameter" in self.model_fields_set else None)
        else:
            check_names("parameter = ", [self.parameter], MOVING, "must be one that moves equilibria, not")
        if self.position is not None and len(self.position) != len(coordinate_units(scene)):
            raise InputError(f"position = {self.position}: must be {', '.join(coordinate_units(scene))}")
        if self.searched is None:
            return
        held = scene if isinstance(scene, Mechanism) or scene.alpha == 0.0 else scene.replace(F0=0.0)
        range_searched(held, self.searched, self.parameter)

    def tiling(self, scene: Scene | Mechanism) -> Tiling:
        """The stable positions one by one."""
        found, which = stable_places(scene)
        if self.position is not None:
            which = [found.index_of(stable_place(scene, self.position))]
        return Each(
            "stable positions",
            len(which),
            lambda k: self._one(scene, found[which[k]]),
            lambda tiles: self._joined(scene, which, tiles),
        )

    def _one(self, scene: Scene | Mechanism, position: Any) -> Dataset:
        """Follow one stable position as the parameter changes; NaN stands for no value."""
        limits = (self.searched[0], self.searched[1]) if self.searched is not None else None
        found = find_snap(scene, position, limits, parameter=self.parameter)
        ends = [np.nan if value is None else value for value in (found.below, found.above)]
        row = np.array([*found.position, *ends, *found.searched], dtype=np.float64)
        unstable = np.array([how == "turns unstable" for how in found.how])
        return tile_of({"row": row, "unstable": unstable}, {"sentence": found.sentence, "unit": found.unit})

    def _joined(self, scene: Scene | Mechanism, which: list[int], tiles: list[Dataset]) -> Dataset:
        coordinates = coordinate_units(scene)
        rows = np.array([tile["row"].data for tile in tiles]).reshape(-1, len(coordinates) + 4)
        places, rows = np.split(rows, [len(coordinates)], axis=1)
        unstable = np.array([tile["unstable"].data for tile in tiles], dtype=np.bool_).reshape(-1, 2)
        sentences = np.array([tile.attrs["sentence"] for tile in tiles], dtype=object)
        unit = str(tiles[0].attrs["unit"]) if tiles else "1"
        name, ends = self.parameter, np.array(["lowest", "highest"], object)
        gone = f"it ends when {name} {{}} to; NaN: at no value searched"
        each = {
            "": (places, coordinates, "{1} {0}"),
            "snap_below": (rows[:, 0], unit, gone.format("falls")),
            "snap_above": (rows[:, 1], unit, gone.format("rises")),
        }
        both = {
            "turns_unstable": (unstable, "1", "it goes on there as an unstable one and does not disappear"),
            "searched": (rows[:, 2:], unit, f"lowest and highest {name} searched"),
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
        return Dataset(variables, {**told(scene), "parameter": name})
