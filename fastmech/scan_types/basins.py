"""Basins over two to four coordinates of the start: well and turns in which it ends, when it is captured.

Layout: variables over the grid, one dimension for each axis. In groups of their own, so that a table of the
map has a row for each start: ``equilibria``, and ``basins``, every (well, turns) that occurs, with its share.
``label`` points into the latter and is -1 where there is no label; ``status`` says why.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field

from fastmech.basins.map import BasinMap, map_basins
from fastmech.capture.select import certificate_of, require_damper
from fastmech.ensembles.status import FAILURES, LABELS, Status
from fastmech.errors import InputError, shown
from fastmech.models.mechanism import Mechanism
from fastmech.results import NO_CODE, Dataset, Variable, coordinate_units, flags, numbers, told
from fastmech.scan_types.request import (
    Axis,
    Planes,
    RunContext,
    Scan,
    Tiles,
    Tiling,
    UsualMethod,
    arrays,
    check_duration,
    check_rising,
    check_size,
    check_starts,
    failures,
)
from fastmech.scene import STATE, Number, Scene, nearest
from fastmech.slider.capture.barriers import BarrierTree
from fastmech.slider.capture.steps import method_for
from fastmech.step_limits.warning import step_warning
from fastmech.store.objects import dataset_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Starts of the largest map that is held in memory with its labels, and the numbers of 8 bytes of each.
MOST_POINTS, POINT_NUMBERS = 20_000_000, 20

#: Starts of a tile, about, and of one whose motions may be longer the fewer: a second or two of one thread.
TILE_POINTS = 1 << 14
USUAL_END = 60.0

#: The dimension of turns in a tile.
TURNED = "turned_coordinate"

#: What a tile knows of every start, by the names in `fastmech.basins.map.BasinMap`.
_ARRAYS = ("well", "turns", "time", "settle_time", "status", "computed")


def _power_of_two(value: int | None) -> int | None:
    if value is not None and value & (value - 1):
        raise ValueError("must be a power of two")
    return value


class Basins(Scan):
    """A basin map of a slice of state space, labels proved by capture."""

    kind: ClassVar[str] = "basins"
    of_mechanisms = True
    taken = frozenset(
        {TURNED, "label", "well", "turns", "time", "capture_time", "settle_time", "status", "computed"}
    )

    axes: Annotated[dict[str, Axis], Field(min_length=2, max_length=4)]
    fixed: dict[str, float] = Field(
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

    def check(self, scene: Scene | Mechanism) -> None:
        """Without a damper there are no basins; and a map has its limits."""
        require_damper(scene)
        names = _states(scene)
        for where, entries in (("axes", self.axes), ("fixed", self.fixed)):
            for name in entries:
                if name not in names:
                    told = nearest(name, list(names))
                    raise InputError(f"{where}.{name}: unknown coordinate {shown(name)}; {told}")
        check_size("axes", self.axes, "starts", MOST_POINTS, POINT_NUMBERS)
        for name, axis in self.axes.items():
            if name in self.fixed:
                raise InputError(f"fixed.{name}: is an axis of the map; give one or the other")
            check_rising(f"axes.{name}", axis)
        if isinstance(scene, Mechanism):
            return
        starts = {f"axes.{name}": axis.array for name, axis in self.axes.items()}
        check_starts(scene, starts | {f"fixed.{name}": np.array(value) for name, value in self.fixed.items()})
        check_duration(scene, self.t_end, self.dt)

    def step_warning(self, scene: Scene | Mechanism) -> str | None:
        """By the scene's limit and the decaying force; without ``dt`` each start's step is chosen."""
        if self.dt is None or isinstance(scene, Mechanism):
            return None
        return step_warning(scene, self.dt, method_for(scene, self.method))

    def tiling(self, scene: Scene | Mechanism) -> Tiling:
        """Planes of the first axis; a refined map is one tile, because it follows boundaries anywhere."""
        return BasinTiling(self, scene, arrays(self.axes))

    @staticmethod
    def draw(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
        """Labels, with equilibria and the wells' energy contours on top, and times."""
        from fastmech.plots.basins import draw_basins

        return draw_basins(dataset.merged, scene)


