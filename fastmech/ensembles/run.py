"""Runs an ensemble: blocks of lanes, taken from a queue by threads that hold no interpreter lock.

A lane's result depends on its own start and parameters alone: the same bits for any threads, tasks, calls and
blocks (some methods have blocks of one width).

Trajectories that have stopped or failed make room: the others of a task move up into full blocks, and a
task's end, when few are left, runs in narrow ones. New ones join with the next task, as lanes of a block
share their time: of the Lorenz case, of which 82 % stop on the way, 92 % of all lane steps are wanted ones.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Codes, Flags, Floats, Integers
from fastmech.ensembles.ends import STOP_CODE, STOP_STATE, STOP_TIME, Resumption
from fastmech.ensembles.lanes import (
    Lanes,
    Parameters,
    Span,
    Task,
    block_width,
    finite_rows,
    rows_at,
    task_lanes,
    tasks_of,
    way,
)
from fastmech.ensembles.status import Status
from fastmech.ensembles.threads import in_threads, thread_count
from fastmech.integrators.explicit import Batch, observe_nothing
from fastmech.integrators.methods import Adams, Explicit, Method
from fastmech.interrupts import check
from fastmech.jit import in_precision, observer_signature
from fastmech.kernels.blocks import VECTOR_LANES

Progress = Callable[[int], None]

#: Steps a call at most: between calls an interrupt is heard, and who has stopped or failed makes room. Most
#: failures are early ones, so calls grow: the first has so many right-hand sides of lanes (but a step counts
#: as four at least, and a lane as so many), the others as many steps as went before.
CALL_STEPS, CALL_STEPS_WITH_STOPS = 2048, 64
CALL_EVALUATIONS, STEP_EVALUATIONS, LANE_EVALUATIONS = 2**21, 4, 1024

#: Rates of single states that one thread has before others are started: a fraction of a millisecond, or some.
ALONE = 2**20

#: Blocks of an explicit method that an observer looks at together: what a look costs beside its lanes is
#: shared, and the processor works on some while others wait for a result.
SEEN_TOGETHER = 8


@dataclass(frozen=True)
class Observation:
    """An observer (see :data:`fastmech.jit.OBSERVER_SIGNATURE`), its parameters and its empty record.

    ``record`` holds the start value of every row of a lane's record. Where ``stops`` is set, the rows begin
    with those of :mod:`fastmech.ensembles.ends` (its own may follow), and a lane whose code is not zero
    is taken out after about ``call_steps`` steps. With ``locate`` a stop is looked for inside the step after
    which it was seen. The last rows begin as so many of a lane's first states as ``states`` says,
    or, where ``parameters`` is set, as the lane's parameters: they are NaN in ``record``.
    """

    observe: Any
    params: Floats
    record: Floats
    stops: bool = False
    call_steps: int = CALL_STEPS_WITH_STOPS
    locate: bool = False
    near: range = range(0)  #: rows that tell who may have stopped between looks, see :func:`near_stops`
    states: int = 0
    parameters: bool = False

    def empty(self, begin: Floats, params: Floats) -> Floats:
        """The record of all lanes (rows,), or of each (n, rows) where it knows their states (n, dim) or
        parameters (count,) or (n, count).
        """
        if not (self.states or self.parameters):
            return self.record
        each = np.tile(self.record, (len(begin), 1))
        if self.states:
            each[:, -self.states :] = begin[:, : self.states]
        if self.parameters:
            each[:, -params.shape[-1] :] = params
        return each


NOTHING = Observation(observe_nothing, np.zeros(0), np.zeros(0))


@dataclass(frozen=True)
class Ensemble:
    """States at the output times (outputs, n, dim), records (rows, n) and :class:`Status` values (n,).

    A trajectory that fails has NaN from the next output on; ``failed`` (n,) is the time [s] of its last
    finite state, NaN for the others. One whose start is not finite has that as its last state.
    """

    states: Floats
    records: Floats
    status: Codes
    failed: Floats
    #: Greatest last term of an Adams method's predictor in an angle [rad], or in any state of a system of
    #: one's own, see :mod:`fastmech.kernels.steps`, shape (n,); of other methods empty.
    last_term: Floats
    #: Members that failed together, and their last finite states.
    lost: list[tuple[Integers, Floats]]

    @property
    def last(self) -> Floats:
        """Last finite states, shape (n, dim)."""
        last = self.states[-1].copy()
        for members, states in self.lost:
            last[members] = states
        return last


def run_ensemble(
    rhs: Any,
    params: ArrayLike | Parameters,
    starts: ArrayLike,
    times: ArrayLike,
    dt: float | Floats,
    method: Method,
    observation: Observation = NOTHING,
    *,
    threads: int | None = None,
    block_lanes: int | None = None,
    precision: type[np.floating[Any]] = np.float64,
    progress: Progress | None = None,
) -> Ensemble:
    """Integrate ``starts`` (n, dim) from ``times[0]`` through ``times[1:]`` [s].

    ``params`` are the parameters of all trajectories (count,) or of each (n, count); ``dt`` is the longest
    step of all trajectories or of each (n,). A trajectory that has stopped keeps the state in which it did.
    ``progress`` is told the number of trajectories finished since its last call. ``block_lanes`` is
    :func:`block_width` by default, and always so of a method that has a width; 1 where a right-hand side
    takes arrays.
    """
    begin = np.asarray(starts, dtype=np.float64)
    clock = np.asarray(times, dtype=np.float64)
    own = Parameters.of(params)
    workers = thread_count(threads)
    cost = max(STEP_EVALUATIONS, method.evaluations(CALL_STEPS) / CALL_STEPS)
    with np.errstate(divide="ignore"):
        steps = np.fmax(clock.size, (clock[-1] - clock[0]) / np.broadcast_to(dt, len(begin))).sum()
    if cost * steps * begin.shape[1] < ALONE:
        workers = 1
    ensemble = Ensemble(
        states=np.empty((clock.size - 1, *begin.shape)),
        records=np.repeat(observation.record[:, None], len(begin), axis=1),
        status=np.full(len(begin), Status.OK, dtype=np.int8),
        failed=np.full(len(begin), np.nan),
        last_term=np.zeros(len(begin) if isinstance(method, Adams) else 0),
        lost=[],
    )
    interrupted = threading.Event()
    observe = in_precision(observation.observe, np.dtype(precision).name, observer_signature)
    with np.errstate(over="ignore"):  # what is too large is set aside
        begin = begin.astype(precision, copy=False)
    usable = finite_rows(begin)
    if getattr(getattr(rhs, "rates", None), "vector", False):
        block_lanes = 1
    elif block_lanes is None or method.lanes:
        block_lanes = block_width(method, begin.shape[1], precision)
    else:
        block_lanes = max(block_lanes, VECTOR_LANES)

    def most_steps(lanes: Lanes, passed: int) -> int:
        if observation.stops:
            return observation.call_steps
        evaluations = max(LANE_EVALUATIONS, CALL_EVALUATIONS // lanes.members.size)
        return min(CALL_STEPS, max(passed, int(evaluations / cost)))

    def run_task(task: Task) -> int:
        members, piece, passed = task.members, 0, 0
        states, params = rows_at(begin, members), own.at(members, precision)
        lanes = Lanes(
            members,
            states,
            params,
            observation.empty(states, params),
            block_lanes=block_lanes,
            carried=method.carried,
            together=SEEN_TOGETHER if block_lanes == method.lanes else 1,
        )
        while piece < task.way.steps.size and lanes.members.size and not interrupted.is_set():
            check()
            span = task.way.span(piece, most_steps(lanes, passed))
            before = Resumption(lanes, rhs, method, span)
            batch = lanes.batch(span, observation.params)
            given_up = method.run(rhs, observe, batch)
            piece, passed = piece + span.steps.size, passed + int(span.steps.sum())
            ended = _ended(lanes, batch, given_up, observation)
            if ended is not None:
                if observation.locate and ended.stopped.any():
                    which = np.flatnonzero(ended.stopped)
                    block, lane = np.divmod(which, batch.record.shape[2])
                    seen = batch.record[block, :, lane]
                    batch.record[block, :, lane] = before.locate_stops(observation, which, seen)
                ensemble.status[lanes.members[~np.isnan(ended.failed)]] = Status.NOT_CONVERGED
                ensemble.status[lanes.members[ended.lost]] = Status.NOT_FINITE
                if ended.lost.size:
                    found = before.last_finite(batch.out, ended.lost)
                    ended.failed[ended.lost], ended.now[ended.lost] = found
            _store(ensemble, lanes, span, batch, ended)
        if isinstance(method, Adams) and lanes.members.size:
            ensemble.last_term[lanes.members] = lanes.rows(lanes.memory)[:, -begin.shape[1]]
        return members.size

    _set_aside(ensemble, np.flatnonzero(~usable), np.asarray(starts, dtype=np.float64), clock[0])
    most = max(block_lanes, task_lanes(method, begin.shape[1]))
    tasks = tasks_of(np.asarray(dt), usable, clock, workers, most)
    finishing = in_threads(run_task, tasks, min(workers, len(tasks)), interrupted)
    for finished in chain([int(np.count_nonzero(~usable))], finishing):
        if progress is not None:
            progress(finished)
    return ensemble


class Sample:
    """A few trajectories that run again and again with other methods and steps: lanes are laid out once.

    Their bits are those of :func:`run_ensemble`; nobody is told who fails, when, or how steps went by.
    """

    def __init__(self, rhs: Any, params: Parameters, starts: Floats) -> None:
        """From integrated states (n, dim), finite ones."""
        self._rhs, n = rhs, len(starts)
        self._lanes = Lanes(
            np.arange(n), starts, params.at(np.arange(n)), np.zeros(0), VECTOR_LANES, carried=0
        )

    def run(self, method: Explicit, times: Floats, dt: float) -> Floats | None:
        """States at ``times[1:]``, shape (outputs, n, dim); None: so many steps are no small run."""
        passed, lanes = way(times, dt), self._lanes
        if passed.steps.sum() > CALL_STEPS:
            return None
        batch = lanes.batch(passed, np.zeros(0))._replace(Y=lanes.Y.copy(), memory=None, phase=None)
        method.run(self._rhs, observe_nothing, batch)
        found = batch.out[:, passed.outputs >= 0].transpose(1, 0, 3, 2)
        return found.reshape(times.size - 1, -1, lanes.Y.shape[1])[:, : lanes.members.size]


def _set_aside(ensemble: Ensemble, members: Integers, begin: Floats, start: float) -> None:
    """Trajectories whose starts are not finite never enter a block."""
    if members.size:
        ensemble.states[:, members] = np.nan
        ensemble.status[members] = Status.START_NOT_FINITE
        ensemble.failed[members] = start
        ensemble.lost.append((members, begin[members]))


@dataclass(frozen=True)
class _Ended:
    """Trajectories of a task that ended in a call."""

    stopped: Flags
    failed: Floats  #: time [s] of the last state of those that failed, NaN for the others
    lost: Integers  #: places of those that are not finite now, of which no time is known yet
    now: Floats  #: states of all (n, dim)


def _ended(lanes: Lanes, batch: Batch, given_up: Floats | None, observation: Observation) -> _Ended | None:
    """Who has stopped or failed, nobody as a rule."""
    healthy = (given_up is None or bool(np.isnan(given_up).all())) and bool(np.isfinite(batch.Y).all())
    if healthy and not observation.stops:
        return None
    n = lanes.members.size
    stopped = np.zeros(n, dtype=np.bool_)
    failed = np.full(n, np.nan) if given_up is None else given_up.reshape(-1)[:n].copy()
    if observation.stops:
        code, time = (batch.record[:, row].reshape(-1)[:n] for row in (STOP_CODE, STOP_TIME))
        # A lane that has been given up waits for the call's end: what is seen of it meanwhile is no stop.
        waiting = time > failed
        block, lane = np.divmod(np.flatnonzero(waiting), batch.record.shape[2])
        fresh = np.flatnonzero(~np.isnan(observation.record))
        batch.record[block[:, None], fresh, lane[:, None]] = observation.record[fresh]
        stopped = np.asarray((code != 0.0) & ~waiting)
        if healthy and not stopped.any():
            return None
    failed[stopped] = np.nan
    now = lanes.rows(batch.Y).copy()
    lost = np.flatnonzero(np.isnan(failed) & ~stopped & ~finite_rows(now))
    return _Ended(stopped, failed, lost, now)


def _store(ensemble: Ensemble, lanes: Lanes, span: Span, batch: Batch, ended: _Ended | None) -> None:
    """Store what a span has brought; who has failed or stopped leaves and costs nothing any more."""
    members = lanes.members
    if batch.record.size:
        ensemble.records[:, members] = lanes.rows(batch.record).T
    for piece in np.flatnonzero(span.outputs >= 0):
        lanes.put(batch.out[:, piece], ensemble.states[span.outputs[piece]])
    if ended is None:
        return
    stopped, failed, over = ended.stopped, ended.failed, ~np.isnan(ended.failed)
    for piece in np.flatnonzero(span.outputs >= 0):
        ensemble.states[span.outputs[piece], members[failed < span.times[piece + 1]]] = np.nan
    ensemble.states[span.passed :, members[over]] = np.nan
    if over.any():
        ensemble.failed[members[over]] = failed[over]
        ensemble.lost.append((members[over], ended.now[over]))
    if stopped.any():
        record = lanes.rows(batch.record)[stopped]
        state = record[:, STOP_STATE : STOP_STATE + ended.now.shape[1]]
        for piece in np.flatnonzero(span.outputs >= 0):
            before = record[:, STOP_TIME] <= span.times[piece + 1]
            ensemble.states[span.outputs[piece], members[stopped][before]] = state[before]
        ensemble.states[span.passed :, members[stopped]] = state
    if (stopped.any() or over.any()) and span.passed < len(ensemble.states):
        lanes.keep(~(stopped | over), at_once=bool(over.any()))
