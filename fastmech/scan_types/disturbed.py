"""Thousands of random disturbances of every equilibrium, and how far the linearized motion can be trusted.

Disturbed ensembles in tiles: blocks of directions and blocks of trajectories, of every equilibrium. A table
of the section has a row for each trajectory of each equilibrium; what has other dimensions is in the groups
``linear``, ``quantiles`` and ``halving``.

Disturbed ensembles of every equilibrium at every point of a grid of parameters, one tile an equilibrium.
Layout: arrays over the grid and ``sheet``, NaN where the sheet has no equilibrium; a sheet is one
equilibrium, continued, as the atlas of these axes numbers them (:mod:`fastmech.slider.atlas.sheets`). Each
ensemble is that of ``fm.disturb`` with the scene of its point. ``quantiles`` holds those of times to return.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field

from fastmech import results
from fastmech.arrays import Floats
from fastmech.basins.disturbed import (
    LONG,
    MOST_RADIUS,
    RADIUS,
    STREAM,
    DisturbedEnsemble,
    ball_of_return,
    disturb,
    usual_radius,
)
from fastmech.basins.label import default_end
from fastmech.basins.measures.fractions import wilson
from fastmech.capture.select import certificate_of, require_damper
from fastmech.disturbance.motion import (
    damped_times,
    equilibria_to_disturb,
    linear_range,
    require_constant_force,
    require_isolated,
    size_of,
)
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.lanes import output_steps
from fastmech.ensembles.status import ENDS, FAILURES, KNOWN_ENDS, failure_counts
from fastmech.errors import InputError, shown
from fastmech.integrators.methods import find_method
from fastmech.models.mechanism import Mechanism
from fastmech.objects import coordinate_units, state_units
from fastmech.plots.disturbed import draw_disturbed
from fastmech.results import Dataset, Variable, columns, numbers, told
from fastmech.scan_types import request as scans
from fastmech.scan_types.map_layout import one_of
from fastmech.scene import Scene, nearest
from fastmech.slider.atlas.map import map_equilibria
from fastmech.slider.capture.steps import method_for, shortest_step
from fastmech.slider.coefficients import reduce
from fastmech.slider.equilibria import Equilibrium, find_equilibria
from fastmech.step_limits.warning import step_warning
from fastmech.store.write import Piece, Stream

if TYPE_CHECKING:
    from fastmech.store.read import Section


@dataclass
class Tally:
    """How many trajectories end where, and when they were back: times are ends of steps, so few differ."""

    ended: Counter[str] = field(default_factory=Counter)  #: trajectories by the name of their outcome
    #: how often each time to return [s] occurs; who returns later than the end of the run is not counted
    times: Counter[float] = field(default_factory=Counter)

    @classmethod
    def of(cls, outcome: NDArray[np.int8], time_to_return: Floats) -> Tally:
        """The tally of a block; NaN stands for no return by the end of the run."""
        times, counts = np.unique(time_to_return[np.isfinite(time_to_return)], return_counts=True)
        returned = dict(zip(times.tolist(), counts.tolist(), strict=True))
        return cls(Counter(failure_counts(outcome, ENDS)), Counter(returned))

    def tile(self, arrays: Mapping[str, Any]) -> Dataset:
        """A tile of these arrays that keeps the tally too."""
        times = {"returned_time": [*self.times], "returned_count": np.array([*self.times.values()], np.int64)}
        return scans.tile_of({**arrays, **times}, self.ended)

    def add(self, tile: Dataset) -> None:
        """Count a tile's trajectories too."""
        times, counts = (tile[f"returned_{what}"].data.tolist() for what in ("time", "count"))
        self.ended.update({name: int(count) for name, count in tile.attrs.items()})
        self.times.update(dict(zip(times, counts, strict=True)))

    def shares(self) -> dict[str, float]:
        """Share that returned, if all not known did, and the 95 % Wilson interval of both; NaN of none."""
        n, returned = self.ended.total(), self.ended["returned"]
        if not n:
            return dict.fromkeys(SHARES, float("nan"))
        most = n - sum(self.ended[end.name.lower()] for end in KNOWN_ENDS) + returned
        lower, upper = wilson(returned, n)[0], wilson(most, n)[1]
        return dict(zip(SHARES, (returned / n, most / n, float(lower), float(upper)), strict=True))

    def quantiles(self) -> Floats:
        """Quantiles of the time to return [s], linear between neighbours; NaN where none returned.

        Infinite where they are among those that return later than the end of the run.
        """
        returned = self.ended["returned"]
        if not returned:
            return np.full(len(QUANTILES), np.nan)
        known = sorted(self.times.items())
        times = np.array([*(time for time, _ in known), np.inf])
        upto = np.cumsum([*(count for _, count in known), returned - self.times.total()])
        place = np.array(QUANTILES) * (returned - 1)
        low = np.floor(place)
        at_low, at_high = (times[np.searchsorted(upto, k, side="right")] for k in (low, np.ceil(place)))
        with np.errstate(invalid="ignore"):  # infinite less infinite is not used
            return np.where(at_low == at_high, at_low, at_low + (place - low) * (at_high - at_low))


