"""One run of a problem with given settings; how far bodies turn in its steps; states between the steps.

Outputs that are closer than steps: states between them by Hermite's interpolation. Where a tolerance allows
steps longer than the intervals between outputs, the run takes equal steps over its whole time. A polynomial
through the states and their derivatives at ``k`` neighbouring steps, of degree 2 k - 1 (Stoer, Bulirsch,
*Introduction to Numerical Analysis*, section 2.1.5), gives the outputs; k is such that its error is far below
the method's.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import permutations
from typing import Any

import numpy as np

from fastmech.arrays import Codes, Flags, Floats, Integers
from fastmech.ensembles.ends import STOP_CODE, near_stops
from fastmech.ensembles.fitting import EXPONENT_AGAIN, EXPONENT_ONCE, Bounds, Moving, fit_steps
from fastmech.ensembles.lanes import output_steps
from fastmech.ensembles.problem import Case, Problem
from fastmech.ensembles.run import Ensemble, Observation, Progress, run_ensemble
from fastmech.ensembles.status import Status
from fastmech.integrators.methods import Method
from fastmech.jit import OBSERVER_SIGNATURE, kernel
from fastmech.step_limits.warning import TURN

#: By how much rounding may make a step longer than the dt that it was to be.
ROUNDED = 1e-6

#: Outputs at most, evenly spread, at which energies are looked at: damped motion loses what a step gave it.
LOOKS = 16

#: Rows of the record: the greatest turn of an angle in a step [rad], and the angles that the step began with.
TURNED, BEFORE = 0, 1


@kernel(OBSERVER_SIGNATURE)
def observe_turns(t: float, Y: Floats, params: Floats, record: Floats) -> None:
    """Keep the greatest turn of every lane."""
    for angle in range(record.shape[0] - BEFORE):
        for i in range(Y.shape[1]):
            turned = abs(Y[angle, i] - record[BEFORE + angle, i])
            record[TURNED, i] = turned if turned > record[TURNED, i] else record[TURNED, i]
            record[BEFORE + angle, i] = Y[angle, i]


TURNS = Observation(observe_turns, np.zeros(0), np.zeros(3), states=2)


def may_turn(bounds: Bounds, starts: Floats, dt: float | Floats, threads: int | None = None) -> Flags:
    """Whether a body may turn by more than :data:`TURN` in a step of ``dt`` [s], by its energy; (n,)."""
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        turn = bounds.speed(starts, threads)
        turn *= bounds.turn
        turn *= dt
        return np.asarray(turn > TURN)


def watched(problem: Problem, starts: Floats, dt: float, threads: int | None = None) -> Problem:
    """The problem, with turns observed where the steps of ``dt`` [s] are long enough for them."""
    bounds = problem.bounds
    some = bounds is not None and may_turn(bounds, starts, (1.0 + ROUNDED) * dt, threads).any()
    return replace(problem, observation=TURNS) if some else problem


def has_turned(
    problem: Problem, starts: Floats, dt: Floats, records: Floats, threads: int | None = None
) -> Flags | bool:
    """Whose bodies (n,) turn too far in steps of at most ``dt`` (n,) [s], by a watched problem's records.

    Only turns count that the energy allows in a trajectory's own steps: they do not depend on whether its
    companions' were a reason to watch.
    """
    if problem.bounds is None or problem.observation is not TURNS:
        return False
    return may_turn(problem.bounds, starts, dt, threads) & (records[TURNED] > TURN)


Precision = type[np.floating[Any]]


@dataclass(frozen=True)
class Settings:
    """How a problem is integrated."""

    method: Method
    dt: float | Floats  #: longest step [s], of all trajectories or of each (n,)
    fit: tuple[float, ...] = ()  #: times [s] at which the steps are fitted to the energy; () for never
    precision: Precision = np.float64
    early: tuple[tuple[float, float], ...] = ()  #: until these times [s] steps are shorter by a factor
    bounded: bool = True  #: starts to which too many steps would be fitted do not run
    shortest: float = 0.0  #: shorter intervals between outputs have as many steps as one so long [s]


@dataclass
class Solution:
    """What a run gives."""

    y: Floats  #: states, shape (outputs, n, dim)
    records: Floats  #: what was observed, shape (rows, n)
    status: Codes  #: shape (n,)
    steps: Integers  #: steps of each trajectory that runs to the end, shape (n,)
    dt: Floats  #: longest step of each [s], shape (pieces, n): a piece ends where steps are fitted again
    failed: Floats  #: time of the last finite state of a trajectory that failed [s], else NaN, shape (n,)
    last: Floats | None  #: last finite states, shape (n, dim); None: none failed, they are the final ones
    last_term: Floats  #: of an Adams method's predictor, see :class:`Ensemble`; of other methods empty
    near: Flags  #: who may have fulfilled a stopping condition between two steps' ends, shape (n,)


def nothing(problem: Problem, outputs: int, n: int, dim: int) -> Solution:
    """A solution of n trajectories to put others' into."""
    y, records = np.zeros((outputs, n, dim)), np.repeat(problem.observation.record[:, None], n, axis=1)
    status, number, dt = np.zeros(n, dtype=np.int8), np.zeros(n, dtype=np.int64), np.zeros((1, n))
    failed, none = np.full(n, np.nan), np.zeros(0)
    return Solution(y, records, status, number, dt, failed=failed, last=None, last_term=none, near=status > 0)


