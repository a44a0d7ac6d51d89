"""Erosion profiles: stability, integrity and the smallest shock of every well along one parameter.

Layout: arrays over the parameter's values and ``well``, NaN where a well does not exist; ``sheet`` is the
well's identity in the atlas of these values. Integrity and shocks are lengths in the kinetic-energy norm at
the well; starts are uniform in the window that ``axes`` span, the other states being the well's own.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import AfterValidator, Field

from fastmech.basins.disturbed import MOST_RADIUS
from fastmech.basins.erosion import FLAGS, MEASURES, PLACE, ErosionProfile, Survey, wells_along
from fastmech.basins.label import LONG, How, Labels, label_states
from fastmech.capture.select import require_damper
from fastmech.disturbance.motion import require_constant_force
from fastmech.errors import shown
from fastmech.models.mechanism import Mechanism
from fastmech.objects import coordinate_units, state_units
from fastmech.plots.erosion import draw_erosion
from fastmech.results import Dataset, Variable, columns, rows_of, told
from fastmech.scan_types import request as scans
from fastmech.scene import Scene

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


def _even(axes: dict[str, scans.Axis]) -> dict[str, scans.Axis]:
    for name, axis in axes.items():
        if axis.values is not None or axis.spacing == "log" or axis.size < 2 or not axis.rises:
            raise ValueError(
                f"axis {shown(name)} must rise evenly (start, stop, num) and have at least 2 points"
            )
    return axes


class Erosion(scans.Scan):
    """How much room each well has, along one parameter."""

    kind: ClassVar[str] = "erosion"
    draw = staticmethod(draw_erosion)
    of_mechanisms = True
    taken = frozenset({"sheet", "well"})

    along: dict[str, scans.Axis] = Field(
        min_length=1, max_length=1, description="the parameter and its values"
    )
    axes: Annotated[dict[str, scans.Axis], Field(min_length=1), AfterValidator(_even)] = Field(
        description="the window and the map in it"
    )
    most_shock: float = Field(2.0, gt=0, le=MOST_RADIUS, description="largest shock to look for [rad]")
    t_end: float | None = Field(
        None, gt=0, description="end of the runs [s]; by default as fm.erosion, 60 or longer or shorter"
    )
    starts: int = Field(2048, ge=1, le=1_000_000)
    directions: int = Field(64, ge=1, le=100_000)
    seed: scans.Seed = 0

    def check(self, scene: Scene | Mechanism) -> None:
        """The scene needs a constant force and a damper, the parameter must rise to values it accepts."""
        require_constant_force(scene)
        require_damper(scene)
        own = isinstance(scene, Mechanism)
        known = [name for name in scene.described() if own or name != "alpha"]
        scans.check_names("along.", self.along, known, "unknown parameter")
        scans.check_names("axes.", self.axes, state_units(scene), "unknown coordinate")
        scans.check_rising("along.", self.along)
        scans.check_parameters(scene, self.along, "along")
        scans.check_size("axes", self.axes, "starts", MOST_POINTS, 1)
        ((name, axis),) = self.along.items()
        for value in axis.array[[0, -1]]:
            end = scene.replace(**{name: float(value)})
            require_constant_force(end)
            require_damper(end)
            if isinstance(end, Scene):
                scans.check_starts("axes.", end, scans.values_of(self.axes))
                scans.check_duration(end, self.t_end or LONG, None)

    def tiling(self, scene: Scene | Mechanism) -> scans.Tiling:
        """Every well at every value is a tile."""
        return ErosionTiling(self, scene)


def profile_dataset(found: ErosionProfile) -> Dataset:
    """The section of a profile."""
    name, units = found.parameter, coordinate_units(found.system)
    size = [*units.values()][-1]  # the norm has the unit of the last coordinate
    described = {key: (size if unit == "rad" else unit, text) for key, (unit, text) in _ABOUT.items()}
    places = np.stack([found.position[key] for key in units], axis=-1)
    about = "identity of the well in the atlas"
    rows = {"position": (places, units, "{1} {0} of the well"), **rows_of(found, described, "well_{}")}
    variables = {
        **scans.axis_variables(found.system, {name: found.values}),
        "sheet": Variable(("well",), found.sheet.astype(np.int32), "1", about),
        **columns((name, "well"), rows),
    }
    return Dataset(variables, {**told(found.system), "along": name})


class ErosionTiling(scans.Planes):
    """A tile a well and value: none needs another. The wells of a value follow each other."""

    what = "wells of the erosion profile"

    def __init__(self, request: Erosion, scene: Scene | Mechanism) -> None:
        self.request, self.scene = request, scene
        ((self.parameter, axis),) = request.along.items()
        self.values, self.window = axis.array, scans.values_of(request.axes)
        self.sheets, self.places = wells_along(scene, self.parameter, self.values)
        super().__init__({"well": np.arange(self.values.size * self.sheets.size)}, 1)
        measured = (*(PLACE + key for key in coordinate_units(scene)), *MEASURES)
        self.nothing = {key: False if key in FLAGS else np.nan for key in measured}

    def compute(self, index: int, context: scans.RunContext) -> Dataset:
        """Measure one well at one value."""
        at, well = divmod(index, self.sheets.size)

        def ends(scene: Scene | Mechanism, starts: np.ndarray) -> Labels:
            context.check()
            return label_states(scene, starts, self.request.t_end, How(threads=context.threads))

        survey = Survey(
            self.window,
            self.scene,
            label_starts=ends,
            n=self.request.starts,
            **self.request.asked("most_shock", "t_end", "directions", "seed"),
        )
        scene = self.scene.replace(**{self.parameter: float(self.values[at])})
        return scans.tile_of(survey.of_wells(scene, self.places[at, well][None]))

    def section(self, arrays: dict[str, Any], tiles: list[Dataset]) -> Dataset:
        """Tell values and wells apart."""
        every = {key: array.reshape(self.values.size, -1) for key, array in arrays.items()}
        position = {key: every.pop(PLACE + key) for key in coordinate_units(self.scene)}
        found = ErosionProfile(self.parameter, self.values, self.sheets, position, **every).of(self.scene)
        attrs = {"axes": tuple(self.window), **self.request.asked("starts", "most_shock")}
        attrs |= {} if self.request.t_end is None else {"t_end": self.request.t_end}
        attrs |= {f"window_{axis}": line[[0, -1]] for axis, line in self.window.items()}
        dataset = profile_dataset(found)
        return Dataset(dataset.variables, {**dataset.attrs, **attrs})
