"""Erosion profiles: stability, integrity and the smallest shock of every well along one parameter.

Layout: arrays over the parameter's values and ``well``, NaN where a well does not exist; ``sheet`` is the
well's identity in the atlas of these values. Integrity and shocks are lengths in the kinetic-energy norm at
the well; starts are uniform in the window that ``axes`` span, the other states being the well's own.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import AfterValidator, Field

from fastmech.basins.disturbed import MOST_RADIUS
from fastmech.basins.erosion import FLAGS, MEASURES, Ends, ErosionProfile, survey_of, wells_along
from fastmech.basins.label import How, label_states
from fastmech.capture.select import require_damper
from fastmech.disturbance.motion import require_constant_force
from fastmech.errors import InputError, shown
from fastmech.results import Dataset, Variable, coordinate_units, told
from fastmech.scan_types.map_layout import about_of
from fastmech.scan_types.request import (
    Axis,
    RunContext,
    Scan,
    Seed,
    Tiles,
    Tiling,
    arrays,
    axis_variables,
    check_duration,
    check_parameters,
    check_rising,
    check_size,
    check_starts,
)
from fastmech.scene import PARAMETERS, STATE, Scene, nearest

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Points of the largest map of a value.
MOST_POINTS = 1_000_000

_ABOUT = {
    "stability": ("1", "basin stability: share of random starts in the window that end in the well"),
    "stability_at_most": ("1", "basin stability if all random starts without a label ended there"),
    "lower": ("1", "lower end of its 95 % Wilson interval, none of those ending there"),
    "upper": ("1", "upper end of its 95 % Wilson interval, all of those ending there"),
    "gim": ("1", "global integrity measure: share of the window that ends there without a turn"),
    "gim_at_most": ("1", "global measure if all starts of the map without a label ended there"),
    "lim": ("rad", "local integrity measure: largest ball about the well in its basin on the map"),
    "lim_at_window": ("1", "the window's edge limits the local measure: it is larger"),
    "lim_at_most": ("rad", "local measure if all starts of the map without a label ended there"),
    "factor": ("rad", "integrity factor: largest ball in the basin on the map"),
    "factor_at_window": ("1", "the window's edge limits the integrity factor: it is larger"),
    "factor_at_most": ("rad", "integrity factor if all starts of the map without a label ended there"),
    "shock": ("rad", "smallest shock that makes it end elsewhere, NaN: none up to the largest"),
    "kick": ("rad", "smallest kick of the rates that does, NaN: none up to the largest"),
    "shock_undecided": ("rad", "smallest shock tried whose end is not known, NaN: none"),
    "kick_undecided": ("rad", "smallest kick tried whose end is not known, NaN: none"),
    "undecided": ("1", "share of the random starts whose end is not known"),
}


def _known_states(axes: dict[str, Axis]) -> dict[str, Axis]:
    for name, axis in axes.items():
        if name not in STATE:
            raise ValueError(f"unknown coordinate {shown(name)}; {nearest(name, list(STATE))}")
        if axis.values is not None or axis.spacing == "log" or axis.size < 2 or not axis.rises:
            raise ValueError(
                f"axis {shown(name)} must rise evenly (start, stop, num) and have at least 2 points"
            )
    return axes


class Erosion(Scan):
    """How much room each well has, along one parameter."""

    kind: ClassVar[str] = "erosion"

    along: Annotated[dict[str, Axis], Field(min_length=1, max_length=1)] = Field(
        description="the parameter and its values"
    )
    axes: Annotated[dict[str, Axis], Field(min_length=1, max_length=4), AfterValidator(_known_states)] = (
        Field(description="the window and the map in it")
    )
    most_shock: Annotated[float, Field(gt=0, le=MOST_RADIUS)] = Field(
        2.0, description="largest shock to look for [rad]"
    )
    t_end: Annotated[float, Field(gt=0)] = 60.0
    starts: Annotated[int, Field(ge=1, le=1_000_000)] = 2048
    directions: Annotated[int, Field(ge=1, le=100_000)] = 64
    seed: Seed = 0

    @property
    def parameter(self) -> str:
        """Name of the parameter."""
        return next(iter(self.along))

    @property
    def values(self) -> np.ndarray:
        """Its values."""
        return self.along[self.parameter].array

    def check(self, scene: Scene) -> None:
        """The scene needs a constant force and a damper, the parameter must rise to values it accepts."""
        require_constant_force(scene)
        require_damper(scene)
        name, axis = next(iter(self.along.items()))
        if name not in PARAMETERS or name == "alpha":
            allowed = [field for field in PARAMETERS if field != "alpha"]
            raise InputError(f"along.{name}: unknown parameter; {nearest(name, allowed)}")
        check_rising(f"along.{name}", axis)
        check_parameters(scene, self.along, "along")
        ends = [scene.replace(**{name: float(value)}) for value in self.values[[0, -1]]]
        check_size("axes", self.axes, "starts", MOST_POINTS, 1)
        for end in ends:
            require_damper(end)
            check_starts(end, {f"axes.{state}": line for state, line in arrays(self.axes).items()})
            check_duration(end, self.t_end, None)

    def tiling(self, scene: Scene) -> Tiling:
        """Every well at every value is a tile."""
        return ErosionTiling(self, scene)

    @staticmethod
    def draw(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
        """Stability, integrity and shocks of every well over the parameter."""
        from fastmech.plots.erosion import draw_erosion

        return draw_erosion(dataset, scene)


def profile_dataset(found: ErosionProfile) -> Dataset:
    """The section of a profile."""
    name, units = found.parameter, coordinate_units(found.system)
    about = {key: (unit, f"{about_of(unit)} {key} of the well") for key, unit in units.items()} | _ABOUT
    arrays = found.position | {key: getattr(found, key) for key in MEASURES}
    return Dataset(
        {
            **axis_variables(found.system, {name: found.values}),
            "sheet": Variable(
                ("well",), found.sheet.astype(np.int32), "1", "identity of the well in the atlas"
            ),
            **{
                f"well_{key}": Variable(
                    (name, "well"), data.astype(np.bool_) if key in FLAGS else data, *about[key]
                )
                for key, data in arrays.items()
            },
        },
        {**told(found.system), "along": name},
    )


class ErosionTiling(Tiling):
    """A tile a well and value: none needs another. The wells of a value follow each other."""

    what = "wells of the erosion profile"

    def __init__(self, request: Erosion, scene: Scene) -> None:
        self.request, self.scene, self.values = request, scene, request.values
        self.sheets, self.places = wells_along(scene, request.parameter, self.values)
        self.count = self.values.size * self.sheets.size
        self.window = arrays(request.axes)

    def items(self, index: int) -> int:
        """One well."""
        return 1

    def compute(self, index: int, context: RunContext) -> Dataset:
        """Measure one well at one value."""
        at, well = divmod(index, self.sheets.size)

        def ends(scene: Scene, starts: np.ndarray) -> Ends:
            context.check()
            return label_states(scene, starts, self.request.t_end, How(threads=context.threads))

        survey = survey_of(
            self.window,
            self.scene,
            most_shock=self.request.most_shock,
            t_end=self.request.t_end,
            label_starts=ends,
            n=self.request.starts,
            directions=self.request.directions,
            seed=self.request.seed,
        )
        scene = self.scene.replace(**{self.request.parameter: float(self.values[at])})
        found = survey.of_wells(scene, self.places[at, well][None])
        return Dataset({key: Variable((), array[0]) for key, array in found.items()})

    def assemble(self, tile: Tiles) -> Dataset:
        """Join the wells and values."""
        name = self.request.parameter
        tiles = [tile(index) for index in range(self.count)]
        shape = (self.values.size, -1)
        arrays = {key: np.array([part[key].data for part in tiles]).reshape(shape) for key in tiles[0]}
        position = {key: arrays.pop(key) for key in STATE[:2]}
        found = ErosionProfile(name, self.values, self.sheets, position, **arrays).of(self.scene)
        attrs: dict[str, Any] = {"axes": tuple(self.window), "t_end": self.request.t_end}
        attrs |= {"starts": self.request.starts, "most_shock": self.request.most_shock}
        for axis, line in self.window.items():
            attrs[f"window_{axis}"] = np.array([line[0], line[-1]])
        dataset = profile_dataset(found)
        return Dataset(dataset.variables, {**dataset.attrs, **attrs})

    def missing(self, index: int) -> Dataset:
        """A well that has not been measured."""
        keys = (*STATE[:2], *MEASURES)
        return Dataset({key: Variable((), np.array(False if key in FLAGS else np.nan)) for key in keys})