#: Of what is proved, if all that is not known returned, and the interval of both.
SHARES = {
    "share_returned": "share that is proved to return",
    "share_returned_at_most": "share that returned, if all whose end is not known did",
    "share_returned_lower": "lower end of the 95 % Wilson interval, none of those returning",
    "share_returned_upper": "upper end of the 95 % Wilson interval, all of those returning",
}

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 1.0)
QUANTILE = Variable(("quantile",), np.array(QUANTILES), "1", "quantile")

ABOUT_QUANTILES = "quantiles of the time to return over those that return, inf: later than the end of the run"

_EACH, _EVERY = ("equilibrium",), ("equilibrium", "trajectory")

_RETURN = "end of the first step from which on every step ended in the ball of return, NaN: none by t_end"
_EXCURSION = "largest departure of {} at the ends of steps, NaN: not followed to its end"

#: What is known of every trajectory: what stands for one that is not computed yet, unit, meaning and
#: attributes if there are any. What has several units is a variable for each of them.
_TRAJECTORY: dict[str, tuple[Any, ...]] = {
    "start": (np.nan, state_units, "{} at the start"),
    "final": (np.nan, state_units, "{} at the end, or of the last finite state"),
    "failed": (np.nan, "s", "time of the last finite state where it failed on the way"),
    "outcome": (np.int8(-1), "1", "where it ends", results.flags(ENDS, fill=-1)),
    "end_equilibrium": (np.int8(-1), "1", "stable equilibrium at which it is proved to end", results.NO_CODE),
    "turns": (
        np.int64(0),
        lambda one: dict.fromkeys(coordinate_units(one), "1"),
        "full turns of {} made on the way there",
    ),
    "time_to_return": (np.nan, "s", _RETURN),
    "excursion": (np.nan, coordinate_units, _EXCURSION),
}

#: Names of what is known of every trajectory.
TRAJECTORY_VARIABLES = tuple(_TRAJECTORY)


def empty_trajectories(system: Scene | Mechanism, names: list[str], count: int) -> dict[str, NDArray[Any]]:
    """Arrays of so many trajectories that have not been computed."""
    found = {}
    for name in names:
        nothing, unit, *_ = _TRAJECTORY[name]
        entries = () if isinstance(unit, str) else (len(unit(system)),)
        found[name] = np.full((count, *entries), nothing)
    return found


def trajectory_variables(
    system: Scene | Mechanism, arrays: Mapping[str, NDArray[Any]]
) -> dict[str, Variable]:
    """Arrays over (equilibrium, trajectory, ...), in the order of the table, as variables."""
    rows = {}
    for name, array in arrays.items():
        _, unit, *about = _TRAJECTORY[name]
        rows[name] = (array, unit if isinstance(unit, str) else unit(system), *about)
    return columns(_EVERY, rows)


def _groups(
    system: Scene | Mechanism, quantiles: Floats, errors: Floats, directions: Floats, limit: Floats
) -> dict[str, dict[str, Variable]]:
    """What has other dimensions than trajectories: the linearized motion's range, times, halved steps."""
    coordinates = coordinate_units(system)
    *_, size = coordinates.values()
    ray, about = (*_EACH, "direction"), f"{{}} of a disturbance of size 1 {size}"
    beyond = (
        "size up to which the linearized motion keeps the tolerance, inf: above all tried sizes, 0: below"
    )
    unit = one_of(coordinates.values())
    units = {"angle" if unit == "rad" else "position": unit, "rate": f"{unit}/s" * (unit != "1") or "1"}
    halved = "largest difference of a final {} from that with half the step, first trajectories; NaN: failed"
    times = Variable((*_EACH, "quantile"), quantiles, "s", ABOUT_QUANTILES)
    linear = {
        "linear_direction": (directions, state_units(system), about),
        "linear_limit": (limit, size, beyond),
    }
    return {
        "linear": columns(ray, linear),
        "quantiles": {"quantile": QUANTILE, "time_to_return_quantile": times},
        "halving": results.parts("halving_difference", (*_EACH, "sample"), errors, units, halved),
    }