def part_of(solution: Solution, who: Integers | Flags) -> Solution:
    """Some of a solution's trajectories."""
    known = {k: v for k, v in vars(solution).items() if v is not None and v.shape != (0,)}
    of_each = ("status", "steps", "failed", "last", "last_term", "near")
    return replace(solution, **{k: v[who] if k in of_each else v[:, who] for k, v in known.items()})


def put_into(best: Solution, which: Integers, run: Solution) -> None:
    """Put the trajectories of a run into the places ``which`` of a solution."""
    rows = max(len(best.dt), len(run.dt))
    best.dt, dt = (np.pad(s.dt, ((0, rows - len(s.dt)), (0, 0)), mode="edge") for s in (best, run))
    for old, new in ((best.y, run.y), (best.records, run.records), (best.dt, dt)):
        old[:, which] = new
    best.status[which], best.steps[which], best.failed[which] = run.status, run.steps, run.failed
    best.near[which] = run.near
    if best.last is not None or run.last is not None:
        best.last = best.y[-1].copy() if best.last is None else best.last
        best.last[which] = run.y[-1] if run.last is None else run.last


def largest(y: Floats, other: Floats | None = None) -> Floats:
    """Largest absolute values of states (times, n, dim), or of their differences, at any time (n, dim).

    NaN where one is not a number.
    """
    found, now = np.zeros(y.shape[1:]), np.empty(y.shape[1:])
    with np.errstate(invalid="ignore", over="ignore"):
        for k in range(len(y)):  # time by time: what is computed on the way stays in the cache
            np.abs(y[k] if other is None else np.subtract(y[k], other[k], out=now), out=now)
            np.maximum(found, now, out=found)
    return found


def distances(a: Solution, b: Solution) -> Floats:
    """Largest difference of two solutions at any output in any component, shape (n,).

    Infinite where one is not finite, or has stopped otherwise than the other.
    """
    apart = largest(a.y, b.y).max(axis=1, initial=0.0)
    apart[np.isnan(apart)] = np.inf
    if a.records.size and b.records.size:
        apart[a.records[STOP_CODE] != b.records[STOP_CODE]] = np.inf
    return np.asarray(apart)


