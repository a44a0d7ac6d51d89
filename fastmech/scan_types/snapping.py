"""Dynamic snapping: which suddenly applied, fading force throws the mechanism out of its force-free well.

Layout: ends over ``alpha`` and ``F0``; the smallest force that leaves for each alpha; and the critical
impulse, the limit of F0/alpha as alpha grows. In groups of their own ``windows``, the runs of neighbouring
forces that end alike, with the alpha they belong to, and ``equilibria``, those of the force-free scene.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from fastmech.basins.shock_limit import shock_limit
from fastmech.basins.snapping import (
    CLOSE,
    SnappingMap,
    critical_forces,
    default_end,
    force_free,
    map_snapping,
)
from fastmech.capture.select import require_damper
from fastmech.ensembles.status import LABELS, Status
from fastmech.errors import InputError
from fastmech.objects import ANGLE_UNITS
from fastmech.plots.basins import draw_snapping
from fastmech.results import NO_CODE, Dataset, Variable, columns, flags
from fastmech.scan_types import request as scans
from fastmech.scan_types.map_layout import equilibria_table
from fastmech.scene import Scene
from fastmech.slider.capture.steps import method_for

#: Motions of the largest map, and numbers of 8 bytes of each in memory.
MOST_POINTS, POINT_NUMBERS = 5_000_000, 20

#: Least tolerance of a critical force over the force: doubles between two such forces.
ROUNDING = 2.0**-44

#: Motions of a tile, about.
TILE_POINTS = 1 << 12


#: What a tile knows of every motion, by the names in `fastmech.basins.snapping.SnappingMap`, and what stands
#: for a motion that is not computed yet.
_ENDS: dict[str, Any] = {
    "label": -1,
    "turns": np.zeros(2, dtype=np.int64),
    "time": np.nan,
    "status": np.int8(Status.UNDECIDED),
}


class DecayRates(scans.Axis):
    """Values evenly spaced in their logarithm, unless it is said otherwise."""

    spacing: Literal["linear", "log"] = "log"


class Snapping(scans.Scan):
    """The (F0, alpha) map of dynamic snapping, with the critical curve and its limit."""

    kind: ClassVar[str] = "snapping"
    draw = staticmethod(draw_snapping)

    F0: scans.Axis = Field(description="forces, of one sign [N]")
    alpha: DecayRates = Field(description="decay rates, evenly spaced in their logarithm [1/s]")
    tolerance: float | None = Field(
        None,
        gt=0,
        description="of the critical forces [N]; by default a ten-thousandth of the least that leaves",
    )
    t_end: float | None = Field(
        None, gt=0, description="end of the runs [s]; by default 200 s after a millionth of the force is left"
    )
    method: scans.UsualMethod = None

    def check(self, scene: Scene) -> None:
        """Forces of one sign, rising axes, a damper."""
        require_damper(scene)
        axes = {"F0": self.F0, "alpha": self.alpha}
        scans.check_rising("", axes)
        first, last = (float(force) for force in self.F0.array[[0, -1]])
        if first * last <= 0.0:
            raise InputError(f"F0: goes from {first:g} to {last:g} N: must be of one sign and not be 0 N")
        slowest = float(self.alpha.array[0])
        if slowest <= 0.0:
            raise InputError(f"alpha: begins at {slowest:g} 1/s: must be greater than 0 1/s")
        least = ROUNDING * max(abs(first), abs(last))
        if self.tolerance is not None and self.tolerance < least:
            raise InputError(
                f"tolerance = {self.tolerance:g}: must not be less than {least:.2g} N, for rounding"
            )
        scans.check_parameters(scene, axes, "axes")
        scans.check_size("F0, alpha", axes, "motions", MOST_POINTS, POINT_NUMBERS)
        end = float(default_end(slowest)) if self.t_end is None else self.t_end
        for force in (first, last):
            scans.check_duration(scene.replace(F0=force, alpha=slowest), end, None)

    def tiling(self, scene: Scene) -> scans.Tiling:
        """Some decay rates a tile."""
        return SnappingTiling(self, scene)


class SnappingTiling(scans.Planes):
    """Every tile holds some decay rates with all their forces."""

    what = "motions under a fading force"
    nothing = {**_ENDS, "critical": np.nan}
    of_planes = ("critical",)

    def __init__(self, request: Snapping, scene: Scene) -> None:
        self.request, self.scene = request, scene
        super().__init__({"alpha": request.alpha.array, "F0": request.F0.array}, TILE_POINTS, spread=True)

    def compute(self, index: int, context: scans.RunContext) -> Dataset:
        """Ends and critical forces of some rates."""
        settings = self.request.asked("t_end", "method") | {"threads": context.threads}
        progress = context.stage(self.what, self.items(index)) if self.count == 1 else None
        part = self.axes_of(index)
        found = map_snapping(self.scene, part["F0"], part["alpha"], progress=progress, **settings)
        critical = critical_forces(found, self.scene, tolerance=self.request.tolerance, **settings)
        return scans.tile_of({**{name: getattr(found, name) for name in _ENDS}, "critical": critical})

    def section(self, arrays: dict[str, Any], tiles: list[Dataset]) -> Dataset:
        """Find the limit too, to which no tile belongs."""
        critical, forces = arrays.pop("critical"), self.axes["F0"]
        free, equilibria, start = force_free(self.scene, None)
        found = SnappingMap(forces, self.axes["alpha"], equilibria, start, **arrays).of(self.scene)
        side = 0.0 if forces[0] > 0.0 else np.pi
        limit = np.cos(side) * shock_limit(free, equilibria[start], "M2", side).found.impulse
        dataset = snapping_dataset(found)
        about = "force of least magnitude that leaves, NaN: none of those tried"
        more = {"critical_F0": Variable(("alpha",), critical, "N", about)}
        about = "limit of the critical F0/alpha for fast decay, NaN: none was found"
        more["critical_impulse"] = Variable((), np.array(limit), "N s", about)
        asked = self.request.tolerance
        attrs: dict[str, Any] = {"relative_tolerance": CLOSE} if asked is None else {"tolerance": asked}
        attrs |= {"method": method_for(free, self.request.method)}
        return Dataset({**dataset.variables, **more}, {**dataset.attrs, **attrs}, dataset.groups)


_TURNS = {"phi": "1", "theta": "1"}


def snapping_dataset(found: SnappingMap) -> Dataset:
    """The section of a map, without critical forces."""
    label, turns = found.label.astype(np.int8), found.turns.astype(np.int32)
    grid, time = ("alpha", "F0"), "time at which its capture was found, NaN: not captured"
    ends = {
        "well": (label, "1", "equilibrium that captures the motion", NO_CODE),
        "turns": (turns, _TURNS, "full turns of {}"),
        "left": (found.left, "1", "ends in another well or with another number of turns"),
        "capture_time": (found.time, "s", time),
        "status": (found.status, "1", "what is known of the motion", flags(LABELS)),
    }
    variables = {
        "F0": Variable(("F0",), found.F0, "N", "force on M2 along +x when it is switched on"),
        "alpha": Variable(("alpha",), found.alpha, "1/s", "rate at which the force decays"),
        **columns(grid, ends),
    }
    groups = {
        "windows": Dataset(_windows(found)),
        "equilibria": Dataset(equilibria_table(found.equilibria, ANGLE_UNITS, "force-free ")),
    }
    attrs = {"start": found.start, **found.counts, **scans.failures(found.status)}
    return Dataset(variables, attrs, groups)


def _windows(found: SnappingMap) -> dict[str, Variable]:
    every = [(rate, *window) for k, rate in enumerate(found.alpha) for window in found.windows(k)]
    rate, first, last, label, turns, left = zip(*every, strict=True)
    rows = {
        "window_alpha": (np.array(rate), "1/s", "alpha of the window"),
        "window_first": (np.array(first), "N", "least F0 of the window"),
        "window_last": (np.array(last), "N", "largest F0 of the window"),
        "window_well": (np.array(label, dtype=np.int8), "1", "where its motions end", NO_CODE),
        "window_turns": (np.array(turns, dtype=np.int32), _TURNS, "turns of {} they make"),
        "window_left": (np.array(left), "1", "whether they have left"),
    }
    return columns(("window",), rows)