#: Trajectories of each ensemble that are integrated again with half the step.
SAMPLE = 256

#: Right-hand sides that a tile evaluates, about: a second of one thread.
EVALUATIONS = 1 << 27

#: Directions of a tile: 37 short motions each.
DIRECTIONS = 256


class DisturbedTiling(scans.Tiling):
    """First blocks of directions for the linearized motion, then blocks of trajectories.

    Equilibria alternate, so that a partial result knows something of each.
    """

    what = "directions and trajectories"

    def __init__(self, request: DisturbedScan, scene: Scene | Mechanism) -> None:
        self.scene, self.equilibria = scene, equilibria_to_disturb(scene)
        given, each = request.return_radius, range(len(self.equilibria))
        self.radii = [ball_of_return(scene, self.equilibria, k, given) for k in each]
        self.sizes = [request.radius or usual_radius(scene, e) for e in self.equilibria]
        certificate = certificate_of(scene)
        t_end = default_end(certificate, LONG) if request.t_end is None else request.t_end
        if isinstance(scene, Mechanism) and request.dt is not None:
            scans.check_steps("t_end", t_end, request.dt)
        self.request = request.model_copy(update={"t_end": t_end})  # settings tell the time that is used
        self.method = certificate.method(request.method)
        places = self.equilibria.position
        rest = np.concatenate([places, np.zeros_like(places)], axis=1)
        step = request.dt or float(certificate.measuring_steps(rest, self.method).min())
        steps = int(output_steps(np.array([0.0, t_end]), step).sum())
        affordable = EVALUATIONS // find_method(self.method).evaluations(steps)
        # A power of two, which divides a stream of random numbers.
        length = int(min(STREAM, max(SAMPLE, 1 << max(0, affordable.bit_length() - 1))))
        self.rays = scans.blocks(request.linear_directions, DIRECTIONS)
        self.parts = scans.blocks(request.trajectories, length)
        self.count = len(self.equilibria) * len([*self.rays, *self.parts])

    def block(self, index: int) -> tuple[bool, slice]:
        """Whether a tile is one of directions, and which directions or trajectories are its own."""
        block = index // len(self.equilibria)
        return block < len(self.rays), [*self.rays, *self.parts][block]

    def items(self, index: int) -> int:
        """Directions or trajectories."""
        _, part = self.block(index)
        return part.stop - part.start

    def compute(self, index: int, context: scans.RunContext) -> Dataset:
        """Try some directions, or follow some trajectories, of one equilibrium."""
        (aimed, part), request = self.block(index), self.request
        equilibrium = self.equilibria[index % len(self.equilibria)]
        if aimed:
            found = linear_range(
                self.scene,
                equilibrium,
                horizon=request.linear_horizon,
                tolerance=request.linear_tolerance,
                directions=request.linear_directions,
                seed=request.seed,
                part=part,
                threads=context.threads,
            )
            return scans.tile_of({"directions": found.directions, "limit": found.limit})
        ensemble = request.ensemble(self.scene, equilibrium, context, part)
        errors = _sampled_errors(self.scene, ensemble, self.method) if part.start == 0 else np.zeros((0, 2))
        arrays = {name: getattr(ensemble, _FIELDS.get(name, name)) for name in request.kept}
        arrays |= {"error": errors, "step": [ensemble.dt.min(), ensemble.dt.max()]}
        return Tally.of(ensemble.outcome, ensemble.time_to_return).tile(arrays)

    def assemble(self, tile: scans.Tiles) -> Stream:
        """Join the blocks and count."""
        each, request = list(self.equilibria), self.request
        omega = np.array([size_of(self.scene, e).omega for e in each])
        units = coordinate_units(self.scene)
        rows = {
            "": (self.equilibria.position, units, "{1} {0} of the disturbed equilibrium"),
            "omega": (omega, "rad/s", "frequency in the norm"),
            "disturbance_radius": (
                np.array(self.sizes),
                [*units.values()][-1],
                "size of the largest disturbance",
            ),
            "return_radius": (np.array(self.radii), [*units.values()][-1], "radius of the ball of return"),
        }
        fixed = {
            **numbers("equilibrium", len(each), "number of the equilibrium"),
            **columns(_EACH, rows),
            **numbers("trajectory", request.trajectories, "number of the trajectory"),
        }
        nothing = empty_trajectories(self.scene, request.kept, 1)
        arrays = {n: np.broadcast_to(a, (1, request.trajectories, *a.shape[1:])) for n, a in nothing.items()}
        plane = trajectory_variables(self.scene, arrays) | _shares([Tally()])
        attrs = {
            **told(self.scene),
            **request.settings,
            "radius": max(self.sizes),
            "method": self.method,
            "distribution": "uniform in the ball of the given radius, kinetic-energy norm at the equilibrium",
        }
        return Stream(Dataset(fixed, attrs), plane, "equilibrium", lambda: self._pieces(tile, len(each)))

    def missing(self, index: int) -> Dataset:
        """Trajectories and directions that have not been computed."""
        aimed, part = self.block(index)
        if aimed:
            nothing = np.full((part.stop - part.start, 2 * self.equilibria.position.shape[1]), np.nan)
            return scans.tile_of({"directions": nothing, "limit": nothing[:, 0]})
        sample = min(SAMPLE, self.request.trajectories) if part.start == 0 else 0
        arrays = empty_trajectories(self.scene, self.request.kept, self.items(index))
        return Tally().tile(arrays | {"error": np.full((sample, 2), np.nan), "step": np.zeros(0)})

    def _pieces(self, tile: scans.Tiles, count: int) -> Iterator[Piece]:
        limits = [[tile(number * count + e) for number in range(len(self.rays))] for e in range(count)]
        directions, limit = (
            np.stack([np.concatenate([f[name].data for f in found]) for found in limits])
            for name in ("directions", "limit")
        )
        first = count * len(self.rays)
        tallies, errors, steps = [Tally() for _ in range(count)], [], []
        for number, part in enumerate(self.parts):
            found = [tile(first + number * count + e) for e in range(count)]
            for tally, one in zip(tallies, found, strict=True):
                tally.add(one)
                steps += one["step"].data.tolist()
            if number == 0:
                errors = [one["error"].data for one in found]
            arrays = {name: np.stack([one[name].data for one in found]) for name in self.request.kept}
            yield (slice(0, count), part), _data(trajectory_variables(self.scene, arrays))
        yield slice(0, count), _data(_shares(tallies))
        quantiles = np.array([t.quantiles() for t in tallies])
        made = _groups(self.scene, quantiles, np.stack(errors), directions, limit)
        each_one = numbers("equilibrium", count, "number of the equilibrium")
        attrs: dict[str, Any] = {
            "error_estimate": float(np.max(errors)),
            "error_estimate_median": float(np.median(errors)),
            "error_estimate_is": f"{scans.HALVING}; final states of the first {len(errors[0])} of each",
        }
        attrs |= {"shortest_step": min(steps), "longest_step": max(steps)} if steps else {}
        attrs |= _failures([t.ended for t in tallies], sum(t.ended.total() for t in tallies))
        yield Dataset({}, attrs, {name: Dataset(each_one | group) for name, group in made.items()})


