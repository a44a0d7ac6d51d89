"""Disturbed ensembles in tiles: blocks of directions and blocks of trajectories, of every equilibrium.

A table of the section has a row for each trajectory of each equilibrium; what has other dimensions is in the
groups ``linear``, ``quantiles`` and ``halving``.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fastmech.basins.disturbed import (
    STREAM,
    DisturbedEnsemble,
    refuse_meeting_balls,
)
from fastmech.capture.select import certificate_of
from fastmech.disturbance.linear_range import linear_range
from fastmech.disturbance.motion import damped_times, equilibria_to_disturb
from fastmech.disturbance.size import size_of
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.spans import output_steps
from fastmech.ensembles.status import ENDS, FAILURES
from fastmech.integrators.methods import find_method
from fastmech.models.mechanism import Mechanism
from fastmech.results import NO_CODE, Dataset, Variable, flags, numbers, parts
from fastmech.scan_types.axis import coordinate_units, state_units, told
from fastmech.scan_types.map_layout import about_of, one_of
from fastmech.scan_types.request import HALVING, counted_failures
from fastmech.scan_types.tally import SHARES, Tally
from fastmech.scan_types.tiling import RunContext, Tiles, Tiling
from fastmech.scene import Scene
from fastmech.store.stream import Piece, Stream

if TYPE_CHECKING:
    from fastmech.scan_types.disturbed import Disturbed

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 1.0)
QUANTILE = Variable(("quantile",), np.array(QUANTILES), "1", "quantile")

ABOUT_SHARES = {
    "share_returned": "share that is proved to return",
    "share_returned_at_most": "share that returned, if all whose end is not known did",
    "share_returned_lower": "lower end of the 95 % Wilson interval, none of those returning",
    "share_returned_upper": "upper end of the 95 % Wilson interval, all of those returning",
}
ABOUT_QUANTILES = "quantiles of the time to return over those that return, inf: later than the end of the run"

_EACH, _EVERY = ("equilibrium",), ("equilibrium", "trajectory")

Units = Callable[[Scene | Mechanism], Mapping[str, str]]


def _turns(system: Scene | Mechanism) -> dict[str, str]:
    return dict.fromkeys(coordinate_units(system), "1")


#: What is known of every trajectory: type, what stands for one that is not computed yet, unit, meaning. What
#: has several units is a variable for each of them.
_TRAJECTORY: dict[str, tuple[str, float, str | Units, str]] = {
    "start": ("f8", np.nan, state_units, "{} at the start"),
    "final": ("f8", np.nan, state_units, "{} at the end, or of the last finite state"),
    "failed": ("f8", np.nan, "s", "time of the last finite state where it failed on the way"),
    "outcome": ("i1", -1, "1", "where it ends"),
    "end_equilibrium": ("i1", -1, "1", "stable equilibrium at which it is proved to end"),
    "turns": ("i8", 0, _turns, "full turns of {} made on the way there"),
    "time_to_return": (
        "f8",
        np.nan,
        "s",
        "end of the first step from which on every step ended in the ball of return, NaN: none by t_end",
    ),
    "excursion": (
        "f8",
        np.nan,
        coordinate_units,
        "largest departure of {} at the ends of steps, NaN: not followed to its end",
    ),
}

#: Names of what is known of every trajectory.
TRAJECTORY_VARIABLES = tuple(_TRAJECTORY)


def empty_trajectories(system: Scene | Mechanism, names: list[str], count: int) -> dict[str, NDArray[Any]]:
    """Arrays of so many trajectories that have not been computed."""
    found = {}
    for name in names:
        dtype, nothing, unit, _ = _TRAJECTORY[name]
        entries = () if isinstance(unit, str) else (len(unit(system)),)
        found[name] = np.full((count, *entries), nothing, dtype)
    return found


def trajectory_variables(
    system: Scene | Mechanism, arrays: Mapping[str, NDArray[Any]]
) -> dict[str, Variable]:
    """Arrays over (equilibrium, trajectory, ...) as variables."""
    codes: dict[str, Any] = {"outcome": flags(ENDS, fill=-1), "end_equilibrium": NO_CODE}
    found: dict[str, Variable] = {}
    for name, (_, _, unit, about) in _TRAJECTORY.items():
        if name not in arrays:
            continue
        if isinstance(unit, str):
            found[name] = Variable(_EVERY, arrays[name], unit, about, codes.get(name, {}))
        else:
            found |= parts(name, _EVERY, arrays[name], unit(system), about)
    return found


def share_variables(shares: Mapping[str, NDArray[np.float64]]) -> dict[str, Variable]:
    """The shares of a tally of each equilibrium."""
    return {name: Variable(_EACH, shares[name], "1", about) for name, about in ABOUT_SHARES.items()}


def quantile_variables(quantiles: NDArray[np.float64]) -> dict[str, Variable]:
    """Quantiles of the times to return to each equilibrium."""
    dims = ("equilibrium", "quantile")
    return {"quantile": QUANTILE, "time_to_return_quantile": Variable(dims, quantiles, "s", ABOUT_QUANTILES)}


def halving_variables(errors: NDArray[np.float64], units: Mapping[str, str]) -> dict[str, Variable]:
    """How far final states of some trajectories are from those of half the step."""
    unit = one_of(units.values())
    what = "angle" if unit == "rad" else "position"
    return parts(
        "halving_difference",
        ("equilibrium", "sample"),
        errors,
        {what: unit, "rate": f"{unit}/s" * (unit != "1") or "1"},
        "largest difference of a final {} from that with half the step, first trajectories; NaN: failed",
    )


def linear_variables(
    system: Scene | Mechanism, directions: NDArray[np.float64], limit: NDArray[np.float64]
) -> dict[str, Variable]:
    """How far the linearized motion can be trusted."""
    *_, unit = coordinate_units(system).values()
    return {
        **parts(
            "linear_direction",
            ("equilibrium", "direction"),
            directions,
            state_units(system),
            f"{{}} of a disturbance of size 1 {unit}",
        ),
        "linear_limit": Variable(
            ("equilibrium", "direction"),
            limit,
            unit,
            "size up to which the linearized motion keeps the tolerance, inf: beyond all tried, 0: below",
        ),
    }


Floats = NDArray[np.float64]

#: Trajectories of each ensemble that are integrated again with half the step.
SAMPLE = 256

#: Right-hand sides that a tile evaluates, about: a second of one thread.
EVALUATIONS = 1 << 27

#: Directions of a tile: 37 short motions each.
DIRECTIONS = 256

#: Bytes of what is joined before it is written.
PIECE_BYTES = 1 << 25


class DisturbedTiling(Tiling):
    """First blocks of directions for the linearized motion, then blocks of trajectories.

    Equilibria alternate, so that a partial result knows something of each.

    Args:
        request: how to compute and what to keep.
        scene: the mechanism.
    """

    what = "disturbed trajectories"

    def __init__(self, request: Disturbed, scene: Scene | Mechanism) -> None:
        self.request, self.scene = request, scene
        self.equilibria = equilibria_to_disturb(scene)
        refuse_meeting_balls(scene, self.equilibria, request.return_radius, range(len(self.equilibria)))
        certificate = certificate_of(scene)
        self.method = certificate.method(request.method)
        self.rays = _blocks(request.linear_directions, DIRECTIONS)
        places = self.equilibria.position
        rest = np.concatenate([places, np.zeros_like(places)], axis=1)
        step = request.dt or float(certificate.measuring_steps(rest, self.method).min())
        self.parts = _blocks(request.trajectories, self._tile_length(step))
        self.count = len(self.equilibria) * (len(self.rays) + len(self.parts))

    def items(self, index: int) -> int:
        """Trajectories; none for directions."""
        part = self._part(index)
        return 0 if part is None else part.stop - part.start

    def compute(self, index: int, context: RunContext) -> Dataset:
        """Try some directions, or follow some trajectories, of one equilibrium."""
        part, request = self._part(index), self.request
        equilibrium = self.equilibria[index % len(self.equilibria)]
        if part is None:
            found = linear_range(
                self.scene,
                equilibrium,
                horizon=request.linear_horizon,
                tolerance=request.linear_tolerance,
                directions=request.linear_directions,
                seed=request.seed,
                part=self.rays[index // len(self.equilibria)],
                threads=context.threads,
            )
            rays = {"directions": Variable(("ray", "component"), found.directions)}
            return Dataset(rays | {"limit": Variable(("ray",), found.limit)})
        ensemble = request.ensemble(self.scene, equilibrium, context, part)
        errors = _sampled_errors(self.scene, ensemble, self.method) if part.start == 0 else np.zeros((0, 2))
        arrays = {name: getattr(ensemble, _FIELDS.get(name, name)) for name in request.kept}
        tally = Tally.of(ensemble.outcome, ensemble.time_to_return)
        return self._tile(arrays, errors, tally, [ensemble.dt.min(), ensemble.dt.max()])

    def assemble(self, tile: Tiles) -> Stream:
        """Join the blocks and count."""
        each = list(self.equilibria)
        omega = np.array([size_of(self.scene, e).omega for e in each])
        fixed = numbers("equilibrium", len(each), "number of the equilibrium")
        for k, (name, unit) in enumerate(coordinate_units(self.scene).items()):
            about = f"{about_of(unit)} {name} of the disturbed equilibrium"
            fixed[name] = Variable(_EACH, self.equilibria.position[:, k], unit, about)
        fixed["omega"] = Variable(_EACH, omega, "rad/s", "frequency in the norm")
        fixed |= numbers("trajectory", self.request.trajectories, "number of the trajectory")
        count, request = len(each), self.request
        nothing = empty_trajectories(self.scene, request.kept, 1)
        arrays = {n: np.broadcast_to(a, (1, request.trajectories, *a.shape[1:])) for n, a in nothing.items()}
        plane = trajectory_variables(self.scene, arrays) | share_variables(dict.fromkeys(SHARES, np.zeros(1)))
        attrs = {
            **told(self.scene),
            **request.settings,
            "method": self.method,
            "distribution": "uniform in the ball of the given radius, kinetic-energy norm at the equilibrium",
        }
        return Stream(Dataset(fixed, attrs), plane, "equilibrium", lambda: self._pieces(tile, count))

    def missing(self, index: int) -> Dataset:
        """Trajectories and directions that have not been computed."""
        part = self._part(index)
        if part is None:
            block = self.rays[index // len(self.equilibria)]
            rays = block.stop - block.start
            arrays = {
                "directions": Variable(
                    ("ray", "component"), np.full((rays, 2 * self.equilibria.position.shape[1]), np.nan)
                )
            }
            return Dataset(arrays | {"limit": Variable(("ray",), np.full(rays, np.nan))})
        sample = min(SAMPLE, self.request.trajectories) if part.start == 0 else 0
        nothing = empty_trajectories(self.scene, self.request.kept, self.items(index))
        return self._tile(nothing, np.full((sample, 2), np.nan), Tally())

    def _tile_length(self, dt: float) -> int:
        """Trajectories of a tile, by their cost: a power of two, which divides a stream of random numbers."""
        steps = int(output_steps(np.array([0.0, self.request.t_end]), dt).sum())
        affordable = EVALUATIONS // find_method(self.method).evaluations(steps)
        return int(min(STREAM, max(SAMPLE, 1 << max(0, affordable.bit_length() - 1))))

    def _part(self, index: int) -> slice | None:
        """The trajectories of a tile; None for a tile of directions."""
        block = index // len(self.equilibria) - len(self.rays)
        return None if block < 0 else self.parts[block]

    def _tile(
        self, arrays: dict[str, NDArray[Any]], errors: Floats, tally: Tally, steps: list[float] | None = None
    ) -> Dataset:
        columns = {
            name: Variable(("trajectory", *(f"{name}_entry" for _ in a.shape[1:])), a)
            for name, a in arrays.items()
        }
        columns |= {
            "error": Variable(("sample", "error_entry"), errors),
            "step": Variable(("step_end",), np.array(steps or [])),
        }
        return Dataset(columns | tally.variables(), tally.attrs())

    def _pieces(self, tile: Tiles, count: int) -> Iterator[Piece]:
        limits = [[tile(number * count + e) for number in range(len(self.rays))] for e in range(count)]
        directions, limit = (
            np.stack([np.concatenate([f[name].data for f in found]) for found in limits])
            for name in ("directions", "limit")
        )
        first = count * len(self.rays)
        tallies, errors, steps = [Tally() for _ in range(count)], [], []
        held: list[dict[str, NDArray[Any]]] = []
        begun = 0
        for number, part in enumerate(self.parts):
            found = [tile(first + number * count + e) for e in range(count)]
            for e, one in enumerate(found):
                tallies[e].add(one)
                steps += one["step"].data.tolist()
            if number == 0:
                errors = [one["error"].data for one in found]
            held.append({n: np.stack([one[n].data for one in found]) for n in self.request.kept})
            if part is self.parts[-1] or sum(a.nbytes for h in held for a in h.values()) >= PIECE_BYTES:
                joined = {n: np.concatenate([h[n] for h in held], axis=1) for n in self.request.kept}
                yield (
                    (slice(0, count), slice(begun, part.stop)),
                    _data(trajectory_variables(self.scene, joined)),
                )
                begun, held = part.stop, []
        each = [t.shares() for t in tallies]
        shares = {name: np.array([share[name] for share in each]) for name in SHARES}
        quantiles = np.array([t.quantiles(QUANTILES) for t in tallies])
        each_one = numbers("equilibrium", count, "number of the equilibrium")
        groups = {
            "linear": Dataset(each_one | linear_variables(self.scene, directions, limit)),
            "quantiles": Dataset(each_one | quantile_variables(quantiles)),
            "halving": Dataset(each_one | halving_variables(np.stack(errors), coordinate_units(self.scene))),
        }
        attrs: dict[str, Any] = {
            "error_estimate": float(np.max(errors)),
            "error_estimate_median": float(np.median(errors)),
            "error_estimate_is": f"{HALVING}; final states of the first {len(errors[0])} of each",
        }
        attrs |= {"shortest_step": min(steps), "longest_step": max(steps)} if steps else {}
        ended = sum((t.ended for t in tallies), Counter[str]())
        failed = {k.name.lower(): ended[k.name.lower()] for k in FAILURES if ended[k.name.lower()]}
        yield slice(0, count), _data(share_variables(shares))
        yield Dataset({}, attrs | counted_failures(failed, ended.total()), groups)


#: Names of variables in `fastmech.basins.disturbed.DisturbedEnsemble`, where they are others.
_FIELDS = {"start": "starts", "end_equilibrium": "end_index"}


def _data(variables: dict[str, Variable]) -> dict[str, NDArray[Any]]:
    return {name: variable.data for name, variable in variables.items()}


def _blocks(total: int, length: int) -> list[slice]:
    return [slice(k, min(k + length, total)) for k in range(0, total, length)]


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