def solve(case: Case, settings: Settings, progress: Progress | None = None) -> Solution:
    """Integrate from t = 0 through the output times [s].

    Where steps are fitted again, the times at which that is done end a piece of the run. Starts to whose
    motions no steps can be fitted do not run: any step is too large for them.
    """
    problem, starts, outputs, threads = case
    until = float(outputs[-1])
    again = {t for t in settings.fit if 0.0 < t < until}
    ends = sorted(again | {t for t, _ in settings.early if 0.0 < t < until} | {until})
    fitted_to = problem.bounds if settings.fit else None
    exponent = EXPONENT_AGAIN if again else EXPONENT_ONCE
    begin, now, aside = 0.0, problem.inward(starts), np.zeros(len(starts), dtype=np.bool_)
    dt: Any = np.asarray(settings.dt, dtype=np.float64)
    shares: Any = 1.0
    if fitted_to is not None:
        shares, aside = fit_steps(fitted_to, starts, dt, until, exponent, threads=threads)
        aside &= settings.bounded
        if aside.any():  # they never enter a block, and their step is that of slow motion
            now, shares[aside] = np.where(aside[:, None], np.nan, now), 1.0
    method = problem.method(settings.method)
    states: list[Floats] = []
    taken: list[tuple[Integers, Floats]] = []
    course: Ensemble | None = None
    for piece, end in enumerate(ends):
        inside = (outputs <= end) & ((outputs > begin) | (piece == 0))
        times = np.concatenate([[begin], outputs[inside]])
        times = times if times[-1] == end and times.size > 1 else np.append(times, end)
        if piece and fitted_to is not None:
            # No motion becomes faster than its start allows: a step never shrinks where one has blown up.
            fitted = fit_steps(fitted_to, problem.outward(now), 1.0, end - begin, exponent, threads=threads)
            shares = np.maximum(fitted.shares, shares)
        steps = dt * shares * min((share for until, share in settings.early if end <= until), default=1.0)
        before, course = (
            course,
            run_ensemble(
                problem.rhs,
                problem.params,
                now,
                times,
                steps,
                method=method,
                observation=problem.observation,
                threads=threads,
                precision=settings.precision,
                progress=progress if end == ends[-1] else None,
            ),
        )
        if before is not None:
            _go_on(before, course, problem)
        if inside.any():  # else they need not be kept
            states.append(course.states[: np.count_nonzero(inside)])
        taken.append(_steps_taken(times, steps, len(starts)))
        begin, now = end, course.states[-1]
    assert course is not None
    solution = _solution(problem, course, states, taken)
    tell_aside(solution, starts, outputs, aside)
    if problem.motion is not None:
        broken = impossible(problem.motion, case, solution.y)
        solution.status[broken & (solution.status == Status.OK)] = Status.STEP_TOO_LARGE
    return solution


def impossible(motion: Moving, case: Case, y: Floats) -> Flags:
    """Which trajectories (n,) have an energy that they cannot have at one of some outputs (times, n, dim)."""
    _, starts, outputs, threads = case
    first = int(np.searchsorted(outputs, motion.rests)) if motion.rests > 0.0 else 0
    if first == len(y):
        return np.zeros(len(starts), dtype=np.bool_)
    seen = y[first:][:: -math.ceil((len(y) - first) / LOOKS)]  # from the end on, and no copy
    return motion.impossible(y[first] if motion.rests > 0.0 else starts, seen, threads)


def tell_aside(solution: Solution, starts: Floats, outputs: Floats, aside: Flags) -> None:
    """What is told of trajectories (n,) that did not run because no steps can follow them."""
    solution.status[aside] = Status.STEP_TOO_LARGE
    solution.y[: 1 if outputs[0] == 0.0 else 0, aside] = starts[aside]
    if solution.last is not None:
        solution.last[aside] = starts[aside]


def _go_on(before: Ensemble, run: Ensemble, problem: Problem) -> None:
    """Let a piece of a run tell what has become of trajectories in those before it too."""
    np.maximum(before.last_term, run.last_term, out=run.last_term)
    if problem.observation is TURNS:
        np.maximum(run.records[TURNED], before.records[TURNED], out=run.records[TURNED])
    for k, (members, states) in enumerate(run.lost):
        first = np.isnan(before.failed[members])
        run.lost[k] = members[first], states[first]
    run.lost[:0] = before.lost
    np.copyto(run.status, before.status, where=before.status != Status.OK)
    np.copyto(run.failed, before.failed, where=~np.isnan(before.failed))


