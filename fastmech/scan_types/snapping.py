"""Dynamic snapping: which suddenly applied, fading force throws the mechanism out of its force-free well.

Layout: ends over ``alpha`` and ``F0``; the smallest force that leaves for each alpha; and the critical
impulse, the limit of F0/alpha as alpha grows. In groups of their own ``windows``, the runs of neighbouring
forces that end alike, with the alpha they belong to, and ``equilibria``, those of the force-free scene.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
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
from fastmech.ensembles.status import FAILURES, LABELS, Status
from fastmech.errors import InputError
from fastmech.plots.basins import draw_snapping
from fastmech.results import (
    ANGLE_UNITS,
    NO_CODE,
    Dataset,
    Variable,
    columns,
    columns_of,
    flags,
    numbers,
    parts,
)
from fastmech.scan_types import request as scans
from fastmech.scene import Scene
from fastmech.slider.capture.steps import method_for

#: Motions of the largest map, and numbers of 8 bytes of each in memory.
MOST_POINTS, POINT_NUMBERS = 5_000_000, 20

#: Least tolerance of a critical force over the force: doubles between two such forces.
ROUNDING = 2.0**-44

#: What a tile knows of every motion, by the names in `fastmech.basins.snapping.SnappingMap`.
_ENDS = ("label", "turns", "time", "status")

#: Motions of a tile, about.
TILE_POINTS = 1 << 12


class DecayRates(scans.Axis):
    """Values evenly spaced in their logarithm, unless it is said otherwise."""

    spacing: Literal["linear", "log"] = "log"


class Snapping(scans.Scan):
    """The (F0, alpha) map of dynamic snapping, with the critical curve and its limit."""

    kind: ClassVar[str] = "snapping"
    draw = staticmethod(draw_snapping)

    F0: scans.Axis = Field(description="forces, of one sign [N]")
    alpha: DecayRates = Field(description="decay rates, evenly spaced in their logarithm [1/s]")
    tolerance: Annotated[float, Field(gt=0)] | None = Field(
        None, description="of the critical forces [N]; by default a ten-thousandth of the least that leaves"
    )
    t_end: Annotated[float, Field(gt=0)] | None = Field(
        None, description="end of the runs [s]; by default 200 s after a millionth of the force is left"
    )
    method: scans.UsualMethod = None

    @property
    def forces(self) -> np.ndarray:
        """Values of F0 [N]."""
        return self.F0.array

    @property
    def rates(self) -> np.ndarray:
        """Values of alpha [1/s]."""
        return self.alpha.array

    def check(self, scene: Scene) -> None:
        """Forces of one sign, rising axes, a damper."""
        require_damper(scene)
        for name, axis in (("F0", self.F0), ("alpha", self.alpha)):
            scans.check_rising(name, axis)
        first, last = (float(force) for force in self.forces[[0, -1]])
        if first * last <= 0.0:
            raise InputError(f"F0: goes from {first:g} to {last:g} N: must be of one sign and not be 0 N")
        slowest = float(self.rates[0])
        if slowest <= 0.0:
            raise InputError(f"alpha: begins at {slowest:g} 1/s: must be greater than 0 1/s")
        least = ROUNDING * float(np.abs(self.forces).max())
        if self.tolerance is not None and self.tolerance < least:
            raise InputError(
                f"tolerance = {self.tolerance:g}: must not be less than {least:.2g} N, for rounding"
            )
        axes = {"F0": self.F0, "alpha": self.alpha}
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

    def __init__(self, request: Snapping, scene: Scene) -> None:
        self.request, self.scene = request, scene
        self.forces, self.rates = request.forces, request.rates
        super().__init__({"alpha": self.rates, "F0": self.forces}, TILE_POINTS, spread=True)

    def compute(self, index: int, context: scans.RunContext) -> Dataset:
        """Ends and critical forces of some rates."""
        settings = self.request.asked("t_end", "method")
        found = map_snapping(
            self.scene,
            self.forces,
            self.rates[self.parts[index]],
            threads=context.threads,
            progress=context.stage(self.what, self.items(index)) if self.count == 1 else None,
            **settings,
        )
        critical = critical_forces(
            found, self.scene, tolerance=self.request.tolerance, threads=context.threads, **settings
        )
        return scans.tile_of({name: getattr(found, name) for name in _ENDS} | {"critical": critical})

    def assemble(self, tile: scans.Tiles) -> Dataset:
        """Join the rates, in their order."""
        tiles = [tile(index) for index in range(self.count)]
        joined = {name: self.joined(tiles, name) for name in tiles[0]}
        free, equilibria, start = force_free(self.scene, None)
        found = SnappingMap(self.forces, self.rates, equilibria, start, *(joined[name] for name in _ENDS)).of(
            self.scene
        )
        side = 0.0 if self.forces[0] > 0.0 else np.pi
        limit = np.cos(side) * shock_limit(free, equilibria[start], "M2", side).found.impulse
        dataset = snapping_dataset(found)
        variables = dict(dataset.variables)
        about = "force of least magnitude that leaves, NaN: none of those tried"
        variables["critical_F0"] = Variable(("alpha",), joined["critical"], "N", about)
        about = "limit of the critical F0/alpha for fast decay, NaN: none was found"
        variables["critical_impulse"] = Variable((), np.array(limit), "N s", about)
        asked = self.request.tolerance
        attrs = {"relative_tolerance": CLOSE} if asked is None else {"tolerance": asked}
        method = method_for(free, self.request.method)
        return Dataset(variables, {**dataset.attrs, **attrs, "method": method}, dataset.groups)

    def missing(self, index: int) -> Dataset:
        """Rates that have not been computed."""
        shape = self.grid(index)
        nothing, undecided = np.full(shape, np.nan), np.full(shape, Status.UNDECIDED, dtype=np.int8)
        ends = np.full(shape, -1), np.zeros((*shape, 2), dtype=np.int64), nothing, undecided
        return scans.tile_of(dict(zip(_ENDS, ends, strict=True)) | {"critical": nothing[:, 0]})


def snapping_dataset(found: SnappingMap) -> Dataset:
    """The section of a map, without critical forces."""
    groups = {"windows": Dataset(_windows(found)), "equilibria": Dataset(_equilibria(found))}
    attrs = {"start": found.start, **found.counts, **scans.failures(found.status, FAILURES)}
    return Dataset(_ends(found), attrs, groups)


_TURNS = {"phi": "1", "theta": "1"}


def _ends(found: SnappingMap) -> dict[str, Variable]:
    label, turns = found.label.astype(np.int8), found.turns.astype(np.int32)
    grid, time = ("alpha", "F0"), "time at which its capture was found, NaN: not captured"
    return {
        "F0": Variable(("F0",), found.F0, "N", "force on M2 along +x when it is switched on"),
        "alpha": Variable(("alpha",), found.alpha, "1/s", "rate at which the force decays"),
        "well": Variable(grid, label, "1", "equilibrium that captures the motion", NO_CODE),
        **parts("turns", grid, turns, _TURNS, "full turns of {}"),
        "left": Variable(grid, found.left, "1", "ends in another well or with another number of turns"),
        "capture_time": Variable(grid, found.time, "s", time),
        "status": Variable(grid, found.status, "1", "what is known of the motion", flags(LABELS)),
    }


def _windows(found: SnappingMap) -> dict[str, Variable]:
    rates = [rate for k, rate in enumerate(found.alpha) for _ in found.windows(k)]
    windows, each = [window for k in range(found.alpha.size) for window in found.windows(k)], ("window",)

    def column(name: str, kind: type) -> NDArray[Any]:
        return np.array([getattr(window, name) for window in windows], dtype=kind)

    rows = {
        "window_alpha": (np.array(rates, dtype=np.float64), "1/s", "alpha of the window"),
        "window_first": (column("first", np.float64), "N", "least F0 of the window"),
        "window_last": (column("last", np.float64), "N", "largest F0 of the window"),
        "window_well": (column("label", np.int8), "1", "where its motions end", NO_CODE),
    }
    turns = column("turns", np.int32).reshape(-1, 2)
    left = Variable(each, column("left", np.bool_), "1", "whether they have left")
    return {
        **columns(each, rows),
        **parts("window_turns", each, turns, _TURNS, "turns of {} they make"),
        "window_left": left,
    }


def _equilibria(found: SnappingMap) -> dict[str, Variable]:
    equilibria, each = found.equilibria, ("equilibrium",)
    angles, about = (
        np.stack([equilibria.phi, equilibria.theta], axis=-1),
        "{1} {0} of the force-free equilibrium",
    )
    rows = {
        "energy": ("J", "its potential energy"),
        "morse_index": ("1", "its unstable directions, 0: a well"),
    }
    return {
        **numbers("equilibrium", len(equilibria), "number of the force-free equilibrium"),
        **parts("equilibrium", each, angles, ANGLE_UNITS, about),
        **columns_of(equilibria, each, rows, "equilibrium_{}"),
    }