#: Names of variables in `fastmech.basins.disturbed.DisturbedEnsemble`, where they are others.
_FIELDS = {"start": "starts", "end_equilibrium": "end_index"}


def _data(variables: dict[str, Variable]) -> dict[str, NDArray[Any]]:
    return {name: variable.data for name, variable in variables.items()}


def _shares(tallies: Sequence[Tally]) -> dict[str, Variable]:
    """The shares of each equilibrium."""
    each = [tally.shares() for tally in tallies]
    rows = {name: (np.array([one[name] for one in each]), "1", about) for name, about in SHARES.items()}
    return columns(_EACH, rows)


def _failures(ended: Iterable[Mapping[str, Any]], total: int) -> dict[str, int | str]:
    """What a section says of those that failed, by the counts of its ensembles."""
    each, names = list(ended), [failure.name.lower() for failure in FAILURES]
    counts = {name: sum(int(one.get(name, 0)) for one in each) for name in names}
    return scans.counted_failures({name: count for name, count in counts.items() if count}, total)


def _sampled_errors(scene: Scene | Mechanism, e: DisturbedEnsemble, method: str) -> Floats:
    """Largest differences of first final coordinates and rates from those of half the step (sample, 2)."""
    final, dt = e.final[:SAMPLE], e.dt[:SAMPLE]
    finer = np.empty_like(final)
    for step in np.unique(dt):
        some = np.flatnonzero(dt == step)
        half = 0.5 * float(step)
        times = np.append(damped_times(scene, method, min(half, e.t_end)), e.t_end)
        finer[some] = integrate(scene, e.starts[some], dt=half, method=method, t_eval=times).y[-1]
    difference = np.abs(finer - final).reshape(len(final), 2, -1).max(axis=2)
    return np.where(np.isnan(e.failed[:SAMPLE])[:, None], difference, np.nan)


