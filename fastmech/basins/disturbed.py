"""``fm.disturb``: what becomes of thousands of random disturbances of one equilibrium.

Where a disturbance ends is what :func:`fastmech.label_starts` proves. How long it takes and how far
it swings is measured in a run of its own to the end.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats, Integers
from fastmech.basins.label import How, default_end, label_states
from fastmech.basins.measures.fractions import Shares, basin_stability
from fastmech.capture.certificate import MOST_OCTAVES, TURNING
from fastmech.capture.select import certificate_of, require_damper
from fastmech.disturbance.motion import (
    EXCURSION,
    LAST_OUTSIDE,
    SWUNG,
    Size,
    confining_energy,
    equilibria_to_disturb,
    excess_energy,
    observe_departure,
    size_of,
    uniform_ball,
)
from fastmech.ensembles import checks
from fastmech.ensembles.lanes import output_steps
from fastmech.ensembles.run import Ensemble, Observation, Progress, run_ensemble
from fastmech.ensembles.status import ENDS, FAILURES, KNOWN_ENDS, Status, failure_counts, failure_line
from fastmech.errors import InputError, StepWarning
from fastmech.models.equilibria import RestingPlace
from fastmech.models.mechanism import Mechanism, short_way
from fastmech.models.stability import classify, linear_of
from fastmech.objects import Drawn, Field, counted
from fastmech.samplers import Starts
from fastmech.scene import Scene
from fastmech.slider.equilibria import Equilibrium

#: By how much excursions by two steps may differ, over the larger coordinate's.
AGREED = 0.01

#: They are compared until so many times the time of the largest one.
BEYOND = 2.0

#: End of runs by default [s].
LONG = 120.0

#: Size of the largest disturbance by default, where no range is near; that part of a length's range is near.
RADIUS, LEAST_ROOM = 0.5, 0.01

#: Radius of the ball of return by default, over that size, where other equilibria are far.
RETURN_PART = 0.02

#: Starts that one stream of random numbers gives; the next ones have a stream of their own.
STREAM = 65_536

#: Trajectories of the largest ensemble: its results take about 150 bytes each in memory.
MOST_TRAJECTORIES = 100_000_000

#: Largest disturbance [rad]: times the frequency it is as fast as the shortest steps by default can follow.
MOST_RADIUS = TURNING * 2.0**MOST_OCTAVES


@dataclass(frozen=True, repr=False)
class DisturbedEnsemble(Drawn):
    """Random disturbances of one equilibrium and what became of them; arrays over n trajectories.

    Printed, it says how many return, how soon, and how far they swing.
    """

    equilibria: Any  #: all equilibria of the scene
    names: dict[str, str]  #: of the coordinates, with their units
    index: int  #: which of them was disturbed
    size: Size  #: the norm in which radius and ball are measured
    return_radius: float  #: of the ball of return, in that norm
    t_end: float  #: s
    enough: float  #: about how long a run would see all back that return [s]; not finite: not known
    dt: Floats  #: steps taken [s], shape (n,)
    starts: Floats  #: states at t = 0, shape (n, states)
    final: Floats  #: states at t_end, of those that failed the last finite ones, shape (n, states)
    failed: Floats  #: time of the last finite state of those that failed on the way [s], else NaN; shape (n,)
    outcome: NDArray[np.int8]  #: :class:`fastmech.ensembles.status.Status`, one of its ``ENDS``, shape (n,)
    end_index: NDArray[np.int8]  #: the stable equilibrium at which it is proved to end, -1: none; shape (n,)
    turns: Integers  #: full turns of each coordinate on the way there, 0 where none; (n, coords)
    time_to_return: Floats  #: s, first step from which on it was in the ball; NaN: not by t_end; (n,)
    excursion: Floats
    """Largest departures of coordinates [rad or m], at and between steps; NaN of those that failed or, by
    these steps, end elsewhere; by default compared with half the step, save of the undecided; (n, coords)."""

    @property
    def failures(self) -> str:
        """One line: how many trajectories have failed, and how; empty where none has."""
        return failure_line(failure_counts(self.outcome), self.outcome.size)

    @property
    def returned(self) -> Shares:
        """Share that returned, with its 95 % Wilson interval: the basin stability in the ball.

        Whose end is not known, be it undecided or failed, is without a label.
        """
        known = np.isin(self.outcome, KNOWN_ENDS)
        return basin_stability(np.where(known, self.outcome, -1), int(Status.RETURNED))

    KIND = "disturbances"
    PICTURE = "plots.objects:draw_disturbances"
    TOLD = ("heading", "return_radius")
    FIELDS = {
        "start_*": Field("trajectory state", "", "state at the start:", "starts"),
        "final_*": Field("trajectory state", "", "state at the end:", "final"),
        "outcome": Field("trajectory", "1", "how it ended", codes=Status),
        "end_index": Field("trajectory", "1", "stable equilibrium at which it ends, -1: none", codes=-1),
        "time_to_return": Field("trajectory", "s", "from then on in the ball, NaN: not by the end"),
        "excursion_*": Field("trajectory coordinate", "", "largest departure of", "excursion"),
        "dt": Field("trajectory", "s", "step"),
        "t_end": Field("", "s", "end of the runs"),
        "share_returned": Field("", "1", "share that is proved to return"),
    }

    def told(self) -> str:
        """How many return, how soon, and how far they swing."""
        kind, shares = self.equilibria[self.index].kind, self.returned
        ended = {name: f"{count:,} {name}" for name, count in failure_counts(self.outcome, ENDS).items()}
        if turned := int(
            np.count_nonzero((self.outcome == Status.ELSEWHERE) & (self.end_index == self.index))
        ):
            ended["elsewhere"] += f" ({turned:,} of them at this {kind}, full turns away)"
        if "out_of_range" in ended and (beyond := np.count_nonzero(self.system.outside(self.starts))):
            ended["out_of_range"] += f" ({beyond:,} of them from the start)"
        lines = [
            f"{self._sizes} of the {kind} at {self.equilibria.place(self.index)}, "
            f"followed for {self.t_end:.4g} s",
            "  ended: " + ", ".join(ended.values()),
            f"  returned: {shares.fraction:.2%}, at most {shares.at_most:.2%} "
            f"(95 % interval {shares.lower:.2%} to {shares.upper:.2%}){self._told_energy}",
        ]
        if home := int(np.count_nonzero(self.outcome == Status.RETURNED)):
            lines.append(f"  {self._told_times(home)}")
        if np.isfinite(self.excursion).any():
            most = zip(np.nanmax(self.excursion, axis=0), self.names.items(), strict=True)
            each = ", ".join(f"{value:.3g} {unit} of {name}" for value, (name, unit) in most)
            lines.append(f"  largest excursion: {each}")
        return "\n".join([*lines, *([f"  {self.failures}"] if self.failures else [])])

    def _told_times(self, home: int) -> str:
        """How long those that return, so many, take until they are near the place for good."""
        known = self.time_to_return[np.isfinite(self.time_to_return)]
        median = return_quantile(self, 0.5)
        told = f"within {self.return_radius:.3g} {self.unit} for good by {self.t_end:.4g} s: "
        told += f"{known.size:,} of these {home:,}"
        if median < np.inf:
            told += f", after {median:.3g} s (median)"
        if known.size == home:
            told += f", at most {known.max():.3g} s"
        else:
            told += f", {home - known.size:,} only later"
            if self.system is not None:
                decay = classify(self.system, self.equilibria[self.index]).decay_time
                told += f": small swings fall to 1/e in {decay:.4g} s"
                told += f", t_end = {self.enough:.3g} s should do" * bool(self.t_end < self.enough < np.inf)
        return told

    @property
    def unit(self) -> str:
        """Unit of sizes: the last coordinate's."""
        return [*self.names.values()][-1]

    @property
    def heading(self) -> str:
        """What was disturbed, and how much, for titles."""
        kind = f"the {self.equilibria.kind[self.index]} at {self.equilibria.place(self.index)}"
        return f"{self._sizes} in the norm of the kinetic energy, of {kind}"

    @property
    def _far(self) -> float:
        """The size of the largest disturbance."""
        center = self.equilibria.position[self.index]
        return float(self.size(self.starts - np.append(center, np.zeros_like(center))).max(initial=0.0))

    @property
    def _sizes(self) -> str:
        """How many disturbances, and the size of the largest."""
        return f"{counted(self.outcome.size, 'disturbance')} of up to {self._far:.2g} {self.unit}"

    @property
    def _told_energy(self) -> str:
        """The energy of the largest beside the well's barrier, where both are known."""
        told = self.system and told_energy(self.system, self.equilibria[self.index], self._far)
        return f"; given up to {told}" if told else ""

    @property
    def share_returned(self) -> float:
        """Share of the trajectories that are proved to return."""
        return float(self.returned.fraction)

    @property
    def share_returned_at_most(self) -> float:
        """The same if all whose end is not known returned."""
        return float(self.returned.at_most)


