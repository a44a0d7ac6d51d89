"""Basins over two to four coordinates of the start: well and turns in which it ends, when it is captured.

Layout: variables over the grid, one dimension for each axis. In groups of their own, so that a table of the
map has a row for each start: ``equilibria``, and ``basins``, every (well, turns) that occurs, with its share.
``label`` points into the latter and is -1 where there is no label; ``status`` says why.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from fastmech import results
from fastmech.attractors.find import Attractors
from fastmech.attractors.flow import keeps_moving
from fastmech.basins.label import LONG, capture_end
from fastmech.basins.map import BasinMap, map_basins
from fastmech.capture.select import certificate_of, require_damper
from fastmech.ensembles.status import LABELS, Status
from fastmech.errors import InputError
from fastmech.models.mechanism import Mechanism
from fastmech.objects import coordinate_units, state_units
from fastmech.plots.basins import draw_basins
from fastmech.results import Dataset, Variable, columns, numbers, told
from fastmech.scan_types import request as scans
from fastmech.scan_types.attractors import some_points
from fastmech.scan_types.map_layout import equilibria_table
from fastmech.scene import Number, Scene
from fastmech.slider.capture.certificate import BarrierTree
from fastmech.slider.capture.steps import method_for
from fastmech.step_limits.warning import step_warning
from fastmech.store.objects import dataset_of

#: Starts of the largest map that is held in memory with its labels, and the numbers of 8 bytes of each.
MOST_POINTS, POINT_NUMBERS = 20_000_000, 20

#: Starts of a tile, about, and of one whose motions may be longer the fewer: a second or two of one thread.
TILE_POINTS = 1 << 14


class Basins(scans.Scan):
    """A basin map of a slice of state space, labels proved by capture."""

    kind: ClassVar[str] = "basins"
    draw = staticmethod(draw_basins)
    of_mechanisms = True
    taken = frozenset({"label", "well", "turns", "time", "capture_time", "settle_time", "status", "computed"})

    axes: dict[str, scans.Axis] = Field(min_length=2, max_length=4)
    fixed: dict[str, float] = Field(
        default={}, description="the other coordinates of the starts [rad, rad/s], 0 by default"
    )
    t_end: float | None = Field(
        None, gt=0, description="end of the runs [s]; by default as fm.map_basins, 60 or longer or shorter"
    )
    refine: Literal[2, 4, 8, 16, 32, 64, 128, 256, 512, 1024] | None = Field(
        None, description="compute so coarse a grid first, then only near boundaries (a heuristic)"
    )
    settle_radius: Number | None = Field(
        None, gt=0, description="also the time from which on a motion stays so near to its well [rad]"
    )
    dt: float | None = Field(None, gt=0, description="coarsest step [s]")
    method: scans.UsualMethod = None

    def check(self, scene: Scene | Mechanism) -> None:
        """Without a damper there are no basins; and a map has its limits."""
        if keeps_moving(scene):
            raise InputError(
                "kind: under loads that repeat nothing comes to rest, and labels are attractors; take "
                'kind = "attractors", with these axes, or fastmech.map_basins'
            )
        require_damper(scene)
        scans.check_names("axes.", self.axes, scene.state, "unknown coordinate")
        scans.check_names("fixed.", self.fixed, scene.state, "unknown coordinate")
        scans.check_size("axes", self.axes, "starts", MOST_POINTS, POINT_NUMBERS)
        for name in self.axes:
            if name in self.fixed:
                raise InputError(f"fixed.{name}: is an axis of the map; give one or the other")
        scans.check_rising("axes.", self.axes)
        if isinstance(scene, Scene):
            scans.check_starts("axes.", scene, scans.values_of(self.axes))
            scans.check_starts("fixed.", scene, self.fixed)
            scans.check_duration(scene, self.t_end or LONG, self.dt)

    def step_warning(self, scene: Scene | Mechanism) -> str | None:
        """By the scene's limit and the decaying force; without ``dt`` each start's step is chosen."""
        if self.dt is None or isinstance(scene, Mechanism):
            return None
        return step_warning(scene, self.dt, method_for(scene, self.method))

    def tiling(self, scene: Scene | Mechanism) -> scans.Tiling:
        """Planes of the first axis; a refined map is one tile, because it follows boundaries anywhere."""
        return BasinTiling(self, scene)


class BasinTiling(scans.Planes):
    """Every tile holds some planes of the first axis, each so many apart."""

    what = "starts of the basin map"

    def __init__(self, request: Basins, scene: Scene | Mechanism) -> None:
        self.request, self.scene = request, scene
        self.certificate = certificate_of(scene)  # wells that are not certain are refused before any tile
        self.t_end = capture_end(self.certificate) if request.t_end is None else request.t_end
        axes, usual = scans.values_of(request.axes), int(TILE_POINTS * min(1.0, LONG / self.t_end))
        points = usual if request.refine is None else math.prod(map(len, axes.values()))
        super().__init__(axes, points, spread=True)
        self.nothing = {
            "well": np.int8(-1),
            "turns": np.zeros(len(scene.state) // 2, dtype=np.int32),
            "time": np.nan,
            "status": np.int8(Status.UNDECIDED),
            "computed": False,
            **({} if request.settle_radius is None else {"settle_time": np.nan}),
        }

    def compute(self, index: int, context: scans.RunContext) -> Dataset:
        """Label some planes."""
        advance = context.stage(self.what, self.items(index)) if self.count == 1 else None

        def told(finished: int) -> None:
            context.check()
            if advance is not None:
                advance(finished)

        found = map_basins(
            self.scene,
            self.axes_of(index),
            self.t_end,
            **self.request.asked("fixed", "refine", "dt", "method", "settle_radius"),
            threads=context.threads,
            progress=told,
        )
        return scans.tile_of({name: getattr(found, name) for name in self.nothing}, {"steps": found.steps})

    def section(self, arrays: dict[str, Any], tiles: list[Dataset]) -> Dataset:
        """Number the basins."""
        held = self.request.fixed
        found = BasinMap(
            axes=self.axes,
            fixed={name: held.get(name, 0.0) for name in self.scene.state if name not in self.axes},
            tree=self.certificate.tree,
            t_end=self.t_end,
            steps=sum(int(part.attrs["steps"]) for part in tiles),
            **({"settle_time": None} | arrays),
        )
        dataset = basin_dataset(found.of(self.scene))
        more = {"method": self.certificate.method(self.request.method), "refine": self.request.refine or 0}
        return replace(dataset, attrs={**dataset.attrs, **more})


def basin_dataset(found: BasinMap) -> Dataset:
    """The section of a map; one labelled by attractors or codes has no wells."""
    if found.tree is None:
        return dataset_of(found)
    if isinstance(found.tree, Attractors):
        ends, units = found.tree.attractors, state_units(found.system)
        made, names = dataset_of(found), {"ends": tuple(one.name for one in ends)}
        groups = {"points": some_points(ends, units)}
        return replace(made, attrs={**made.attrs, **names}, groups=groups)
    attrs: dict[str, Any] = {"axes": tuple(found.axes), "t_end": found.t_end, "steps": found.steps}
    attrs |= told(found.system) | {f"fixed_{name}": value for name, value in found.fixed.items()}
    if isinstance(found.system, Mechanism):
        turning = [str(q.symbol) for q in found.system.coordinates if q.periodic]
        attrs |= {"turning_names": tuple(turning)} if turning else {}
    units = coordinate_units(found.system)
    groups = {"basins": Dataset(_basins(found, units)), "equilibria": Dataset(_wells(found.tree, units))}
    attrs |= found.counts | scans.failures(found.status)
    return Dataset(_starts(found, units), attrs, groups)


def _starts(found: BasinMap, coordinates: Mapping[str, str]) -> dict[str, Variable]:
    """What is known of every start; ``coordinates`` are names with their units."""
    names, units = tuple(found.axes), state_units(found.system)
    about = {name: f"{results.KINDS[unit]} {name}" for name, unit in coordinates.items()}
    about |= {f"{name}_dot": f"rate of {name}" for name in coordinates}
    known = {
        "label": (found.labels[0].astype(np.int32), "1", "basin of the start", results.NO_CODE),
        "well": (found.well, "1", "equilibrium that captures the start", results.NO_CODE),
        "turns": (found.turns, dict.fromkeys(coordinates, "1"), "full turns of {} of that well"),
        "capture_time": (found.time, "s", "time of capture, NaN: not captured or not computed"),
        "status": (found.status, "1", "what is known of the start", results.flags(LABELS)),
        "computed": (found.computed, "1", "computed, not filled in between equal labels"),
    }
    variables = {
        **{n: Variable((n,), v, units[n], f"{about[n]} at the start") for n, v in found.axes.items()},
        **columns(names, known),
    }
    if isinstance(found.tree, BarrierTree):
        force = np.array(found.tree.equilibria.force)
        variables["force"] = Variable((), force, "N", "constant force that the wells hold for")
    if found.settle_time is not None:
        settling = "time from which on the motion stays in the settling ball, NaN: none"
        variables["settle_time"] = Variable(names, found.settle_time, "s", settling)
    return variables


def _basins(found: BasinMap, coordinates: Mapping[str, str]) -> dict[str, Variable]:
    """Every well and turns that occur."""
    label, table = found.labels
    share = np.array([np.mean(label == i) for i in range(len(table))])
    most, turns = share + np.mean(label < 0), dict.fromkeys(coordinates, "1")
    rows = {
        "basin_well": (table[:, 0].astype(np.int8), "1", "equilibrium of the basin"),
        "basin_turns": (table[:, 1:].astype(np.int32), turns, "its full turns of {}"),
        "basin_share": (share, "1", "share of the starts"),
        "basin_share_at_most": (most, "1", "share of the starts if all without a label ended there"),
    }
    return numbers("basin", len(table), "number of the basin") | columns(("basin",), rows)


def _wells(tree: Any, coordinates: Mapping[str, str]) -> dict[str, Variable]:
    """The scene's equilibria."""
    barrier = np.full(len(tree.equilibria), np.nan)
    barrier[list(tree.wells)] = tree.barrier
    about = "energy at which the well first meets another, NaN: no well"
    barriers = columns(("equilibrium",), {"barrier": (barrier, "J", about)})
    return equilibria_table(tree.equilibria, coordinates) | barriers
