"""Basins over two to four coordinates of the start: well and turns in which it ends, when it is captured.

Layout: variables over the grid, one dimension for each axis; what is known about the scene's equilibria along
``equilibrium``; every (well, turns) that occurs, with its share, along ``basin``. ``label`` points into these
and is -1 where there is no label; ``status`` says why.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import AfterValidator, Field

from fastmech.basins.label import require_damper
from fastmech.basins.map import STATE, BasinMap, map_basins
from fastmech.basins.status import BasinStatus
from fastmech.errors import InputError
from fastmech.results import Dataset, Variable, flags
from fastmech.scan_types.equilibrium_map import Axis
from fastmech.scan_types.request import MethodName, RunContext, Scan
from fastmech.scene import Scene, nearest

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Starts of the largest map that is held in memory with its labels.
MOST_POINTS = 20_000_000

_UNITS = {"phi": "rad", "theta": "rad", "phi_dot": "rad/s", "theta_dot": "rad/s"}


def _known_coordinates(entries: dict[str, Axis] | dict[str, float]) -> dict[str, Axis] | dict[str, float]:
    for name in entries:
        if name not in STATE:
            raise ValueError(f"unknown coordinate {name!r}; {nearest(name, list(STATE))}")
    return entries


def _power_of_two(value: int | None) -> int | None:
    if value is not None and value & (value - 1):
        raise ValueError("must be a power of two")
    return value


class Basins(Scan):
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
    settle_radius: Annotated[float | None, Field(gt=0)] = Field(
        None, description="also the time from which on a motion stays so near to its well [rad]"
    )
    dt: Annotated[float | None, Field(gt=0)] = Field(None, description="coarsest step [s]")
    method: MethodName = "dop853"

    def check(self, scene: Scene) -> None:
        """Without a damper there are no basins; and a map has its limits."""
        require_damper(scene)
        total = math.prod(axis.num for axis in self.axes.values())
        if total > MOST_POINTS:
            raise InputError(f"axes: ask for {total:.3g} starts, at most {MOST_POINTS:.0e} are allowed")
        for name, axis in self.axes.items():
            if name in self.fixed:
                raise InputError(f"fixed.{name}: is an axis of the map; give one or the other")
            if axis.num > 1 and axis.stop <= axis.start:
                raise InputError(
                    f"axes.{name}.stop = {axis.stop:g}: must be greater than start = {axis.start:g}"
                )

    def run(self, scene: Scene, context: RunContext) -> Dataset:
        """Label the grid."""
        axes = {name: np.linspace(axis.start, axis.stop, axis.num) for name, axis in self.axes.items()}
        found = map_basins(
            scene,
            axes,
            self.t_end,
            fixed=self.fixed,
            refine=self.refine,
            dt=self.dt,
            method=self.method,
            settle_radius=self.settle_radius,
            threads=context.threads,
            progress=context.stage("basin map", math.prod(axis.num for axis in self.axes.values())),
        )
        attrs: dict[str, Any] = {"axes": tuple(axes), "t_end": self.t_end, "method": self.method}
        attrs |= {"steps": found.steps, "refine": self.refine or 0}
        attrs |= {f"fixed_{name}": value for name, value in found.fixed.items()}
        attrs |= found.counts
        return Dataset(_coordinates(found) | _grid_variables(found) | _wells(found), attrs)

    @staticmethod
    def draw(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
        """Labels, with equilibria and the wells' energy contours on top, and times."""
        from fastmech.plots.basins import draw_basins

        return draw_basins(dataset, scene)


def _coordinates(found: BasinMap) -> dict[str, Variable]:
    described = {
        "phi": "angle phi",
        "theta": "angle theta",
        "phi_dot": "rate of phi",
        "theta_dot": "rate of theta",
    }
    return {
        name: Variable((name,), values, _UNITS[name], f"{described[name]} at the start")
        for name, values in found.axes.items()
    }


def _grid_variables(found: BasinMap) -> dict[str, Variable]:
    names = tuple(found.axes)
    label, table = found.labels
    share = np.array([np.mean(label == i) for i in range(len(table))])
    variables = {
        "label": Variable(names, label.astype(np.int32), "1", "basin of the start, -1: no label"),
        "well": Variable(names, found.well, "1", "equilibrium that captures the start, -1: no label"),
        "turns_phi": Variable(names, found.turns[..., 0], "1", "full turns of phi of that well"),
        "turns_theta": Variable(names, found.turns[..., 1], "1", "full turns of theta of that well"),
        "capture_time": Variable(
            names, found.time, "s", "time of capture, NaN: not captured or not computed"
        ),
        "status": Variable(names, found.status, "1", "what is known of the start", flags(BasinStatus)),
        "computed": Variable(names, found.computed, "1", "computed, not filled in between equal labels"),
        "basin_well": Variable(("basin",), table[:, 0].astype(np.int8), "1", "equilibrium of the basin"),
        "basin_turns_phi": Variable(("basin",), table[:, 1].astype(np.int32), "1", "its full turns of phi"),
        "basin_turns_theta": Variable(
            ("basin",), table[:, 2].astype(np.int32), "1", "its full turns of theta"
        ),
        "basin_share": Variable(("basin",), share, "1", "share of the starts"),
    }
    if found.settle_time is not None:
        variables["settle_time"] = Variable(
            names,
            found.settle_time,
            "s",
            "time from which on the motion stays in the settling ball, NaN: none",
        )
    return variables


def _wells(found: BasinMap) -> dict[str, Variable]:
    assert found.tree is not None  # a scene's map has one
    equilibria, each = found.tree.equilibria, ("equilibrium",)
    barrier = np.full(len(equilibria), np.nan)
    barrier[list(found.tree.wells)] = found.tree.barrier
    return {
        "equilibrium_phi": Variable(each, equilibria.phi, "rad", "angle phi of the equilibrium"),
        "equilibrium_theta": Variable(each, equilibria.theta, "rad", "angle theta of the equilibrium"),
        "equilibrium_energy": Variable(each, equilibria.energy, "J", "potential energy of the equilibrium"),
        "equilibrium_morse_index": Variable(
            each, equilibria.morse_index, "1", "unstable directions, 0: a well"
        ),
        "barrier": Variable(each, barrier, "J", "energy at which the well first meets another, NaN: no well"),
        "force": Variable((), np.array(equilibria.force), "N", "constant force that the wells hold for"),
    }