#: Points of the largest map, and trajectories of each equilibrium there at most: a tile takes seconds.
MOST_POINTS, MOST_TRAJECTORIES = 100_000, 65_536

#: What is measured of an equilibrium on a map: dimensions, unit and meaning.
_MEASURED: dict[str, tuple[tuple[str, ...], str, str]] = {
    **{name: ((), "1", about) for name, about in SHARES.items()},
    "time_to_return_quantile": (("quantile",), "s", ABOUT_QUANTILES),
    "largest_excursion_phi": ((), "rad", "largest departure of phi of all trajectories"),
    "largest_excursion_theta": ((), "rad", "largest departure of theta of all trajectories"),
    "share_failed": ((), "1", "share whose motion could not be computed"),
    "return_radius": ((), "rad", "radius of the ball of return"),
    "t_end": ((), "s", "end of the runs"),
}


class DisturbedMap(scans.Planes):
    """A tile is one equilibrium at one point; those of a point follow each other."""

    what = "disturbed trajectories"
    nothing = {
        name: np.full(len(QUANTILES), np.nan) if dims else np.nan for name, (dims, *_) in _MEASURED.items()
    }

    def __init__(self, request: DisturbedScan, scene: Scene) -> None:
        self.request, self.scene, self.grid_axes = request, scene, scans.values_of(request.axes)
        self.atlas = map_equilibria(scene, self.grid_axes)
        self.entries = np.argwhere(self.atlas.sheet >= 0)
        super().__init__({"entry": np.arange(len(self.entries))}, 1)

    def items(self, index: int) -> int:
        """Trajectories."""
        return self.request.trajectories

    def compute(self, index: int, context: scans.RunContext) -> Dataset:
        """Disturb one equilibrium; where its scene is refused, all that is kept is the reason."""
        scene, equilibrium = self._place(index)
        try:
            found = self.request.ensemble(scene, equilibrium, context)
        except InputError as refused:
            return scans.tile_of(self._empty((1,)), {"refused": str(refused)})
        tally, failed = Tally.of(found.outcome, found.time_to_return), np.isin(found.outcome, FAILURES)
        farthest = np.full(2, np.nan) if failed.all() else found.excursion[~failed].max(axis=0)
        measured = (
            *tally.shares().values(),
            tally.quantiles(),
            *farthest,
            failed.mean(),
            found.return_radius,
            found.t_end,
        )
        named = zip(_MEASURED, measured, strict=True)
        return scans.tile_of({n: np.array([value]) for n, value in named}, failure_counts(found.outcome))

    def section(self, arrays: dict[str, Any], tiles: list[Dataset]) -> Dataset:
        """Put every equilibrium in its sheet's place."""
        atlas, names = self.atlas, tuple(self.grid_axes)
        grid = (*atlas.sheet.shape[:-1], atlas.sheet_morse_index.size)
        slot = tuple(self.entries.T)
        place = (*slot[:-1], atlas.sheet[slot])

        def over_map(values: Any, dims: tuple[str, ...], unit: str, about: str) -> Variable:
            array = np.full((*grid, *values.shape[1:]), np.nan)
            array[place] = values
            return Variable((*names, "sheet", *dims), array, unit, about)

        about = "equilibrium, continued, as the atlas of these axes numbers them"
        variables = scans.axis_variables(self.scene, self.grid_axes) | numbers("sheet", grid[-1], about)
        quantiles = {**variables, "quantile": QUANTILE}
        about = "negative eigenvalues of the Hessian all over a sheet, 0: stable"
        variables["sheet_morse_index"] = Variable(("sheet",), atlas.sheet_morse_index, "1", about)
        for angle in coordinate_units(self.scene):
            about = f"angle {angle} of the disturbed equilibrium"
            variables[angle] = over_map(getattr(atlas, angle)[slot], (), "rad", about)
        for name, row in _MEASURED.items():
            (quantiles if row[0] else variables)[name] = over_map(arrays[name], *row)
        refused = [str(one.attrs["refused"]) for one in tiles if "refused" in one.attrs]
        attrs = {
            **self.request.settings,
            "radius": self.request.radius or RADIUS,
            "axes": names,
            "refused": len(refused),
        }
        attrs |= {"refused_first": refused[0]} if refused else {}
        followed = self.request.trajectories * (len(tiles) - len(refused))
        attrs |= _failures([one.attrs for one in tiles], followed)
        return Dataset(variables, attrs, {"quantiles": Dataset(quantiles)})

    def _place(self, index: int) -> tuple[Scene, Equilibrium]:
        """The scene of a tile's point, and which of its equilibria is the tile's."""
        *at, _ = entry = tuple(self.entries[index])
        values = {name: float(line[k]) for (name, line), k in zip(self.grid_axes.items(), at, strict=True)}
        scene = self.scene.replace(**values)
        equilibria = find_equilibria(scene)
        away = equilibria.position - [self.atlas.phi[entry], self.atlas.theta[entry]]
        return scene, equilibria[int(np.hypot(*np.sin(0.5 * away).T).argmin())]


