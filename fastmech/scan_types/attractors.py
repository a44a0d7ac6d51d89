"""Attractors of a system or mechanism that keeps moving, and where starts of a grid or a sample end.

Layout: ``label`` and ``status`` of every start, over the grid's axes, or over ``start`` with the coordinates
of each. In groups of their own: ``attractors``, one row for each, the most frequent first, and ``points``,
some of each attractor's points.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from threading import Lock
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from fastmech import samplers
from fastmech.arrays import Floats
from fastmech.attractors.find import Attractor, Attractors, find_attractors
from fastmech.attractors.flow import keeps_moving
from fastmech.basins.map import grid_starts
from fastmech.basins.measures.fractions import wilson
from fastmech.ensembles.status import LABELS, Status, counts
from fastmech.ensembles.system import System
from fastmech.errors import InputError
from fastmech.models.mechanism import Mechanism
from fastmech.objects import state_units
from fastmech.plots.attractors import draw_attractors
from fastmech.results import NO_CODE, Dataset, Variable, columns, flags, numbers, parts, told
from fastmech.scan_types import request as scans
from fastmech.scene import Scene, nearest

#: Starts of a scan and of a tile at most; those that attractors are looked for from; points kept of each.
MOST_STARTS, TILE_STARTS, SEARCHED, POINTS = 20_000_000, 1 << 16, 4096, 1024

#: Samplers by name.
SAMPLERS = {
    "uniform": samplers.Uniform,
    "sobol": samplers.Sobol,
    "latin_hypercube": samplers.LatinHypercube,
    "gaussian": samplers.Gaussian,
    "ball": samplers.Ball,
}

Range = Annotated[list[float], Field(min_length=2, max_length=2)]


class Starts(scans.Scan):
    """What scans of attractors ask for: where motions begin, and how long they have."""

    of_mechanisms = of_systems = True

    ranges: dict[str, Range | float] = Field(
        default={}, description="starts: range or value of each state, 0 by default"
    )
    n: int = Field(10_000, ge=1, le=MOST_STARTS, description="how many starts")
    sampler: Literal["uniform", "sobol", "latin_hypercube", "gaussian", "ball"] = "uniform"
    seed: scans.Seed = 0
    t_end: float | None = Field(None, gt=0, description="how long a motion has to arrive [s]")

    def check(self, scene: Mechanism | System) -> None:  # type: ignore[override]
        """A mechanism must keep moving, names must be known."""
        if isinstance(scene, Scene) or not (isinstance(scene, System) or keeps_moving(scene)):
            raise InputError(
                "kind: is for systems and for mechanisms under loads that repeat; of other mechanisms take "
                'kind = "basins"'
            )
        self.drawn(scene, 1)

    def drawn(self, scene: Mechanism | System, n: int) -> Floats:
        """The first n starts (n, dim)."""
        return SAMPLERS[self.sampler](self.ranges).draw(n, tuple(scene.state), self.seed)


class Lines(Starts):
    """What scans along a parameter ask for: the same at each value of a second one."""

    each: dict[str, scans.Axis] = Field(
        default={}, max_length=1, description="a second parameter: the same at each of its values"
    )

    def over(self, scene: Mechanism | System, along: Mapping[str, scans.Axis]) -> dict[str, Variable]:
        """The second parameter and the first as coordinates, by which the section's dimensions are named.

        Raises:
            InputError: the second one is unknown, or the first.
        """
        for name in self.each:
            if name not in scene.parameters or name in along:
                others = [other for other in scene.parameters if other not in along]
                raise InputError(f"each.{name}: must be another parameter; {nearest(name, others)}")
        return scans.axis_variables(scene, scans.values_of({**self.each, **along}))

    def lines(
        self,
        scene: Mechanism | System,
        line: Callable[[Mechanism | System], Dataset],
        join: Callable[[list[Dataset]], Dataset],
    ) -> scans.Tiling:
        """A tile for each value of the second parameter, or one."""
        changes: list[dict[str, float]] = [{}]
        for name, axis in self.each.items():
            changes = [{name: float(value)} for value in axis.array]
        what = "values of the second parameter"
        return scans.Each(what, len(changes), lambda k: line(scene.replace(**changes[k])), join)


class AttractorScan(Starts):
    """Attractors, found without being told, and the label of every start."""

    kind: ClassVar[str] = "attractors"
    draw = staticmethod(draw_attractors)
    taken = frozenset({"label", "status", "time", "start", "attractor", "point"})

    axes: dict[str, scans.Axis] = Field(
        default={}, max_length=4, description="a grid of starts by states, in place of random ones"
    )
    fixed: dict[str, float] = Field(default={}, description="the other states on the grid, 0 by default")
    method: scans.MethodName = "dop853"

    @model_validator(mode="after")
    def _one_of_both(self) -> AttractorScan:
        if bool(self.axes) == bool(self.ranges):
            raise ValueError("give axes (a grid of starts) or ranges (random starts), one of them")
        return self

    def check(self, scene: Mechanism | System) -> None:  # type: ignore[override]
        """Names must be those of states."""
        super().check(scene)
        scans.check_names("axes.", self.axes, scene.state, "unknown state")
        scans.check_names("fixed.", self.fixed, scene.state, "unknown state")
        scans.check_rising("axes.", self.axes)
        scans.check_size("axes", self.axes, "starts", MOST_STARTS, 1)

    def tiling(self, scene: Mechanism | System) -> scans.Tiling:  # type: ignore[override]
        """So many starts a tile."""
        return AttractorTiling(self, scene)


class AttractorTiling(scans.Planes):
    """Every tile holds every so-manieth start; all look for attractors from the same few of all of them."""

    what = "starts to be labelled"
    nothing = {"label": np.int32(-1), "status": np.int8(Status.UNDECIDED), "time": np.nan}

    def __init__(self, request: AttractorScan, scene: Mechanism | System) -> None:
        self.request, self.scene, self.slice = request, scene, scans.values_of(request.axes)
        self.total = math.prod(map(len, self.slice.values())) if self.slice else request.n
        super().__init__({"start": np.arange(self.total)}, TILE_STARTS, spread=True)
        self._lock = Lock()
        self._found: Attractors | None = None

    def starts(self, which: NDArray[np.intp]) -> Floats:
        """Starts (n, dim) by their numbers."""
        if not self.slice:
            return self._drawn[which]
        names = tuple(self.scene.state)
        held = {name: self.request.fixed.get(name, 0.0) for name in names}
        return grid_starts(self.slice, held, names, which)

    @cached_property
    def _drawn(self) -> Floats:
        return self.request.drawn(self.scene, self.total)

    def found(self, threads: int | None = None) -> Attractors:
        """Attractors that some of the starts lead to, looked for once."""
        with self._lock:
            if self._found is None:
                few = np.unique(np.linspace(0, self.total - 1, SEARCHED).astype(np.intp))
                how = self.request.asked("t_end", "method")
                self._found = find_attractors(self.scene, self.starts(few), threads=threads, **how)
            return self._found

    def compute(self, index: int, context: scans.RunContext) -> Dataset:
        """Label some starts."""
        found = self.found(context.threads)
        starts = self.starts(self.axes_of(index)["start"])
        ends = found.label_starts(starts, progress=lambda finished: context.check())
        return scans.tile_of(
            {"label": ends.label.astype(np.int32), "status": ends.status, "time": ends.time},
            {"steps": ends.steps},
        )

    def section(self, arrays: dict[str, Any], tiles: list[Dataset]) -> Dataset:
        """Number the attractors by their shares."""
        label, status, time = arrays.values()
        found = self.found()
        share = np.bincount(label[label >= 0], minlength=len(found))
        order = np.argsort(-share, kind="stable")
        rank = np.append(np.argsort(order), -1).astype(np.int32)
        units, dims = state_units(self.scene), tuple(self.slice)
        where = {k: Variable((k,), v, units[k], f"state {k} at the start") for k, v in self.slice.items()}
        if not self.slice:
            dims, about = ("start",), "state {} at the start"
            where = parts("start", dims, self.starts(np.arange(self.total)), units, about)
        shape = tuple(map(len, self.slice.values())) or (self.total,)
        ends = [a.reshape(shape) for a in (rank[label], status, time)]
        known = [replace(found[k], found=int(share[k])) for k in order]
        attrs = {
            "axes": dims,
            "t_end": found.t_end,
            "method": self.request.method,
            "dt": found.dt,
            "looks": found.looks,
            "steps": sum(int(one.attrs["steps"]) for one in tiles),
            **told(self.scene),
            **({"cell": found.cell} if found.cell is not None else {}),
            **{f"fixed_{k}": v for k, v in self.request.fixed.items()},
            **counts(status, LABELS),
            **scans.failures(status),
        }
        return _section(self.scene, where, ends, known, attrs)


def attractor_dataset(found: Attractors) -> Dataset:
    """The section of attractors that starts led to."""
    attrs = {"axes": ("start",), "t_end": found.t_end, "dt": found.dt, "looks": found.looks}
    ends: list[NDArray[Any]] = [found.label.astype(np.int32), found.status, found.time]
    return _section(found.system, {}, ends, [*found.attractors], attrs | told(found.system))


def _section(
    system: Mechanism | System,
    where: dict[str, Variable],
    ends: Sequence[NDArray[Any]],
    found: Sequence[Attractor],
    attrs: Mapping[str, Any],
) -> Dataset:
    """Where starts end: label, status and time; with a row for each attractor and some of its points."""
    dims, units, total = attrs["axes"], state_units(system), ends[0].size
    rows = {
        "label": (ends[0], "1", "attractor at which it ends", NO_CODE),
        "status": (ends[1], "1", "what is known of the start", flags(LABELS)),
        "time": (ends[2], "s", "time of arrival, NaN: it has not arrived"),
    }
    own = numbers("start", total, "number of the start") if dims == ("start",) else {}
    groups = {"attractors": _table(found, total, units), "points": some_points(found, units)}
    return Dataset(own | where | columns(dims, rows), attrs, groups)


def _table(found: Sequence[Attractor], total: int, units: Mapping[str, str]) -> Dataset:
    """One row for each attractor, of ``total`` starts."""
    count = np.array([one.found for one in found], dtype=np.int64)
    low, high = wilson(count, total)
    forcing = np.array([one.forcing_periods or -1 for one in found], dtype=np.int32)
    kinds = np.array([one.kind for one in found], object)
    first = np.array([one.points[0] for one in found]).reshape(len(found), len(units))
    period, exponent, error, residual, radius = (
        np.array([getattr(one, name) for one in found], dtype=np.float64)
        for name in ("period", "exponent", "exponent_error", "residual", "radius")
    )
    about = "fixed point, periodic, torus, chaos, continuum, saddle cycle"
    rows = {
        "kind": (kinds, "1", about),
        "place": (first, units, "{} of one of its points"),
        "share": (count / total, "1", "share of the starts that end there"),
        "share_low": (low, "1", "lower end of its 95 % Wilson interval"),
        "share_high": (high, "1", "upper end of its 95 % Wilson interval"),
        "period": (period, "s", "period, NaN: it has none"),
        "forcing_periods": (forcing, "1", "its period in periods of the forcing", NO_CODE),
        "exponent": (exponent, "1/s", "largest Lyapunov exponent"),
        "exponent_error": (error, "1/s", "error of the exponent"),
        "residual": (residual, "1", "of the map over its period, over the typical state"),
        "radius": (radius, "1", "of the ball in which the map was measured to contract"),
    }
    number = numbers("attractor", len(found), "number of the attractor, by its share")
    return Dataset(number | columns(("attractor",), rows))


def some_points(found: Sequence[Attractor], units: Mapping[str, str]) -> Dataset:
    """Some points of each attractor."""
    some = [one.points[:: -(-len(one.points) // POINTS)] for one in found]
    owner = np.repeat(np.arange(len(some), dtype=np.int32), [len(points) for points in some])
    every = np.concatenate([np.empty((0, len(units))), *some])
    rows = {
        "point_attractor": (owner, "1", "attractor that it lies on"),
        "point": (every, units, "{} of the point"),
    }
    return Dataset(numbers("point", len(every), "number of the point") | columns(("point",), rows))