def disturb(
    scene: Scene | Mechanism,
    equilibrium: Equilibrium | RestingPlace,
    n: int = 4096,
    *,
    disturbances: Starts | None = None,
    radius: float | None = None,
    seed: int = 0,
    t_end: float | None = None,
    dt: float | None = None,
    method: str | None = None,
    return_radius: float | None = None,
    part: slice | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> DisturbedEnsemble:
    """Disturb an equilibrium at random and follow every disturbance.

    Starts are uniform in the ball of the given ``radius`` about the equilibrium, in the norm of
    :func:`fastmech.kinetic_norm`; the k-th 65,536 of them (k = 0, 1, ...) are drawn by NumPy's
    ``default_rng([seed, index, 0, k])``, so any part of an ensemble can be had without the rest. Where they
    end is proved by capture, see :func:`fastmech.label_starts`; a trajectory that has returned may need
    longer than ``t_end`` to come to rest. One that ends in the same place full turns away is ``elsewhere``,
    as is one in another well. A motion is back when it is within ``return_radius``, in the equilibrium's
    norm, without the energy to leave that ball.

    Args:
        scene: a scene or a mechanism with dampers and constant loads.
        equilibrium: one of ``find_equilibria(scene)``; of one that is no minimum one is warned.
        n: number of disturbances.
        disturbances: departures of the state from the equilibrium, a sampler or shape (n, states), in place
            of those that are uniform in the ball; a sampler's number and seed are its own.
        radius: size of the largest disturbance, in the last coordinate's unit [rad or m]; of more than four
            turns one is warned. By default 0.5; where a coordinate is a length at most the largest size at
            which no disturbance begins beyond the range of a coordinate, see :func:`usual_radius`.
        seed: seed of the starts.
        t_end: end of the run [s], by default 120, or longer or shorter as for :func:`fastmech.label_starts`.
        dt: longest step [s]; by default each start's own, from the scene's frequencies, its damping and the
            start's energy, see ``Certificate.measuring_steps``. Motions that fail with it, come to another
            well than is proved, or by default swing more than 1 % otherwise with half of it, are followed
            again with a 16th of it, and so on, down to the shortest step of the fastest starts, by default.
            What is measured of one that remains so is NaN.
        method: name of the method; by default ``dop853``, or ``radau5`` (implicit) where the damper would
            set the explicit method's steps.
        return_radius: radius of the ball of return, in the same unit, at most half the distance to the next
            equilibrium; by default that half or 2 % of the default ``radius``, 0.01 rad of angles, whichever
            is less.
        part: which of the n disturbances to follow, with a step of 1; all by default. Who asks for a part is
            not warned.
        threads: threads to use; the result does not depend on it.
        progress: called with the number of trajectories that have finished since the last call.

    Raises:
        InputError: an argument is wrong, the scene's force decays, it has no damper, or its wells are not
            certain.
    """
    checks.progress_function(progress, "trajectories")
    equilibria = equilibria_to_disturb(scene)
    require_damper(scene)
    certificate = certificate_of(scene)
    n = checks.whole_number("n", n, least=1, most=MOST_TRAJECTORIES)
    seed = checks.whole_number("seed", seed, least=0)
    away = None
    if disturbances is not None:
        away = checks.starts("disturbances", disturbances, scene.state, default=n)
        n = len(away)
    unit, index = certificate.units[-1], equilibria.index_of(equilibrium)
    if radius is None:
        radius = usual_radius(scene, equilibrium)
    if (radius := checks.number("radius", radius, unit, above=0.0)) > MOST_RADIUS:
        raise InputError(
            f"radius = {radius:g} {unit}: must not exceed {MOST_RADIUS:g} {unit}; no step follows that"
        )
    if scene.turning[-1] and away is None and radius > 2.0 * np.pi * checks.FEW_TURNS:
        warnings.warn(f"radius: {checks.beyond_turns(radius)}", stacklevel=2)
    if return_radius is not None:
        return_radius = checks.number("return_radius", return_radius, unit, above=0.0)
    if t_end is None:
        t_end = default_end(certificate, LONG)
    t_end = checks.number("t_end", t_end, "s", above=0.0)
    method = certificate.method(method)
    if dt is not None:
        dt = checks.number("dt", dt, "s", above=0.0)
        certificate.warn_of_step(dt, method)
    if (kind := equilibria.kind[index]) in ("saddle", "maximum") and part is None:
        warnings.warn(f"equilibrium: is a {kind}, which even the smallest disturbance leaves", stacklevel=2)
    coordinates = len(certificate.names)
    center = np.concatenate([equilibrium.position, np.zeros(coordinates)])
    size = size_of(scene, equilibrium)
    return_radius = ball_of_return(scene, equilibria, index, return_radius)
    chosen = range(*checks.part_of(part).indices(n))
    if away is None:
        away = size.from_ball(radius * _starts_in_ball(seed, index, n, chosen, 2 * coordinates))
    else:
        away = away[chosen.start : chosen.stop]
    starts = center + away

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", StepWarning)  # it has been told
        ends = label_states(scene, starts, t_end, How(dt, method, threads=threads))
    moment = certificate.slow_step
    at_first = certificate.damped_times(method, min(dt or moment, t_end))
    times = np.array([0.0, *at_first, t_end])
    departure = np.abs(starts - center)
    final, last, failed = np.empty_like(starts), np.empty_like(starts), np.empty(len(starts))
    rows = EXCURSION + coordinates
    status, records = np.empty(len(starts), dtype=np.int8), np.empty((rows, len(starts)))
    taken, again = np.empty(len(starts)), np.arange(len(starts))
    astray = np.zeros(len(starts), dtype=np.bool_)
    shortest, first = np.inf if dt is not None else certificate.shortest_step, True
    longest = certificate.measuring_steps(starts, method) if dt is None else np.full(len(starts), dt)
    (rhs, constants), formula = certificate.motion, certificate.formula(method)
    params = [*equilibrium.position, *size.metric.ravel(), 1.0 / size.omega**2, return_radius**2]
    record = np.zeros(EXCURSION + 3 * coordinates)
    observation = Observation(observe_departure, np.array(params), record, states=2 * coordinates)

    def follow(which: Integers, until: float, steps: Floats, told: Progress | None = None) -> Ensemble:
        some, moments = starts[which], np.append(times[:-1], until)
        own = rhs, constants, some, moments, steps
        return run_ensemble(*own, formula, observation, threads=threads, progress=told)

    def apart(which: Integers, until: float) -> Integers:
        """Those that half the step leads to other excursions until then [s], well after the largest."""
        half = follow(which, until, 0.5 * longest[which]).records[EXCURSION:rows]
        least = departure[which, :coordinates].T
        half, found = np.maximum(half, least), np.maximum(records[EXCURSION:, which], least)
        return which[~(np.abs(half - found) <= AGREED * half.max(axis=0)).all(axis=0)]

    while again.size:
        run = follow(again, t_end, longest[again], progress if first else None)
        final[again], last[again], failed[again] = run.states[-1], run.last, run.failed
        records[:, again] = run.records[:rows]
        steps, which = np.unique(longest[again], return_inverse=True)
        number = np.array([output_steps(times[-2:], float(step))[0] for step in steps])
        taken[again] = ((t_end - times[-2]) / number)[which]
        reached, broken = run.status, certificate.impossible(starts[again], run.states[-1], threads)
        reached[broken & (reached == Status.OK)] = Status.STEP_TOO_LARGE
        driven = [certificate.grows(t_end / float(k), float(k), method, damped=False) for k in number]
        driving = np.array(driven)[which] & np.isin(reached, (Status.OK, Status.NOT_FINITE))
        reached[driving] = Status.STEP_TOO_LARGE
        # A motion that comes to another well than its proved one has not been followed, whatever it says.
        kept = np.flatnonzero((reached == Status.OK) & (ends.status[again] == Status.CAPTURED))
        at_once = label_states(scene, run.states[-1, kept], moment, How(method=method, threads=threads))
        lost = (at_once.turns != ends.turns[again[kept]]).any(axis=1)
        lost |= at_once.well != ends.well[again[kept]]
        astray[again] = False
        astray[again[kept[lost]]] = True
        if dt is None:
            same = again[kept[~lost]]
            spans = np.exp2(np.ceil(np.log2(BEYOND * (records[SWUNG, same] + moment))))
            for span in np.unique(spans):
                astray[apart(same[spans == span], min(span, t_end))] = True
        status[again] = reached
        again, first = again[((reached != Status.OK) | astray[again]) & (longest[again] > shortest)], False
        longest[again] *= 0.0625

    outcome = np.where(ends.status == Status.CAPTURED, Status.ELSEWHERE, ends.status).astype(np.int8)
    outcome[(ends.well == index) & ~ends.turns.any(axis=1)] = Status.RETURNED
    lost = (status != Status.OK) & (outcome != Status.OUT_OF_RANGE)  # beyond its range it may well fail
    outcome[lost] = status[lost]
    failing = np.isin(outcome, FAILURES)
    last_outside = records[LAST_OUTSIDE]
    left = (size(starts - center) > return_radius) | (last_outside > 0.0)
    after = np.append(times, np.inf)[np.searchsorted(times, last_outside * (1.0 + 1e-12), side="right")]
    inside_since = np.where(left, np.minimum(after, last_outside + taken), 0.0)
    returned = (outcome == Status.RETURNED) & ~astray
    back = np.zeros(len(starts), dtype=np.bool_)
    excess = excess_energy(scene, equilibrium, final[returned])
    confined = confining_energy(scene, equilibrium, return_radius)
    back[returned] = (size(final[returned] - center) <= return_radius) & (excess <= confined)
    # What is left is the slowest mode, whose energy falls twice as fast as its swing, but in steps.
    with np.errstate(all="ignore"):
        more = 1.0 + 0.5 * np.log(np.divide(excess.max(initial=confined), confined))
    excursion = np.maximum(departure[:, :coordinates], records[EXCURSION:].T)
    return DisturbedEnsemble(
        equilibria=equilibria,
        names=dict(zip(certificate.names, certificate.units, strict=True)),
        index=index,
        size=size,
        return_radius=return_radius,
        t_end=t_end,
        enough=t_end + more * classify(scene, equilibrium).decay_time,
        dt=taken,
        starts=starts,
        final=last,
        failed=failed,
        outcome=outcome,
        end_index=np.where(failing, -1, ends.well).astype(np.int8),
        turns=np.where(failing[:, None], 0, ends.turns).astype(np.int64),
        time_to_return=np.where(back, inside_since, np.nan),
        excursion=np.where(((status != Status.OK) | astray)[:, None], np.nan, excursion),
    ).of(scene)


def return_quantile(ensemble: DisturbedEnsemble, share: float) -> float:
    """A quantile of the time to return [s] of those that return; infinite: later than the end of the runs."""
    times = ensemble.time_to_return[ensemble.outcome == Status.RETURNED]
    if not times.size:
        return np.inf
    return float(np.quantile(np.nan_to_num(times, nan=np.inf), share, method="higher"))


def told_energy(system: Scene | Mechanism, equilibrium: Equilibrium | RestingPlace, size: float) -> str:
    """The energy of a blow of this size beside the well's barrier; empty where there is no barrier."""
    tree = certificate_of(system).tree
    index = tree.equilibria.index_of(equilibrium)
    if index not in tree.wells:
        return ""
    depth = float(tree.barrier[tree.wells.index(index)] - tree.equilibria[index].energy)
    if not np.isfinite(depth):
        return ""
    mass, *_ = linear_of(system, equilibrium.position)
    energy = 0.5 * mass[-1, -1] * (size * size_of(system, equilibrium).omega) ** 2
    least = "at least " * tree.bounded(index)
    return f"{energy:.2g} J, barrier {least}{depth:.2g} J"


def usual_radius(scene: Scene | Mechanism, equilibrium: Equilibrium | RestingPlace) -> float:
    """Size of the largest disturbance by default, in the last coordinate's unit [rad or m].

    It is 0.5, which suits angles. Where a coordinate is a length, no disturbance begins beyond the range of a
    coordinate; an end that is nearer than 1 % of the range counts as that far away.
    """
    if isinstance(scene, Scene) or "m" not in certificate_of(scene).units:
        return RADIUS
    low, high = scene.ranges.T
    room = np.minimum(equilibrium.position - low, high - equilibrium.position)
    room = np.maximum(room, LEAST_ROOM * (high - low))
    # The largest departure of each coordinate in a ball of size 1.
    reach = np.sqrt(np.diag(np.linalg.inv(size_of(scene, equilibrium).metric)))
    return min(RADIUS, float((room / reach).min()))


def ball_of_return(scene: Scene | Mechanism, equilibria: Any, index: int, given: float | None) -> float:
    """Radius of the ball of return about an equilibrium; one given that reaches half way on is refused."""
    places, size = equilibria.position, size_of(scene, equilibria[index])
    away = short_way(np.delete(places, index, axis=0) - places[index], scene.turning)
    most = 0.5 * float(size(np.concatenate([away, np.zeros_like(away)], axis=1)).min(initial=np.inf))
    if given is not None and given > most:
        unit = certificate_of(scene).units[-1]
        raise InputError(
            f"return_radius = {given:g} {unit}: must not exceed {most:.3g} {unit}, "
            "half the distance to the next equilibrium"
        )
    return min(RETURN_PART * usual_radius(scene, equilibria[index]), most) if given is None else given


def _starts_in_ball(seed: int, index: int, n: int, chosen: range, dim: int) -> Floats:
    """Points ``chosen`` of n in the unit ball, from streams that no other seed or equilibrium has."""
    first, last = chosen.start // STREAM, max(chosen.start, chosen.stop - 1) // STREAM
    streams = [
        uniform_ball(np.random.default_rng([seed, index, 0, k]), min(STREAM, n - k * STREAM), dim)
        for k in range(first, last + 1)
    ]
    offset = first * STREAM
    return np.concatenate(streams)[chosen.start - offset : chosen.stop - offset]
