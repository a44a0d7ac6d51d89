"""Basins over two to four coordinates of the start: well and turns in which it ends, when it is captured.

Layout: variables over the grid, one dimension for each axis; what is known about the scene's equilibria along
``equilibrium``; every (well, turns) that occurs, with its share, along ``basin``. ``label`` points into these
and is -1 where there is no label; ``status`` says why.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from pydantic import AfterValidator, Field

from fastmech.basins.label import require_damper
from fastmech.basins.map import STATE
from fastmech.basins.steps import method_for
from fastmech.errors import InputError, shown
from fastmech.results import Dataset
from fastmech.scan_types.axis import Axis, arrays, check_duration, check_rising, check_size, check_starts
from fastmech.scan_types.basin_tiling import BasinTiling
from fastmech.scan_types.request import TiledScan, UsualMethod
from fastmech.scan_types.tiling import Tiling
from fastmech.scene import Number, Scene, nearest
from fastmech.step_limits.warning import step_warning

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Starts of the largest map that is held in memory with its labels, and the numbers of 8 bytes of each.
MOST_POINTS, POINT_NUMBERS = 20_000_000, 20


def _known_coordinates(entries: dict[str, Axis] | dict[str, float]) -> dict[str, Axis] | dict[str, float]:
    for name in entries:
        if name not in STATE:
            raise ValueError(f"unknown coordinate {shown(name)}; {nearest(name, list(STATE))}")
    return entries


def _power_of_two(value: int | None) -> int | None:
    if value is not None and value & (value - 1):
        raise ValueError("must be a power of two")
    return value


class Basins(TiledScan):
    """A basin map of a slice of state space, labels proved by capture."""

    kind: ClassVar[str] = "basins"

    axes: Annotated[dict[str, Axis], Field(min_length=2, max_length=4), AfterValidator(_known_coordinates)]
    fixed: Annotated[dict[str, float], AfterValidator(_known_coordinates)] = Field(
        default={}, description="the other coordinates of the starts [rad, rad/s], 0 by default"
    )
    t_end: Annotated[float, Field(gt=0)] = 60.0
    refine: Annotated[int | None, Field(ge=2, le=1024), AfterValidator(_power_of_two)] = Field(
        None, description="compute so coarse a grid first, then only near boundaries (a heuristic)"
    )
    settle_radius: Annotated[Number, Field(gt=0)] | None = Field(
        None, description="also the time from which on a motion stays so near to its well [rad]"
    )
    dt: Annotated[float | None, Field(gt=0)] = Field(None, description="coarsest step [s]")
    method: UsualMethod = None

    def check(self, scene: Scene) -> None:
        """Without a damper there are no basins; and a map has its limits."""
        require_damper(scene)
        check_size("axes", self.axes, "starts", MOST_POINTS, POINT_NUMBERS)
        for name, axis in self.axes.items():
            if name in self.fixed:
                raise InputError(f"fixed.{name}: is an axis of the map; give one or the other")
            check_rising(f"axes.{name}", axis)
        starts = {f"axes.{name}": axis.array for name, axis in self.axes.items()}
        check_starts(scene, starts | {f"fixed.{name}": np.array(value) for name, value in self.fixed.items()})
        check_duration(scene, self.t_end, self.dt)

    def step_warning(self, scene: Scene) -> str | None:
        """By the scene's limit and the decaying force; without ``dt`` each start's step is chosen."""
        return None if self.dt is None else step_warning(scene, self.dt, method_for(scene, self.method))

    def tiling(self, scene: Scene) -> Tiling:
        """Planes of the first axis; a refined map is one tile, because it follows boundaries anywhere."""
        return BasinTiling(self, scene, arrays(self.axes))

    @staticmethod
    def draw(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
        """Labels, with equilibria and the wells' energy contours on top, and times."""
        from fastmech.plots.basins import draw_basins

        return draw_basins(dataset, scene)
