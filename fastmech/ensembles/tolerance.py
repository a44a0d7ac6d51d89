"""A tolerance in place of a step.

A sample chooses method and step (:mod:`fastmech.ensembles.work_precision`). For a quantile of the errors
everyone then runs once; a larger sample, the pilot, runs before, and again with shorter steps, which
tells the error. For the largest error
everyone runs twice, the second time with steps shorter by sqrt(2). That run is kept. Its error is told by the
distance of the two (Hairer, Norsett, Wanner, *Solving ODEs I*, section II.4), whose ratio to the error is
known from the method's order and from the sample. Errors of both may be alike by chance: where the two lie
nearly the tolerance apart, a run with longer steps asks. Where they lie further apart, and where many miss
the tolerance by rounding or chaos, a third run measures the error. Who misses the tolerance runs again with
shorter steps. What does not converge has an infinite error, and the reason is told.

Steps that are long for a vibration may damp it, in both runs alike: they agree on a rest that is not there.
So nobody is believed whose first step alone errs by more than the tolerance, until steps are short enough.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fastmech.arrays import Flags, Floats, Integers
from fastmech.ensembles.fitting import EXPONENT_ONCE, fit_steps
from fastmech.ensembles.lanes import finite_rows
from fastmech.ensembles.piecewise import METHOD, follow_to_tolerance
from fastmech.ensembles.problem import Case, Problem
from fastmech.ensembles.run import Progress
from fastmech.ensembles.solve import (
    Settings,
    Solution,
    distances,
    largest,
    part_of,
    put_into,
    solve,
    solve_at,
    tell_aside,
)
from fastmech.ensembles.status import Status, missed_line
from fastmech.ensembles.work_precision import (
    AIM,
    CHEAP_RUN,
    IMPLICIT,
    NEAR,
    NEAREST,
    RATIO,
    REFERENCE,
    SINGLE_STEP,
    Chosen,
    Trial,
    choose,
    error_of_finer,
    escaping,
    first_step_errors,
    order_statistic,
    step_operations,
    stiff_line,
)
from fastmech.integrators.methods import Adams, ImplicitRungeKutta, find_method

#: Trajectories of the sample: so many, fewer where all are few; and neighbours in speed that it takes
#: together, because trajectories of equal steps share a block.
SAMPLE, LEAST_SAMPLE, SHARE_OF_ALL, NEIGHBOURS = 128, 32, 16, 16

#: For the largest error the step is chosen by this quantile of the sample: single trajectories run again.
#: With a lower one more do, and more of their runs agree by chance.
TYPICAL = 0.99

#: Runs again at most, and by how much steps are shortened at most from one to the next, and where the first
#: step alone misses the tolerance.
ROUNDS, LEAP, LEAP_OF_FIRST = 10, 2.0, 8.0

#: Trajectories that run first where a quantile is asked for, how often at most, the share of everyone's steps
#: that is worth another time (less where that costs less), and how many times smaller the errors must be of
#: the run that measures them.
PILOT, PILOTS, WORTH, APART = 512, 4, 0.1, 3.0

#: Trajectories of which it does not pay to see whether float32 suffices.
FEW = 4 * PILOT

#: Why a method whose tried steps have missed the tolerance.
SHORTENED = "steps shorter than those tried at first keep the tolerance"

#: An error of more than this share of that with longer steps is taken for one that these do not set.
IN_VAIN = 0.7

#: Steps of runs again in those of the two first ones, at most; so many operations, a second or two of a core,
#: are always allowed.
BUDGET, CHEAP = 4.0, 4e9

#: Share of the tolerance up to which a measured error keeps it: distances are nearly errors.
KEPT = 0.9

#: Distances of two runs, as a share of the tolerance, above which it is asked whether they are small by
#: chance; and by how much errors of long steps fall faster than the order says: medians of the pendulum, van
#: der Pol's, Duffing's, and Henon and Heiles' systems by three methods are 0.25 to 1.
SUSPECT, FASTER = 0.125, 0.5

#: Runs agree with what the order says of their errors within this factor.
AS_SAID = 8.0

#: Groups of a sample, by their distances, that each tell the ratio of errors to distances.
GROUPS = 4

#: Rounding rules where errors are no more than so many times what it makes at least.
RULED = 3.0

#: Errors below this share of the states that shorter steps do not halve are rounding, which motion magnifies.
MAGNIFIED = 1e-3

#: What a run in vain counts that is far from the next. If it counted as others do, single orbits with a
#: close passage would be given up (``pytest tests/ensembles/test_tolerance.py -k all_eccentricities``); if it
#: did not count, chaos would take long.
PASSAGE = 0.4

#: Unit in the last place of 1.
UNIT = 2.0**-52

#: Changes of starts, in their sizes, by which it is seen how a motion magnifies errors: far above rounding,
#: and so small that in chaos changed motions stay near for long; and what a step's rounding adds at least:
#: over motions of the mechanism, Lorenz', Henon and Heiles' and Kepler's, by four methods, quartiles are
#: 0.04, 0.1 and 0.17 of a double's.
MOVED, A_STEP = 1e-12, 0.04 * UNIT

#: Share of the trajectories that miss the tolerance by rounding or chaos from which on the agreement of the
#: others' runs may be by chance.
MANY = 0.02

#: Least tolerance, over the starts' size, for which lanes of float32 are tried, for quantiles: in the worst
#: trajectories rounding is magnified more than a sample tells.
SINGLE = 3e-5

#: Step times vibration frequency that small tolerances come to.
SHORT = 0.003

#: What helps those whom a quantile lets fail.
EACH = "quantile=1.0 gives each its own steps"

#: What is said where an implicit method is of no help.
UNSOLVED = (
    f"not finite at the steps tried, or {IMPLICIT} finds no solution of them, and shorter ones would cost "
    "too much"
)

#: Least tolerance, over the starts' size, of runs that look whether a stop is touched.
TOUCH = 1e-9

#: What is said of systems whose right-hand sides have branches.
LOCATED = "the right-hand side has branches: steps end where they are passed"
PASSING = "a stopping condition holds for less than a step: steps end where it may"
UNSEEN = "; a stop that lasts less than a step may be missed: it cannot be told where the condition decides"
UNKNOWN = "; the right-hand side may have branches: errors of single trajectories are not known"


@dataclass(frozen=True)
class Estimated:
    """A solution whose error is estimated."""

    solution: Solution
    settings: Settings
    reason: str  #: why this method, one line
    error: Floats | None  #: of each trajectory (n,), where every one has run at least twice
    estimate: float  #: the quantile of the errors that was asked for; NaN: nothing runs


def solve_to_tolerance(
    case: Case, tol: float, quantile: float, method: str | None, progress: Progress | None
) -> Estimated:
    """Integrate so that the quantile (1.0: the largest) of the trajectories' errors is at most ``tol``.

    A trajectory's error is that of its worst component at its worst output time, in the units of the state.
    """
    problem, starts, outputs, threads = case
    switches, unclear = (None, "") if problem.system is None else problem.system.told_switches
    if problem.observation.stops:
        watched = None if switches or unclear or not problem.system else problem.system.watched_stop
        problem = replace(problem, observation=replace(watched or problem.observation, locate=True))
    whole = case._replace(problem=problem)
    if switches is not None and quantile == 1.0 and method is None:
        return _located(whole, switches, (tol, quantile), progress)
    usable = usable_starts(problem, starts, float(outputs[-1]), threads)
    # None of the runs that follow, whatever their steps, asks again who can be followed.
    begins = starts if usable.all() else np.where(usable[:, None], starts, np.nan)
    who, case = np.flatnonzero(usable), Case(problem, begins, outputs, threads)
    if not who.size or outputs[-1] == 0.0:
        settings = Settings(find_method(method or REFERENCE), float(outputs[-1]) or 1.0)
        solution = solve(case, settings, progress)
        none = np.where(usable, 0.0, np.inf) if quantile == 1.0 else None
        why = "no start has a motion that steps can follow" if len(starts) else "there are no starts"
        why = "the only output is the start" if who.size else why
        estimated = Estimated(solution, settings, why, none, 0.0 if who.size else np.nan)
    else:
        found = _estimated(case, who, (tol, quantile, method), switches, progress)
        if found is None:
            return _located(whole, switches, (tol, quantile), progress)
        estimated = above_rounding(found, quantile)
        if estimated.estimate <= tol:  # by shorter steps than those that chose the method
            estimated = replace(estimated, reason=estimated.reason.replace(NEAREST, SHORTENED))
    tell_aside(estimated.solution, starts, outputs, finite_rows(starts) & ~usable)
    if switches is None and not unclear:
        unseen = problem.system and problem.observation.stops and not problem.observation.near
        return replace(estimated, reason=estimated.reason + UNSEEN) if unseen else estimated
    if quantile < 1.0:
        return replace(estimated, reason=estimated.reason + UNKNOWN)
    if switches is None:
        return replace(
            estimated,
            reason=f"{estimated.reason}; no error is known: {unclear}",
            error=np.full(len(starts), np.inf),
            estimate=np.inf if usable.any() else np.nan,
        )
    other, error, remark = follow_to_tolerance(whole, switches, tol, None)
    error += distances(other, estimated.solution)
    worst = order_statistic(error[usable], quantile)
    return replace(estimated, reason=estimated.reason + remark, error=error, estimate=worst)


def _located(case: Case, switches: Any, wanted: tuple[float, float], progress: Progress | None) -> Estimated:
    """Everyone in steps that end where branches of the right-hand side, or else of the stop, are passed."""
    (tol, quantile), why = wanted, LOCATED
    if switches is None:
        (solution, error), why, remark = _follow_stops(case, tol, progress), PASSING, ""
    else:
        solution, error, remark = follow_to_tolerance(case, switches, tol, progress)
    estimate = order_statistic(error[finite_rows(case.starts)], quantile)
    found = Estimated(solution, Settings(find_method(METHOD), 0.0), why + remark, error, estimate)
    return above_rounding(found, quantile)


def above_rounding(found: Estimated, quantile: float) -> Estimated:
    """With no error that is told to be less than half a unit in the last place of the largest state."""
    least = UNIT / 2.0 * largest(found.solution.y).max(axis=1, initial=0.0)
    error = None if found.error is None else np.fmax(found.error, least)
    estimate = np.fmax(found.estimate, order_statistic(least[np.isfinite(least)], quantile))
    return replace(found, error=error, estimate=float(estimate))


def usable_starts(problem: Problem, starts: Floats, t_end: float, threads: int | None) -> Flags:
    """Which starts (n, dim) have motions until ``t_end`` [s] that steps can follow.

    That is asked once, with steps that all tolerances may come to: it depends on a start alone.
    """
    usable, bounds = finite_rows(starts), problem.bounds
    if bounds is None:
        return usable
    longest = SHORT / bounds.frequency
    return usable & ~fit_steps(bounds, starts, longest, t_end, EXPONENT_ONCE, threads=threads).aside


def _estimated(
    case: Case,
    who: Integers,
    asked: tuple[float, float, str | None],
    switches: Any,
    progress: Progress | None,
) -> Estimated | None:
    """The same of starts ``who`` whose motions steps can follow; ``asked``: tolerance, quantile, method.

    None where the right-hand side has branches, and a sample shows that steps over them miss the tolerance;
    and where a stopping condition has them, and runs disagree about it.
    """
    tol, quantile, method = asked
    members = sample_of(case, who, min(max(who.size // SHARE_OF_ALL, LEAST_SAMPLE), SAMPLE))
    sample, truth = case.part(members), None
    if switches is not None and quantile < 1.0:
        if method is None and who.size <= PILOT:  # the reference of a pilot would be that of all
            return None
        truth, _, _ = follow_to_tolerance(sample, switches, tol, None)
    level = TYPICAL if quantile == 1.0 else quantile
    found = choose(sample, tol, level, method, truth, pilot=quantile < 1.0)
    if quantile < 1.0:
        told = _against(case.part(sample_of(case, who, PILOT)), switches, tol)
        error, wanted = told(found.settings), (tol, quantile)
        if error is not None and method is None and not order_statistic(error, quantile) <= tol:
            return None
        once = _once(case, who, (found, error), wanted, progress)
        implicit = isinstance(found.settings.method, ImplicitRungeKutta)
        if method is not None or implicit or once.estimate < math.inf:
            return once
        if case.problem.observation.near:
            return None
        found = choose(sample, tol, level, IMPLICIT, truth, pilot=True)
        if not order_statistic(found.trial.doubt, quantile) <= tol:  # stiffness is not the reason
            return once
        found = found._replace(reason=stiff_line(float(found.settings.dt)))
        other = _once(case, who, (found, told(found.settings)), wanted, progress)
        return min(other, once, key=lambda one: one.estimate)
    runs = Runs(case, who, found, tol)
    runs.twice(progress)
    runs.compare(members, found)
    runs.settle()
    runs.take_short_stops()
    runs.take_single_steps()
    if method is None:
        runs.take_implicit_steps()
    settings, reason = found.settings, found.reason
    if runs.implicit == who.size:
        dt = float(np.nanmax(runs.kept.dt[:, who]))
        settings, reason = replace(settings, method=find_method(IMPLICIT), dt=dt), stiff_line(dt)
        runs.implicit = 0
    reason += runs.remark()
    worst = float(np.max(runs.error[who], initial=0.0))
    return Estimated(runs.kept, settings, reason, runs.error, worst)


def _against(pilot: Case, switches: Any, tol: float) -> Callable[[Settings], Floats | None]:
    """What tells a pilot's errors with given settings where steps may pass branches; else it gives None.

    There runs with shorter steps tell none.
    """
    if switches is None:
        return lambda _: None
    reference, own, _ = follow_to_tolerance(pilot, switches, tol, None)
    return lambda settings: own + distances(solve_at(pilot, settings), reference)


def _once(
    case: Case,
    who: Integers,
    chosen: tuple[Chosen, Floats | None],
    wanted: tuple[float, float],
    progress: Progress | None,
) -> Estimated:
    """Everyone once, with steps with which the quantile of a larger sample's errors is within the tolerance.

    ``chosen``: method and steps, and this sample's errors where runs with shorter steps do not tell them.
    """
    (found, error), (tol, quantile) = chosen, wanted
    settings, solution, pilot = found.settings, None, who
    if error is None:
        pilot = sample_of(case, who, PILOT)
        part = case.part(pilot)
        settings, run, error = _piloted(part, settings, wanted, min(WORTH, pilot.size / who.size))
        implicit = isinstance(settings.method, ImplicitRungeKutta)
        few = who.size <= FEW or tol < SINGLE * found.trial.case.size
        if not few and not implicit and not case.problem.observation.stops:
            single = replace(settings, precision=np.float32)
            rounded = error + distances(solve_at(part, single), run)
            if order_statistic(rounded, quantile) <= tol:
                settings, error = single, rounded
        if (
            case.problem.system is None
            and pilot.size == len(case.starts)
            and settings.precision is np.float64
        ):
            solution = run
            if progress is not None:
                progress(pilot.size)
    if solution is None:
        solution = solve_at(case, settings, progress)
    errors, near = np.full(len(case.starts), np.inf), solution.near.copy()
    passing = _take_short_stops(case, who[near[who]], (solution, errors), tol)
    if passing:  # there are no branches, so the errors are a pilot's
        error = np.where(near[pilot], errors[pilot], error)
    estimate = order_statistic(error, quantile)
    remark = "" if estimate <= tol else f"; the {quantile:.3g} quantile misses it"
    failed = int(np.count_nonzero(solution.status[who]))
    remark += f"; {failed:,} of {who.size:,} fail: {EACH}" if failed else ""
    return Estimated(solution, settings, found.reason + passing + remark, None, estimate)


def _follow_stops(case: Case, tol: float, progress: Progress | None) -> tuple[Solution, Floats]:
    """Runs whose steps end where a stopping condition may be true for a short time, and their errors (n,).

    Whether it is just touched is seen by errors far below the tolerance, where these can be had.
    """
    switches = case.problem.system.stop_switches if case.problem.system else None
    run, error, _ = follow_to_tolerance(case, switches, min(tol, TOUCH * case.size), progress)
    rest = np.flatnonzero(np.isinf(error))
    if rest.size and tol > TOUCH * case.size:
        other, error[rest], _ = follow_to_tolerance(case.part(rest), switches, tol, None)
        put_into(run, rest, other)
    return run, error


def _unwatched(case: Case) -> Case:
    """The same without looks between steps, of which only the run that is kept has need."""
    problem = case.problem
    if not problem.observation.near or problem.system is None:
        return case
    plain = replace(problem.system.observation, locate=True)
    return case._replace(problem=replace(problem, observation=plain))


def _take_short_stops(case: Case, near: Integers, into: tuple[Solution, Floats], tol: float) -> str:
    """Run those whose stop may be shorter than a step with steps that end there, and say how many."""
    system = case.problem.system
    if not near.size or system is None or not case.problem.observation.near:
        return ""
    solution, errors = into
    run, errors[near] = _follow_stops(case.part(near), tol, None)
    put_into(solution, near, run)
    return f"; {near.size:,} of {errors.size:,} may stop for less than a step: they run by {METHOD}"


def _piloted(
    part: Case, settings: Settings, wanted: tuple[float, float], worth: float
) -> tuple[Settings, Solution, Floats]:
    """Steps with which the quantile of a pilot's errors is within the tolerance; their run and its errors.

    These are measured by a run with shorter steps. Longer steps than ones with small errors are tried where
    they save the share ``worth`` of all steps.
    """
    (tol, quantile), p = wanted, settings.method.order
    grows = part.problem.bounds is None and bool(settings.early)
    trial, reference = Trial(part, tol, quantile, settings.fit, grows=grows), math.inf
    dt, shortest = min(float(settings.dt), trial.longest), 0.0
    best: tuple[float, float, Floats] | None = None
    tries, missed = 0, (math.inf, math.inf)  # the shortest steps that are too long, and their error
    while tries < PILOTS:
        shortest = max(shortest, trial.shortest(dt))
        dt = trial.taken(dt, shortest)
        if not (dt / reference) ** p >= APART:
            reference = trial.taken(dt / RATIO, shortest)
        for _ in range(PILOTS):  # until it is believed
            first = trial.first_step_errors(settings.method, reference)
            late = order_statistic(first, quantile)
            if late <= tol:
                break
            reference = trial.taken(
                reference * max((AIM * tol / late) ** (1.0 / (p + 1)), 1.0 / LEAP), shortest
            )
        runs = (trial.run(settings.method, step, shortest) for step in (reference, dt))
        error = distances(*runs) / (1.0 - (reference / dt) ** p)
        error = unless_damped(error, first, tol)
        estimate = order_statistic(error, quantile)
        # A run that misses the tolerance costs no try as long as the next one is cheap.
        cheap = len(part.starts) * trial.work(settings.method, 0.5 * dt) <= CHEAP_RUN
        tries += estimate <= tol or not cheap
        if best is not None and best[0] > tol and estimate > IN_VAIN * best[0]:
            if dt * RATIO <= best[1]:
                break
            # Slightly shorter steps may be as many as before in the interval that sets the error.
            dt = best[1] / RATIO * (1.0 - 1e-9)
            continue
        if estimate > tol:
            missed = min(missed, (dt, estimate))
        if best is None or best[0] > tol or estimate <= tol:
            best = estimate, dt, error
        reached, dt = max(best[0], 1e-300), best[1]
        longer = AIM * tol / reached
        asked = min(max(longer ** (1.0 / p), 1.0 / LEAP), RATIO, missed[0] / dt)
        if reached <= tol and missed[0] < math.inf:
            # Errors of long steps fall faster than the order says, those of short ones as it does.
            chord = longer ** (math.log(missed[0] / dt) / math.log(missed[1] / reached))
            asked = (asked * chord * chord) ** (1.0 / 3.0)
        other = trial.taken(min(dt * asked, trial.longest), shortest)
        if reached <= tol and (reached >= NEAR * tol or 1.0 - dt / other < worth):
            break
        dt = other
    assert best is not None
    early = trial.settings(settings.method, best[1], shortest).early if grows else settings.early
    settings = replace(settings, dt=best[1], shortest=shortest, early=early)
    return settings, trial.run(settings.method, best[1], shortest), best[2]


def unless_damped(error: Floats, first: Floats, tol: float) -> Floats:
    """Errors (n,) that are told, but where those of the ``first`` step are larger, and than the tolerance."""
    return np.where(first > tol, np.fmax(error, first), error)


class Runs:
    """Trajectories that run twice, and again where that does not tell their errors."""

    def __init__(self, case: Case, who: Integers, found: Chosen, tol: float) -> None:
        n, settings = len(case.starts), found.settings
        settings = replace(settings, shortest=found.trial.shortest(float(settings.dt)))
        self.case, self.who, self.settings, self.tol = case, who, settings, tol
        self.found, self.operations = found, found.trial.operations  #: of a right-hand side
        self.order = settings.method.order
        self.dt = np.full(n, float(settings.dt))
        self.share = float(error_of_finer(np.ones(1), RATIO, self.order)[0])  #: of a distance that is error
        self.error = np.full(n, np.inf)  #: estimates
        self.measured = np.zeros(n, dtype=np.bool_)  #: told by a run with shorter steps
        self.floor = np.full(n, np.nan)  #: errors that rounding makes, where that is known
        self.asked = np.zeros(n, dtype=np.bool_)  #: whether that has been asked
        self.before = np.full(n, np.inf)  #: what was last measured
        self.vain = np.zeros(n)  #: runs that have not halved the error
        self.unpaid, self.rounded = np.zeros(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_)
        self.unsolved = False  #: whether an implicit method finds no solution of its steps either
        self.passing = ""  #: what is said of stops that are shorter than a step
        self.implicit = 0  #: trajectories that run by an implicit method in place of an explicit one
        self.first = np.zeros(n)  #: errors of the first step of what is kept

    def solve(self, who: Integers | None, dt: float | Floats, progress: Progress | None = None) -> Solution:
        """A run of some or all with steps of dt [s]."""
        case = self.case if who is None else self.case.part(who)
        return solve_at(case, replace(self.settings, dt=dt), progress)

    def twice(self, progress: Progress | None) -> None:
        """Everyone, the second time with shorter steps; that run is kept."""
        dt = float(self.settings.dt)
        first = solve_at(_unwatched(self.case), replace(self.settings, dt=dt * RATIO), progress)
        self.kept = self.solve(None, dt)
        self.apart = distances(first, self.kept)
        self._ask_coarser(first, dt)
        cheap = CHEAP / step_operations(self.settings.method, self.operations, self.kept.y.shape[2])
        self.left = cheap + BUDGET * float(first.steps[self.who].sum() + self.kept.steps[self.who].sum())
        self.first = first_step_errors(self.case, replace(self.settings, dt=dt), self.tol)
        self.believe(self.share)

    def _ask_coarser(self, first: Solution, dt: float) -> None:
        """Lengthen distances that are small by chance, where errors of two runs happen to be alike.

        A run with still longer steps than the ``first`` tells what the distance should be by the order.
        """
        near = (self.apart <= self.tol) & (self.apart > SUSPECT * self.tol)
        again = self.who[near[self.who]]
        if again.size:
            coarser = self.solve(again, dt * RATIO**2)
            said = distances(coarser, part_of(first, again)) * FASTER / RATIO**self.order
            self.apart[again] = np.fmax(self.apart[again], np.where(np.isfinite(said), said, 0.0))

    def believe(self, share: float | Floats) -> None:
        """The errors that the distances of both runs tell, but of whose first step errs by more."""
        told = unless_damped(share * self.apart, self.first, self.tol)
        self.error[self.who] = told[self.who]

    def compare(self, members: Integers, found: Chosen) -> None:
        """The errors of a sample, which are known, and from it the ratio of errors to distances."""
        assert found.trial.truth is not None
        known = found.trial.doubt <= self.tol
        right = distances(part_of(self.kept, members), found.trial.truth)[known]
        apart = self.apart[members][known]
        told = np.isfinite(apart) & np.isfinite(right) & (apart > 0.0)
        if told.any():
            # Large and small distances may be those of different motions, with errors of other orders.
            rising = np.flatnonzero(told)[np.argsort(apart[told], kind="stable")]
            groups = [group for group in np.array_split(rising, GROUPS) if group.size]
            with np.errstate(over="ignore", divide="ignore"):  # distances that are not normal numbers
                seen = [float(np.median(right[group] / apart[group])) for group in groups]
                at = [float(np.log(np.median(apart[group]))) for group in groups]
                share = np.interp(np.log(self.apart), at, seen)
            self.believe(np.clip(share, self.share / AS_SAID, 1.0))
        if found.trial.apart is not None:
            sure = found.trial.apart[known] <= self.tol
            self.error[members[known][sure]] = right[sure]
            self.measured[members[known][sure]] = right[sure] <= KEPT * self.tol

    def settle(self) -> None:
        """Run those again whose errors may exceed the tolerance.

        Two runs that lie apart by no more than the tolerance keep it, whatever the order. Else it takes an
        order that the second does, and single trajectories show less of it than most: a third run measures
        the error. Where many miss the tolerance by rounding or chaos, the agreement of two runs is proof of
        nothing: everyone is measured, and asked for the rounding in it.
        """
        for _ in range(ROUNDS):
            doubtful = ~(np.fmax(self.error, self.apart) <= self.tol) & ~self.measured & ~self.kept.near
            if self.magnifies:
                doubtful |= ~self.asked
            again = self.who[(doubtful & (self.vain < 2.0) & ~self.unpaid & ~self.rounded)[self.who]]
            if not self.measure(again):
                break
        self._share_rounding()

    def _share_rounding(self) -> None:
        """Where rounding rules many, what it makes of the others is as many times what it makes at least.

        So nobody keeps the tolerance by runs that agree by chance.
        """
        ruled = self.who[self.rounded[self.who] & (self.floor[self.who] > 0.0)]
        if not ruled.size or not self.magnifies:
            return
        floor = self.floor * np.median(np.fmax(self.error[ruled] / self.floor[ruled], 1.0))
        self.error[self.who] = np.fmax(self.error, floor)[self.who]
        self.rounded[self.who] |= (floor > self.tol)[self.who]

    @property
    def magnifies(self) -> bool:
        """Whether many miss the tolerance by rounding or chaos."""
        return bool(np.mean((self.rounded | (self.vain >= 2.0))[self.who]) >= MANY)

    def _missed(self) -> Integers:
        """Those whose errors are not known to be within the tolerance."""
        return self.who[~(self.error[self.who] <= self.tol)]

    def take_single_steps(self) -> None:
        """Those that an Adams method leaves without the tolerance run by a method without a history.

        A step of which the history is too long for a short turn errs as much however short it is made; and
        rounding of long histories is larger (Hairer, Norsett, Wanner, section III.1).
        """
        missed = self._missed()
        if not missed.size or not isinstance(self.settings.method, Adams):
            return
        method, dim = find_method(SINGLE_STEP), self.case.starts.shape[1]
        own, other = (step_operations(m, self.operations, dim) for m in (self.settings.method, method))
        settings = replace(self.settings, method=method, dt=float(self.settings.dt) * other / own)
        # As much work, to begin with.
        self._take(missed, self.found._replace(settings=settings), np.zeros(0, dtype=np.int64))

    def take_short_stops(self) -> None:
        """Those whose stop may be shorter than a step, or about whose stop runs disagree."""
        other = np.isinf(self.apart) & (self.error > self.tol) & (self.kept.status == 0)
        near = self.who[(self.kept.near | other)[self.who]]
        self.passing = _take_short_stops(self.case, near, (self.kept, self.error), self.tol)
        if self.passing:
            self.rounded[near] = self.unpaid[near] = False

    def take_implicit_steps(self) -> None:
        """Those whose motion is too stiff for an explicit method's steps run by an implicit one."""
        missed = self._missed()
        ended = np.isfinite(self.kept.y[:, missed]).all(axis=(0, 2))
        stiff = missed[self.unpaid[missed] | ~ended]
        if not stiff.size or isinstance(self.settings.method, ImplicitRungeKutta):
            return
        self._ask_rounding(stiff[np.isnan(self.floor[stiff])])
        ruled = self.floor[stiff] > self.tol  # whatever the method
        self.rounded[stiff[ruled]] = True
        stiff = stiff[~ruled]
        if not stiff.size:
            return
        settings = replace(self.settings, dt=self.dt[stiff])
        stiff = stiff[~escaping(self.case.part(stiff), settings, float(self.settings.dt))]
        if not stiff.size:
            return
        members = sample_of(self.case, stiff, LEAST_SAMPLE)
        found = choose(self.case.part(members), self.tol, TYPICAL, IMPLICIT, None, pilot=False)
        if not (found.trial.doubt <= self.tol).any():  # stiffness is not the reason
            self.unsolved = found.trial.unsolved
            return
        self.implicit = self._take(stiff, found, np.searchsorted(stiff, members))

    def _take(self, missed: Integers, found: Chosen, members: Integers) -> int:
        """Run those that miss the tolerance otherwise; whose errors become smaller are kept: their number."""
        again = Runs(self.case.part(missed), np.arange(missed.size), found, self.tol)
        again.twice(None)
        if members.size:
            again.compare(members, found)
        again.settle()
        better = (again.error < self.error[missed]) & ~again.kept.near
        put_into(self.kept, missed[better], part_of(again.kept, better))
        for name in ("error", "rounded", "unpaid"):
            getattr(self, name)[missed[better]] = getattr(again, name)[better]
        return int(np.count_nonzero(better))

    def measure(self, again: Integers) -> bool:
        """Tell the errors of trajectories by a run with shorter steps, or take that run for theirs.

        Whether any could be paid for.
        """
        tol, p, error = self.tol, self.order, self.error[again]
        with np.errstate(divide="ignore", invalid="ignore"):
            shorter = np.where(error <= tol, 1.0, (AIM * tol / error) ** (1.0 / p))
        least = 1.0 / np.where(self.first[again] > tol, LEAP_OF_FIRST, LEAP)
        rungs = np.ceil(-2.0 * np.log2(np.clip(shorter, least, 1.0 / RATIO)) - 1e-9)
        # Longest steps first, as many as the budget allows.
        steps = self.kept.steps[again] * RATIO**rungs
        order = np.argsort(steps, kind="stable")
        spent = np.cumsum(steps[order])
        self.unpaid[again[order[spent > self.left]]] = True
        paid = np.sort(order[spent <= self.left])
        if not paid.size:
            return False
        self.left -= float(spent[spent <= self.left][-1])
        again, rungs = again[paid], rungs[paid]
        doubted = ~(self.error[again] <= tol) | self.magnifies
        unknown = doubted & np.isnan(self.floor[again]) & ~(self.first[again] > tol)
        self._ask_rounding(again[unknown])
        own, said = self.dt[again] * RATIO**-rungs, self.error[again]
        run, before = self.solve(again, own), part_of(self.kept, again)
        apart = distances(run, before)
        # A run that is far from the next one has shown nothing of rounding: its steps were too long.
        self.floor[again[apart > MAGNIFIED * self._sizes(run, again).max(axis=1)]] = np.nan
        floor = np.where(np.isfinite(self.floor[again]), self.floor[again], 0.0)
        told = np.fmax(apart / (1.0 - RATIO ** (-p * rungs)), floor)
        self.first[again] = first_step_errors(self.case.part(again), replace(self.settings, dt=own), tol)
        short = ~(self.first[again] > tol)
        good = (told <= KEPT * tol) & short
        self.error[again[good]], self.measured[again[good]] = told[good], True
        # Where the error is larger than it was said to be, steps are too long for the order, and so may the
        # new ones be.
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            worse = np.fmax(apart / said, 1.0)
            finer = worse * error_of_finer(apart, RATIO, p) * RATIO ** (-p * (rungs - 1.0))
        now = np.fmax(np.where(worse <= AS_SAID, finer, apart), floor)
        now = unless_damped(now, self.first[again], tol)
        size = self._sizes(run, again).max(axis=1)
        in_vain = ~good & short & ~(told <= 0.5 * self.before[again])
        self.before[again] = told
        # Where many are chaotic, whoever tries often agrees at last, by chance. Elsewhere runs that are far
        # apart may have steps too long for a close passage.
        far = np.where(apart > MAGNIFIED * size, PASSAGE, 1.0)
        self.vain[again] += in_vain * (2.0 if self.magnifies else far)
        ruled = short & ((told <= RULED * floor) | ((self.vain[again] >= 2.0) & (told < MAGNIFIED * size)))
        self.rounded[again] |= ~good & ruled
        # Steps that were not stable have magnified what shorter ones do not: that is asked again.
        self.floor[again[~ruled & (floor > tol)]] = np.nan
        # Where shorter steps are in vain, the order tells nothing.
        now = np.where(ruled, told, np.where(self.vain[again] >= 2.0, np.fmax(told, now), now))
        bad = again[~good]
        put_into(self.kept, bad, part_of(run, ~good))
        self.error[bad], self.dt[bad] = now[~good], own[~good]
        self.apart[bad] = apart[~good]
        return True

    def _ask_rounding(self, who: Integers) -> None:
        """By how much motions magnify a small change of their start, and so the rounding of their steps.

        Steps that are not stable magnify changes beyond all motion: of their runs nothing is learnt, and
        those with shorter steps are asked again.
        """
        if not who.size:
            return
        self.asked[who] = True
        kept, part = part_of(self.kept, who), self.case.part(who)
        size = self._sizes(kept, who)
        # What grows is small at first, and so is its rounding.
        begin = np.abs(part.starts)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.nan_to_num(begin / size).max(axis=1, keepdims=True)
        moved = part._replace(starts=part.starts + MOVED * np.fmax(begin, share * size))
        run = solve_at(moved, replace(self.settings, dt=self.dt[who]))
        with np.errstate(over="ignore"):
            floor = distances(run, kept) / MOVED * A_STEP * np.sqrt(kept.steps)
        self.floor[who] = np.where(floor <= MAGNIFIED * size.max(axis=1), floor, np.nan)

    def _sizes(self, run: Solution, who: Integers) -> Floats:
        """How large the states of a run of some become (n, dim)."""
        return np.fmax(largest(run.y), np.abs(self.case.starts[who]))

    def remark(self) -> str:
        """Why trajectories miss the tolerance; those that do not converge have no error that is known."""
        missed = np.zeros(self.error.size, dtype=np.bool_)
        missed[self._missed()] = True
        lost = missed & ~np.isfinite(self.kept.y[-1]).all(axis=1)
        self.error[missed & ~self.rounded] = np.inf
        rounded = missed & self.rounded
        unpaid = missed & self.unpaid & ~rounded
        rest = missed & ~lost & ~unpaid & ~rounded
        unsolved = lost & unpaid & (self.unsolved | (self.kept.status == Status.NOT_CONVERGED))
        stops, vain = rest & self.case.problem.observation.stops, self.vain >= 2.0
        causes = {
            "a stop that they just touch, or two resolutions disagree about it": stops,
            "not finite at any step tried": lost & ~unpaid,
            "not finite at the steps tried, and shorter ones would cost too much": lost & unpaid & ~unsolved,
            UNSOLVED: unsolved,
            "shorter steps would cost too much": unpaid & ~lost,
            "rounding is larger, as slight changes of their starts show": rounded,
            "shorter steps do not reduce their errors as the order says (chaos, a singularity of the "
            "right-hand side)": rest & ~stops & vain,
            "the shortest steps tried are still too long": rest & ~stops & ~vain,
        }
        stiff = (
            f"; {self.implicit} of {self.who.size} are stiff and run by {IMPLICIT}" if self.implicit else ""
        )
        return stiff + self.passing + missed_line(missed, causes)


def sample_of(case: Case, usable: Integers, size: int) -> Integers:
    """A sample of the trajectories: of a scene evenly spaced groups, sorted by what bounds their speed.

    Of a system they are drawn: evenly spaced ones of a grid may all lie in a few of its columns.
    """
    size = size // NEIGHBOURS * NEIGHBOURS
    if usable.size <= size:
        return usable
    if case.problem.bounds is None:
        return np.sort(np.random.default_rng(0).choice(usable, size, replace=False))
    bound = case.problem.bounds.speed(case.starts)
    usable = usable[np.argsort(bound[usable], kind="stable")]
    groups = size // NEIGHBOURS
    # Each group is from the middle of its share of them: the fastest count no more than the others.
    middle = (np.arange(groups) + 0.5) * usable.size / groups
    first = np.floor(middle).astype(np.int64) - NEIGHBOURS // 2
    return usable[(first[:, None] + np.arange(NEIGHBOURS)).ravel()]