def _solution(
    problem: Problem, run: Ensemble, states: list[Floats], taken: list[tuple[Integers, Floats]]
) -> Solution:
    """All pieces together: the last one, the states of each, and the steps that each has taken."""
    y = states[0] if len(states) == 1 else np.concatenate(states)
    if problem.canonical:
        for output in y:  # one at a time: what is computed on the way takes little memory
            output[:] = problem.outward(output)
    last: Any = y[-1].copy() if run.lost else None
    for members, lost in run.lost:
        last[members] = problem.part(members).outward(lost)
    steps, dt = sum((number for number, _ in taken[1:]), taken[0][0]), np.array([dt for _, dt in taken])
    rows = problem.observation.near
    near = near_stops(run.records, rows) if rows else np.zeros(run.status.size, dtype=np.bool_)
    own = {"failed": run.failed, "last": last, "last_term": run.last_term, "near": near}
    return Solution(y, run.records, run.status, steps, dt, **own)


def _steps_taken(times: Floats, dt: Floats, n: int) -> tuple[Integers, Floats]:
    """Steps of n trajectories, none longer than ``dt`` [s] of all or of each; number and longest of each."""
    lengths = np.unique(dt) if dt.ndim else dt[None]
    numbers = [output_steps(times, float(length)) for length in lengths]
    total = np.array([number.sum() for number in numbers], dtype=np.int64)
    longest = np.array([np.max(np.diff(times) / np.maximum(number, 1)) for number in numbers])
    if not dt.ndim:
        return np.full(n, total[0]), np.full(n, longest[0])
    of = np.searchsorted(lengths, dt)  # in these few it is quicker than their inverse
    return total[of], longest[of]


#: Steps between outputs, on average, from which on steps end at the outputs. With fewer, two runs with steps
#: that differ by sqrt(2) could have the same ones: 2.13 are enough for one step more.
STEPS_BETWEEN = 2.2

#: Numbers that are interpolated at once: they stay in the cache.
AT_ONCE = 1 << 15


def solve_at(case: Case, settings: Settings, progress: Progress | None = None) -> Solution:
    """Integrate from t = 0; states are interpolated where output times [s] are closer than steps.

    Not so where steps must end at them, or are shorter at first than later.
    """
    problem, starts, outputs, threads = case
    until = float(outputs[-1])
    few = outputs.size * STEPS_BETWEEN * np.asarray(settings.dt) <= until
    if case.steps_end or settings.early or until == 0.0 or np.all(few):
        return _divided(case, settings, progress)
    steps: Any = np.broadcast_to(np.asarray(settings.dt, dtype=np.float64), len(starts))
    if settings.fit and problem.bounds is not None:
        fitted = fit_steps(problem.bounds, starts, 1.0, until, EXPONENT_ONCE, threads=threads)
        steps = steps * fitted.shares

    def run(part: Case, dt: float) -> Solution:
        run_by = solve if outputs.size * STEPS_BETWEEN * dt <= until else _interpolated
        return run_by(part, replace(settings, dt=dt, fit=()), progress)

    return _each_step(case, steps, run)


def _each_step(case: Case, steps: Floats, run: Callable[[Case, float], Solution]) -> Solution:
    """The runs of those trajectories that have each of the steps (n,) [s], put together."""
    found = nothing(case.problem, case.outputs.size, *case.starts.shape)
    for dt in np.unique(steps):
        who = np.flatnonzero(steps == dt)
        if who.size == len(steps):
            return run(case, float(dt))
        put_into(found, who, run(case.part(who), float(dt)))
    return found


def are_short(outputs: Floats, shortest: float) -> Flags:
    """Which intervals before outputs, that are intervals at all, are shorter than ``shortest`` [s]."""
    intervals = np.diff(outputs, prepend=0.0)
    return np.asarray((intervals > 0.0) & (intervals < shortest))