class BasinTiling(Planes):
    """Every tile holds some planes of the first axis, each so many apart.

    Args:
        request: how to compute.
        scene: the mechanism.
        axes: coordinates of the starts with their values.
    """

    what = "starts of the basin map"

    def __init__(
        self, request: Basins, scene: Scene | Mechanism, axes: dict[str, NDArray[np.float64]]
    ) -> None:
        self.request, self.scene, self.names = request, scene, _states(scene)
        usual = int(TILE_POINTS * min(1.0, USUAL_END / request.t_end))
        points = usual if request.refine is None else math.prod(map(len, axes.values()))
        super().__init__(axes, points, spread=True)

    def compute(self, index: int, context: RunContext) -> Dataset:
        """Label some planes."""
        advance = context.stage(self.what, self.items(index)) if self.count == 1 else None

        def told(finished: int) -> None:
            context.check()
            if advance is not None:
                advance(finished)

        found = map_basins(
            self.scene,
            self.axes_of(index),
            self.request.t_end,
            fixed=self.request.fixed,
            refine=self.request.refine,
            dt=self.request.dt,
            method=self.request.method,
            settle_radius=self.request.settle_radius,
            threads=context.threads,
            progress=told,
        )
        return self._tile({name: getattr(found, name) for name in _ARRAYS}, found.steps)

    def assemble(self, tile: Tiles) -> Dataset:
        """Join the planes and number the basins."""
        tiles = [tile(index) for index in range(self.count)]
        certificate = certificate_of(self.scene)
        found = BasinMap(
            axes=self.axes,
            fixed={name: self.request.fixed.get(name, 0.0) for name in self.names if name not in self.axes},
            tree=certificate.tree,
            t_end=self.request.t_end,
            steps=sum(int(part.attrs["steps"]) for part in tiles),
            **{name: self._known(tiles, name) for name in _ARRAYS},
        )
        dataset = basin_dataset(found.of(self.scene))
        more = {"method": certificate.method(self.request.method), "refine": self.request.refine or 0}
        return Dataset(dataset.variables, {**dataset.attrs, **more}, dataset.groups)

    def missing(self, index: int) -> Dataset:
        """Starts that have not been computed."""
        grid = self.grid(index)
        nothing = np.full(grid, np.nan)
        arrays: dict[str, NDArray[Any] | None] = {
            "well": np.full(grid, -1, dtype=np.int8),
            "turns": np.zeros((*grid, len(self.names) // 2), dtype=np.int32),
            "time": nothing,
            "status": np.full(grid, Status.UNDECIDED, dtype=np.int8),
            "computed": np.zeros(grid, dtype=np.bool_),
            "settle_time": None if self.request.settle_radius is None else nothing,
        }
        return self._tile(arrays, 0)

    def _known(self, tiles: list[Dataset], name: str) -> Any:
        """An array of all tiles; None where they have none."""
        array = self.joined(tiles, name) if name in tiles[0] else None
        return array.astype(np.bool_) if array is not None and name == "computed" else array

    def _tile(self, arrays: dict[str, NDArray[Any] | None], steps: int) -> Dataset:
        dims = (*self.axes, TURNED)
        there = {name: array for name, array in arrays.items() if array is not None}
        return Dataset(
            {name: Variable(dims[: array.ndim], array) for name, array in there.items()}, {"steps": steps}
        )


def basin_dataset(found: BasinMap) -> Dataset:
    """The section of a map; one labelled by attractors or codes has no wells."""
    if not hasattr(found.tree, "equilibria"):
        return dataset_of(found)
    attrs: dict[str, Any] = {"axes": tuple(found.axes), "t_end": found.t_end, "steps": found.steps}
    attrs |= told(found.system) | {f"fixed_{name}": value for name, value in found.fixed.items()}
    if isinstance(found.system, Mechanism):
        turning = [str(q.symbol) for q in found.system.coordinates if q.periodic]
        attrs |= {"turning_names": tuple(turning)} if turning else {}
    units = coordinate_units(found.system)
    groups = {"basins": Dataset(_basins(found, units)), "equilibria": Dataset(_wells(found, units))}
    attrs |= found.counts | failures(found.status, FAILURES)
    return Dataset(_variables(found, units), attrs, groups)


def _states(scene: Scene | Mechanism) -> tuple[str, ...]:
    """Names of coordinates, then of rates."""
    return STATE if isinstance(scene, Scene) else scene.state


def _kind(unit: str) -> str:
    return "angle" if unit == "rad" else "length"


def _variables(found: BasinMap, coordinates: Mapping[str, str]) -> dict[str, Variable]:
    """What is known of every start; ``coordinates`` are names with their units."""
    units, described = dict(coordinates), {name: f"{_kind(u)} {name}" for name, u in coordinates.items()}
    for name, unit in coordinates.items():
        units[f"{name}_dot"], described[f"{name}_dot"] = f"{unit}/s", f"rate of {name}"
    names = tuple(found.axes)
    variables = {
        name: Variable((name,), values, units[name], f"{described[name]} at the start")
        for name, values in found.axes.items()
    }
    variables |= {
        "label": Variable(names, found.labels[0].astype(np.int32), "1", "basin of the start", NO_CODE),
        "well": Variable(names, found.well, "1", "equilibrium that captures the start", NO_CODE),
        **{
            f"turns_{name}": Variable(names, found.turns[..., k], "1", f"full turns of {name} of that well")
            for k, name in enumerate(coordinates)
        },
        "capture_time": Variable(
            names, found.time, "s", "time of capture, NaN: not captured or not computed"
        ),
        "status": Variable(names, found.status, "1", "what is known of the start", flags(LABELS)),
        "computed": Variable(names, found.computed, "1", "computed, not filled in between equal labels"),
    }
    assert found.tree is not None  # a scene's map has one
    if isinstance(found.tree, BarrierTree):
        force = np.array(found.tree.equilibria.force)
        variables["force"] = Variable((), force, "N", "constant force that the wells hold for")
    if found.settle_time is not None:
        variables["settle_time"] = Variable(
            names,
            found.settle_time,
            "s",
            "time from which on the motion stays in the settling ball, NaN: none",
        )
    return variables


def _basins(found: BasinMap, coordinates: Mapping[str, str]) -> dict[str, Variable]:
    """Every well and turns that occur."""
    label, table = found.labels
    share = np.array([np.mean(label == i) for i in range(len(table))])
    unknown = np.mean(label < 0)
    return {
        **numbers("basin", len(table), "number of the basin"),
        "basin_well": Variable(("basin",), table[:, 0].astype(np.int8), "1", "equilibrium of the basin"),
        **{
            f"basin_turns_{name}": Variable(
                ("basin",), table[:, 1 + k].astype(np.int32), "1", f"its full turns of {name}"
            )
            for k, name in enumerate(coordinates)
        },
        "basin_share": Variable(("basin",), share, "1", "share of the starts"),
        "basin_share_at_most": Variable(
            ("basin",), share + unknown, "1", "share of the starts if all without a label ended there"
        ),
    }


def _wells(found: BasinMap, coordinates: Mapping[str, str]) -> dict[str, Variable]:
    """The scene's equilibria."""
    assert found.tree is not None
    equilibria, each = found.tree.equilibria, ("equilibrium",)
    index = np.array([e.morse_index for e in equilibria], dtype=np.int8)
    barrier = np.full(len(equilibria), np.nan)
    barrier[list(found.tree.wells)] = found.tree.barrier
    return {
        **numbers("equilibrium", len(equilibria), "number of the equilibrium"),
        **{
            f"equilibrium_{name}": Variable(
                each, equilibria.position[:, k], unit, f"{_kind(unit)} {name} of the equilibrium"
            )
            for k, (name, unit) in enumerate(coordinates.items())
        },
        "equilibrium_energy": Variable(each, equilibria.energy, "J", "potential energy of the equilibrium"),
        "equilibrium_morse_index": Variable(
            each,
            index,
            "1",
            "unstable directions, 0: a well",
        ),
        "barrier": Variable(each, barrier, "J", "energy at which the well first meets another, NaN: no well"),
    }
