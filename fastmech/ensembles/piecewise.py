"""A tolerance for systems whose right-hand sides have branches.

Every trajectory runs twice, alone, with steps that end where branches are passed, the second time with
smaller errors of its steps. Where the two are apart by no more than the tolerance the second is kept. Their
distance is nearly the error of the first, and a share of it that of the second. Else a third is compared
with the second, and so on. What is not settled so has no error that is known.

Between two switches a motion is smooth, and a method keeps its order there; so no step may pass a switch.
Steps are those of Dormand and Prince with control of their error (Hairer, Norsett, Wanner, *Solving ODEs
I*, sections II.4 and II.5). A step at whose end other decisions are taken than at its begin
(:mod:`fastmech.ensembles.switches`) is shortened until the switch is known to rounding (section II.6).
Where a decision may have turned over and back inside a step, because its value comes nearer to zero and
goes away again so fast that the tangents of both ends meet beyond it, the step ends there: a branch however
narrow is not stepped over. (A value that is far from zero and flat at both ends, and not between them,
deceives the tangents, as a narrow pulse deceives any steps.)
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types

from fastmech.arrays import Floats, Integers
from fastmech.callee import callee
from fastmech.ensembles.ends import STOP_CODE, STOP_TIME
from fastmech.ensembles.lanes import finite_rows
from fastmech.ensembles.problem import Case
from fastmech.ensembles.run import Progress
from fastmech.ensembles.solve import Settings, Solution, distances, nothing, part_of, put_into, solve
from fastmech.ensembles.status import missed_line
from fastmech.ensembles.switches import MOST_NOTES, SWITCHES
from fastmech.ensembles.threads import in_parts
from fastmech.integrators.methods import find_method
from fastmech.jit import CUBE, INTEGERS, MATRIX, OBSERVER, RHS, VECTOR, inlined, kernel, named_tuple

#: What becomes of a trajectory.
ENDED, SLIDES, GRAZES, COSTS, SINGULAR, UNCLEAR = range(6)

_PAIR: Any = find_method("dopri5")
ORDER = _PAIR.order
_A = np.pad(_PAIR.tableau.matrix, (0, 1))
_A[6, :6] = _PAIR.tableau.b
_C = np.append(_PAIR.tableau.c, 1.0)

#: Weights of the error, over all seven stages: those of order 5 less those of order 4.
_E = np.array([71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])

#: A switch is known to this part of the longest step; so many in a row, each less than that part of it after
#: the last one, slide along a border.
RESOLUTION, SHORT, SLIDING = 1e-12, 1e-4, 32

#: A border is located again where a step that should cross it is longer than that, but not more often: then
#: rounding of the value decides.
AGAIN = 8

#: A switch inside a step whose error is too large is known to this part of it.
COARSE = 0.01

#: A slope is told by this part of a step; steps in which a decision may turn over and back are not refined
#: below this part of the longest.
SLOPE, FINEST = 1e-5, 1e-11

#: Rounding of a state in its local error.
ROUNDED = 1e-14


class Course(NamedTuple):
    """Trajectories (n) that run, and where what they bring is put."""

    starts: Floats  #: (n, dim)
    params: Floats  #: (n, count)
    outputs: Floats  #: times [s]
    observer_params: Floats
    limits: Floats  #: longest step [s], most steps, error of a step
    y: Floats  #: (outputs, n, dim)
    records: Floats  #: of no stop, then those of the ends (n, rows)
    told: Floats  #: steps tried, and the longest taken [s] (n, 2)
    ended: Integers  #: what became of each (n,)


COURSE = named_tuple([MATRIX, MATRIX, VECTOR, VECTOR, VECTOR, CUBE, MATRIX, MATRIX, INTEGERS], Course)


class PieceWork(NamedTuple):
    """Memory of one trajectory."""

    y: Floats  #: state (dim,)
    trial: Floats  #: state after the step tried (dim,)
    near: Floats  #: a state beside one of them (dim,)
    seen: Floats  #: states of the stages (7, dim)
    stages: Floats  #: rates (7, dim)
    p: Floats  #: parameters (count,)
    notes: Floats  #: decisions and their slopes, by the rows below
    local: float  #: error of a step


#: Rows of notes: decisions at a step's begin and at its end, how fast their values change there, and those
#: that are remembered.
BEFORE, AFTER, SLOPES, AFTER_SLOPES, AT = range(5)


@inlined
def _step(rhs: Any, t: float, h: float, w: Any) -> float:
    """Step from ``w.y`` to ``w.trial``; the first stage is there. The error over the one allowed."""
    dim = w.y.size
    for stage in range(1, 7):
        for d in range(dim):
            total = 0.0
            for k in range(stage):
                total += _A[stage, k] * w.stages[k, d]
            w.trial[d] = w.seen[stage, d] = w.y[d] + h * total
        _rates(rhs, t + _C[stage] * h, w.trial, w, stage)
    worst = 0.0
    for d in range(dim):
        total = 0.0
        for k in range(7):
            total += _E[k] * w.stages[k, d]
        error = abs(h * total) / (w.local + ROUNDED * abs(w.trial[d]))
        if not error <= worst:
            worst = error
        if not np.isfinite(w.trial[d]):
            return np.inf
    return worst if np.isfinite(worst) else np.inf


@inlined
def _rates(rhs: Any, t: float, y: Floats, w: Any, row: int) -> None:
    """Rates of a state into a stage."""
    block = (y.size, 1)
    rhs(t, y.reshape(block), w.stages[row].reshape(block), w.p.reshape((w.p.size, 1)))


@inlined
def _decisions(w: Any, row: int) -> int:
    """How many are noted."""
    return min(int(w.notes[row, 0]), MOST_NOTES)


@inlined
def _remember(w: Any, row: int, into: int) -> None:
    """Copy notes."""
    for k in range(w.notes.shape[1]):
        w.notes[into, k] = w.notes[row, k]


@inlined
def _turned(w: Any, a: int, b: int) -> int:
    """Place of the value of the first decision that is another one; 0: all are the same."""
    for k in range(min(_decisions(w, a), _decisions(w, b))):
        if w.notes[a, 2 + 2 * k] != w.notes[b, 2 + 2 * k]:
            return 1 + 2 * k
    return 0


@inlined
def _left(switches: Any, t: float, h: float, w: Any) -> int:
    """The same for a step and all its stages: else it would be of neither side."""
    turned = 0
    for stage in range(1, 7):
        if not turned:
            for d in range(w.y.size):
                w.near[d] = w.seen[stage, d]
            switches(t + _C[stage] * h, w.near, w.p, w.notes[AFTER])
            turned = _turned(w, BEFORE, AFTER)
    return turned


@inlined
def _slopes(switches: Any, t: float, dt: float, w: Any, row: int) -> None:
    """How fast the values of decisions ``row`` change at ``t``, after it or else before; 0: not known."""
    stage, slopes = 6 if row == AFTER else 0, row + SLOPES
    for sign in (1.0, -1.0):
        for d in range(w.y.size):
            w.near[d] = w.trial[d] + sign * dt * w.stages[stage, d]
        switches(t + sign * dt, w.near, w.p, w.notes[slopes])
        told = not _turned(w, row, slopes)
        for k in range(1, 1 + 2 * _decisions(w, row), 2):
            w.notes[slopes, k] = (w.notes[slopes, k] - w.notes[row, k]) / (sign * dt) if told else 0.0
        if told:
            return


@inlined
def _meet(w: Any, h: float) -> float:
    """Where in a step of length ``h`` a decision may have turned over and back; 0: nowhere."""
    for k in range(1, 1 + 2 * _decisions(w, BEFORE), 2):
        first, last = w.notes[BEFORE, k], w.notes[AFTER, k]
        if first * last >= 0.0:  # a step may begin on the very edge
            sign = 1.0 if first + last > 0.0 else -1.0
            down, up = sign * w.notes[SLOPES, k], sign * w.notes[AFTER_SLOPES, k]
            if down < 0.0 < up:
                at = (sign * (first - last) + up * h) / (up - down)
                if 0.0 < at < h and sign * first + down * at <= 0.0:
                    return at
    return 0.0


@inlined
def _switch(rhs: Any, switches: Any, t: float, w: Any, within: tuple[float, float]) -> tuple[float, float]:
    """Lengths of two steps to both sides of a switch, which the second one passes.

    ``within`` are the length of a step that passes it, and how near to each other both ends must be.
    """
    low, number, (high, resolution) = 0.0, 0, within
    _remember(w, BEFORE, AT)
    first = _turned(w, BEFORE, AFTER)
    below, above = w.notes[BEFORE, first], w.notes[AFTER, first]
    while high - low > resolution:
        # Where the straight line between both values is zero, and a little beyond: both ends must come near.
        share = below / (below - above) if below * above <= 0.0 and below != above else 0.5
        share = 0.5 if number % 3 == 2 else share
        middle = low + share * (high - low)
        middle += 0.4 * resolution if share < 0.5 else -0.4 * resolution
        middle = min(max(middle, low + 0.4 * resolution), high - 0.4 * resolution)
        _step(rhs, t, middle, w)
        turned = _left(switches, t, middle, w)
        if turned:
            high, first = middle, turned
            below, above = w.notes[AT, first], w.notes[AFTER, first]
        else:
            low, below = middle, w.notes[AFTER, first]
            _remember(w, AFTER, AT)
        number += 1
    return low, high


@inlined
def _look_at_start(observe: Any, course: Any, i: int, w: Any, record: Floats) -> None:
    """Let what stops after its first step do so at its start, if the condition holds there too."""
    if record[STOP_TIME, 0] > COARSE * course.limits[0]:
        return
    code, record[STOP_CODE, 0] = record[STOP_CODE, 0], 0.0
    for d in range(w.y.size):
        w.trial[d], w.y[d] = w.y[d], course.starts[i, d]
    observe(0.0, w.y.reshape((w.y.size, 1)), course.observer_params, record)
    if record[STOP_CODE, 0] == 0.0:
        record[STOP_CODE, 0] = code
        for d in range(w.y.size):
            w.y[d] = w.trial[d]


@kernel(types.void(RHS, SWITCHES, OBSERVER, COURSE, types.int64, types.int64))
def follow(rhs: Any, switches: Any, observe: Any, course: Any, first: int, last: int) -> None:
    """Trajectories of a course from ``first`` on, before ``last``; what one has not reached is NaN."""
    for i in range(first, last):
        dim, longest = course.starts.shape[1], course.limits[0]
        w = PieceWork(
            y=np.empty(dim),
            trial=np.empty(dim),
            near=np.empty(dim),
            seen=np.empty((7, dim)),
            stages=np.empty((7, dim)),
            p=course.params[i],
            notes=np.zeros((5, 1 + 2 * MOST_NOTES)),
            local=course.limits[2],
        )
        record = np.empty((course.records.shape[1], 1))
        for d in range(dim):
            w.y[d] = w.trial[d] = course.starts[i, d]
            for o in range(course.outputs.size):
                course.y[o, i, d] = np.nan
        for k in range(record.shape[0]):
            record[k, 0] = course.records[i, k]
        t, h, cross, switch = 0.0, COARSE * longest, 0.0, -longest
        steps, short, again, o, ended = 0, 0, 0, 0, ENDED
        _rates(rhs, t, w.y, w, 0)
        switches(t, w.y, w.p, w.notes[BEFORE])
        _slopes(switches, t, SLOPE * h, w, BEFORE)
        while True:
            while o < course.outputs.size and t >= course.outputs[o]:
                for d in range(dim):
                    course.y[o, i, d] = w.y[d]
                o += 1
            if o == course.outputs.size:
                break
            end = course.outputs[o]
            steps += 1
            if steps > course.limits[1] or w.notes[BEFORE, 0] > MOST_NOTES:
                ended = COSTS if w.notes[BEFORE, 0] <= MOST_NOTES else UNCLEAR
                break
            tried = cross if cross > 0.0 else (h if t + h < end else end - t)
            crossing, cross, resolution = cross > 0.0, 0.0, max(RESOLUTION * longest, 1e-15 * abs(end))
            error = _step(rhs, t, tried, w)
            switched = error < np.inf and _left(switches, t, tried, w) > 0
            if crossing and not switched and tried < SHORT * longest:
                cross = 2.0 * tried  # the value is known less well than the time
                continue
            again = again + 1 if crossing else 0
            if switched and tried > resolution and again <= AGAIN:
                near = resolution if error <= 1.0 else max(resolution, COARSE * tried)
                low, high = _switch(rhs, switches, t, w, (tried, near))
                if near == resolution or low > 0.0:
                    # The last point of this piece, and then the first one of the next.
                    cross = high - low if near == resolution and low > resolution else 0.0
                    switched = near == resolution and low <= resolution
                    tried = high if switched else low
                    error = _step(rhs, t, tried, w)
                    switches(t + tried, w.trial, w.p, w.notes[AFTER])
            if error > 1.0:
                h, cross = tried * (0.1 if error == np.inf else max(0.2, 0.9 * error**-0.2)), 0.0
                if h < 0.01 * resolution:
                    ended = SINGULAR
                    break
                continue
            if not switched:
                _slopes(switches, t + tried, max(SLOPE * tried, resolution), w, AFTER)
                turn = _meet(w, tried)
                if turn > 0.0:
                    if tried < FINEST * longest:
                        ended = SLIDES if short else GRAZES
                        break
                    h, cross = min(max(turn, 0.1 * tried), 0.9 * tried), 0.0
                    continue
            grown = tried * min(5.0, 0.9 * max(error, 1e-10) ** -0.2)
            h = min(longest, max(grown, h) if tried < h else grown)
            t = end if t + tried >= end else t + tried
            course.told[i, 1] = max(course.told[i, 1], tried)
            for d in range(dim):
                w.y[d], w.stages[0, d] = w.trial[d], w.stages[6, d]
            _remember(w, AFTER, BEFORE)
            _remember(w, AFTER_SLOPES, SLOPES)
            if switched:
                switches(t, w.y, w.p, w.notes[BEFORE])
                _slopes(switches, t, SLOPE * h, w, BEFORE)
                short = short + 1 if t < switch + SHORT * longest else 0
                switch = t
                if short > SLIDING:
                    ended = SLIDES
                    break
            if record.shape[0]:
                observe(t, w.y.reshape((dim, 1)), course.observer_params, record)
                if record[STOP_CODE, 0] != 0.0:
                    _look_at_start(observe, course, i, w, record)
                    t = np.inf
        for k in range(record.shape[0]):
            course.records[i, k] = record[k, 0]
        course.told[i, 0], course.ended[i] = steps, ended


#: Error of a step in the first run over the tolerance, how many times smaller it is in the next one, the
#: least one over the starts' size, and runs at most.
FIRST, FINER, LEAST, RUNS = 0.01, 32.0, 1e-14, 5

#: Error of a run over its distance from the one before: twice what the order says.
SHARE = 2.0 / FINER

#: Steps of the first run at least. In the next one there are more, as its errors ask for: else two runs
#: could have the same steps.
FEW = 32.0

#: What steps where branches are located.
METHOD = "dopri5"

#: Steps that a trajectory may take: half a second of a core.
MOST = 2**17

#: Trajectories that a thread follows at a time.
TOGETHER = 8

#: Steps of a run, at least and at most, of trajectories that cannot be followed through their branches.
GIVEN_UP = (2.0**10, 2.0**17)

WHY = {
    ENDED: "finer runs stay apart (chaos, a start on a basin's border)",
    SLIDES: "slides along a branch's border, or passes it all the time",
    GRAZES: "touches a branch's border",
    COSTS: "shorter steps would cost too much",
    SINGULAR: "no step is short enough",
    UNCLEAR: "too many decisions in one call",
}


def follow_to_tolerance(
    case: Case, switches: Any, tol: float, progress: Progress | None
) -> tuple[Solution, Floats, str]:
    """The solution, errors (n,), infinite where none is known, and what is to be said about those.

    ``switches`` notes the decisions of the right-hand side, see :mod:`fastmech.ensembles.switches`.
    """
    problem, starts, outputs, _ = case
    n, usable = len(starts), finite_rows(starts)
    error, ended = np.full(n, np.inf), np.full(n, ENDED)
    last, best = None, nothing(problem, outputs.size, *starts.shape)
    who = np.flatnonzero(usable)
    if progress is not None:
        progress(n - who.size)
    for k in range(RUNS):
        local, longest = FIRST * tol / FINER**k, float(outputs[-1]) / (FEW * FINER ** (k / ORDER))
        limits = longest, max(local, LEAST * case.size)
        finer, ended[who] = _followed(case.part(who), switches, limits, progress)
        put_into(best, who, finer)
        open_ = ended[who] == ENDED
        if last is not None:
            apart = distances(last, finer)
            kept = open_ & (apart <= tol)
            error[who[kept]] = SHARE * apart[kept]
            open_ &= ~kept
        who, last, progress = who[open_], part_of(finer, open_), None
        if not who.size:
            break
    lost = np.flatnonzero(ended != ENDED)
    if lost.size or not usable.all():
        # What cannot be followed is integrated as if there were no branches.
        other = np.union1d(lost, np.flatnonzero(~usable))
        steps = np.exp2(np.ceil(np.log2(np.clip(best.steps[other], *GIVEN_UP))))
        settings = Settings(find_method(METHOD), float(outputs[-1]) / steps)
        given_up = solve(case.part(other), settings)
        put_into(best, other, given_up)
    missed = usable & np.isinf(error)
    return best, error, missed_line(missed, {why: missed & (ended == code) for code, why in WHY.items()})


def _followed(
    case: Case, switches: Any, limits: tuple[float, float], progress: Progress | None
) -> tuple[Solution, Integers]:
    """The trajectories with steps of at most a length [s] and an error, and what became of each."""
    problem, starts, outputs, threads = case
    starts = problem.inward(starts)
    n, seen = len(starts), problem.observation
    solution = nothing(problem, outputs.size, *starts.shape)
    params = np.ascontiguousarray(problem.params.block(n).T)
    course = Course(
        starts=np.ascontiguousarray(starts),
        params=params,
        outputs=outputs,
        observer_params=seen.params,
        limits=np.array([limits[0], MOST, limits[1]]),
        y=solution.y,
        records=np.array(np.broadcast_to(seen.empty(starts, params), (n, seen.record.size)), order="C"),
        told=np.zeros((n, 2)),
        ended=np.full(n, ENDED),
    )
    called = callee(problem.rhs), callee(switches), callee(seen.observe)

    def part(some: slice) -> None:
        follow(*called, course, some.start, some.stop)

    in_parts(part, n, threads, TOGETHER, progress)
    for output in solution.y if problem.canonical else ():
        output[:] = problem.outward(output)
    solution.records[...] = course.records.T
    solution.steps[...], solution.dt[0] = course.told.T
    return solution, course.ended