#: Right-hand sides of the largest ensemble: a year of a hundred cores.
MOST_WORK = 1e17

#: Numbers of 8 bytes that memory holds of every point of a map.
POINT_NUMBERS = 250

#: Trajectories of each equilibrium that are drawn at most: they are random, so some stand for all.
DRAWN = 1 << 20


def _known_variables(names: list[str]) -> list[str]:
    for name in names:
        if name not in TRAJECTORY_VARIABLES:
            raise ValueError(f"unknown variable {shown(name)}; {nearest(name, list(TRAJECTORY_VARIABLES))}")
    return names


#: Fields of what a map over parameters does not hold.
_NOT_OF_A_MAP = ("variables", "linear_horizon", "linear_tolerance", "linear_directions")


class DisturbedScan(scans.Scan):
    """Ensembles about every equilibrium, uniform in a ball of the kinetic-energy norm."""

    kind: ClassVar[str] = "disturbed"
    draw = staticmethod(draw_disturbed)
    of_mechanisms = True
    taken = frozenset(
        {
            "equilibrium",
            "trajectory",
            "omega",
            "disturbance_radius",
            "return_radius",
            *TRAJECTORY_VARIABLES,
            *SHARES,
        }
    )

    axes: dict[str, scans.Axis] = Field(
        default={}, description="parameters over which all equilibria are disturbed; none: the scene's alone"
    )

    trajectories: int = Field(4096, ge=1, le=100_000_000)
    radius: float | None = Field(
        None,
        gt=0,
        le=MOST_RADIUS,
        description="largest size of a disturbance [rad or m]; by default 0.5 or less",
    )
    return_radius: float | None = Field(
        None, gt=0, description="radius of the ball of return [rad or m]; at most half way to an equilibrium"
    )
    seed: scans.Seed = 0
    t_end: float | None = Field(
        None, gt=0, description="end of the runs [s]; by default as fm.disturb, 120 or longer or shorter"
    )
    dt: float | None = Field(
        None, gt=0, description="longest step [s]; by default each start's own, from the scene and its energy"
    )
    method: scans.UsualMethod = None
    linear_horizon: float = Field(1.0, gt=0, description="horizon of the comparison [s]")
    linear_tolerance: float = Field(0.05, gt=0, description="deviation allowed, relative")
    linear_directions: int = Field(256, ge=1, le=1_000_000)
    variables: Annotated[list[str], AfterValidator(_known_variables)] | None = Field(
        None,
        description="what to keep of every trajectory (all by default); large scans are smaller with less",
    )

    def check(self, scene: Scene | Mechanism) -> None:
        """A constant force and a damper all over a map, and no more work than is possible."""
        scans.check_axes(scene, self.axes)
        if isinstance(scene, Mechanism):
            if self.axes:
                raise InputError(
                    f"axes = {shown(list(self.axes))}: this kind has axes for the paper's mechanism alone; "
                    'of others give a value in [scene] and no axes, or take kind = "erosion": shares and '
                    "shocks of every well along a parameter"
                )
            require_damper(scene)
            require_isolated(scene)
            return
        scans.check_parameters(scene, self.axes, "axes")
        t_end = self.t_end or LONG
        for corner in self._corners(scene):
            require_damper(corner)
            (require_constant_force if self.axes else require_isolated)(corner)
            scans.check_duration(corner, t_end, self.dt)
            scans.check_steps("linear_horizon", self.linear_horizon, shortest_step(reduce(corner)))
        if not self.axes:
            steps = math.ceil(t_end / (self.dt or shortest_step(reduce(scene))))
            work = self.trajectories * find_method(method_for(scene, self.method)).evaluations(steps)
            if work > MOST_WORK:
                raise InputError(
                    f"trajectories, t_end, dt: ask for {work:.3g} right-hand sides about every equilibrium, "
                    f"at most {MOST_WORK:.0e} are possible"
                )
            return
        for name in _NOT_OF_A_MAP:
            if name in self.model_fields_set:
                raise InputError(f"{name}: is nothing of a map; leave it out, or the axes")
        scans.check_size("axes", self.axes, "points", MOST_POINTS, POINT_NUMBERS)
        if self.trajectories > MOST_TRAJECTORIES:
            raise InputError(
                f"trajectories = {self.trajectories}: must be at most {MOST_TRAJECTORIES} on a map"
            )

    def step_warning(self, scene: Scene | Mechanism) -> str | None:
        """By the scene's limit; without ``dt`` each start's step is chosen."""
        if self.dt is None or isinstance(scene, Mechanism):
            return None
        each = self._corners(scene)
        told = (step_warning(corner, self.dt, method_for(corner, self.method)) for corner in each)
        return next(filter(None, told), None)

    def _corners(self, scene: Scene) -> list[Scene]:
        """The scene with the first and last values of all axes; itself where there are none."""
        ends = [axis.array[[0, -1]].tolist() for axis in self.axes.values()]
        return [scene.replace(**dict(zip(self.axes, values, strict=True))) for values in product(*ends)]

    def tiling(self, scene: Scene | Mechanism) -> scans.Tiling:
        """Blocks of directions and of trajectories; of a map the equilibria one by one."""
        if self.axes:
            assert isinstance(scene, Scene)
            return DisturbedMap(self, scene)
        return DisturbedTiling(self, scene)

    def ensemble(
        self, scene: Scene | Mechanism, equilibrium: Any, context: scans.RunContext, part: slice = slice(None)
    ) -> DisturbedEnsemble:
        """Disturb one equilibrium, be it unstable, or a part of its trajectories."""
        return disturb(
            scene,
            equilibrium,
            self.trajectories,
            dt=self.dt,
            **self.asked("radius", "return_radius", "seed", "t_end", "method"),
            part=part,
            **context.working,
        )

    @property
    def kept(self) -> list[str]:
        """Names of what is kept of every trajectory."""
        wanted = TRAJECTORY_VARIABLES if self.variables is None else self.variables
        return [name for name in TRAJECTORY_VARIABLES if name in wanted]

    @property
    def settings(self) -> dict[str, Any]:
        """What a section says of its request."""
        left_out = {"scene", "axes", *(_NOT_OF_A_MAP if self.axes else ["variables"])}
        settings = self.model_dump(exclude=left_out, exclude_none=True)
        return settings | {"seed": self.seed if self.seed < 2**64 else str(self.seed)}  # no integer of HDF5's

    @staticmethod
    def read(section: Section, scene: Mapping[str, float]) -> Dataset:
        """What is drawn, of very many trajectories evenly spaced ones."""
        if "axes" in section.attrs:
            return section.load()
        step = -(-section.sizes.get("trajectory", 1) // DRAWN)
        drawn = [name for name in section if not name.startswith(("start", "final", "linear_direction"))]
        found = section.load(drawn, {"trajectory": slice(None, None, step)})
        return replace(found, groups={name: group.load() for name, group in section.groups.items()})