def divided(outputs: Floats, dt: float, shortest: float) -> tuple[Floats, Integers]:
    """Output times [s] with others between them, and which of these they are.

    Intervals that are shorter than ``shortest`` [s] are divided into as many equal ones as it has steps. So
    runs with other steps differ in each of them.
    """
    intervals = np.diff(outputs, prepend=0.0)
    parts = np.where(are_short(outputs, shortest), math.ceil(shortest / dt * (1.0 - 1e-12)), 1)
    last = np.cumsum(parts) - 1
    left = np.repeat(last, parts) - np.arange(last[-1] + 1)  # of the parts of an interval
    return np.repeat(outputs, parts) - np.repeat(intervals / parts, parts) * left, last


def _divided(case: Case, settings: Settings, progress: Progress | None) -> Solution:
    """A run whose steps end at the outputs, and divide the intervals between them that are short."""
    if not are_short(case.outputs, settings.shortest).any():
        return solve(case, settings, progress)

    def run(part: Case, dt: float) -> Solution:
        times, own = divided(case.outputs, dt, settings.shortest)
        found = solve(part._replace(outputs=times), replace(settings, dt=dt), progress)
        return replace(found, y=found.y[own])

    return _each_step(case, np.broadcast_to(settings.dt, len(case.starts)), run)


def _interpolated(case: Case, settings: Settings, progress: Progress | None) -> Solution:
    """The same with equal steps of all trajectories, over the whole run."""
    problem, starts, outputs, _ = case
    until, nodes = float(outputs[-1]), (settings.method.order + 5) // 2
    number = max(math.ceil(until / float(settings.dt) * (1.0 - 1e-12)), nodes - 1)
    grid = until / number * np.arange(number + 1.0)
    grid[-1] = until
    run = solve(case._replace(outputs=grid), settings, progress)
    rates = _rates(problem, grid, run.y)
    first, values, slopes = _weights(outputs / until * number, number, nodes)
    y, begin, together = np.zeros((outputs.size, *starts.shape)), 0, max(1, AT_ONCE // max(1, starts.size))
    added = np.empty((together, *starts.shape))
    while begin < outputs.size:
        end = min(int(np.searchsorted(first, first[begin], "right")), begin + together)
        for k in range(nodes):
            # Not by a product of matrices, whose sums' order depends on how many trajectories there are.
            with np.errstate(invalid="ignore", over="ignore"):  # of motions that are not finite
                for weights, of in ((values, run.y), (until / number * slopes, rates)):
                    now = added[: end - begin]
                    np.multiply(weights[k, begin:end, None, None], of[first[begin] + k], out=now)
                    y[begin:end] += now
        begin = end
    return replace(run, y=y)


def _weights(places: Floats, last: int, nodes: int) -> tuple[Integers, Floats, Floats]:
    """Weights of values and slopes (nodes, m) at the nodes around places (m,) on the grid 0, ..., ``last``.

    The first of each place's nodes comes before them (m,).
    """
    first = np.clip(np.floor(places).astype(np.int64) - (nodes - 1) // 2, 0, last + 1 - nodes)
    x = places - first
    square, slope = np.ones((nodes, x.size)), np.zeros((nodes, 1))
    for i, j in permutations(range(nodes), 2):  # Lagrange's polynomials, and their slopes at their own nodes
        square[i] *= (x - j) / (i - j)
        slope[i] += 1.0 / (i - j)
    square *= square
    beside = x - np.arange(nodes)[:, None]
    return first, (1.0 - 2.0 * beside * slope) * square, beside * square


def _rates(problem: Problem, times: Floats, y: Floats) -> Floats:
    """Derivatives of public states (times, n, dim)."""
    problem = problem.public
    rates, params = np.empty_like(y), problem.params.block(y.shape[1])
    into = np.empty((y.shape[2], y.shape[1]))
    for t, states, found in zip(times, y, rates, strict=True):
        problem.rhs(float(t), np.ascontiguousarray(states.T), into, params)
        found[...] = into.T
    return rates
