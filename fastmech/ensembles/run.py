"""Runs an ensemble: blocks of lanes, taken from a queue by threads that hold no interpreter lock.

A lane's result depends on nothing but its own start and parameters, so it is the same, bit for bit, for any
number of threads and any block size.

Trajectories that have stopped or failed make room: the others of a task move up into full blocks, and a
task's end, when few are left, runs in narrow ones. New trajectories join with the next task, not in the
middle of one, because lanes of a block share their time. What lanes that have ended still cost is small: for
10,000 starts of the Lorenz case, of which 82 % stop at times all over the run, 92 % of all lane steps are
wanted ones, so a queue that refilled every lane at once could save 8 % at most, less the time of its copies.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.ensembles.failing import last_finite
from fastmech.ensembles.lanes import VECTOR_LANES, Lanes
from fastmech.ensembles.spans import Span, spans
from fastmech.ensembles.status import Status
from fastmech.ensembles.stopping import STOP_CODE, STOP_STATE, STOP_TIME
from fastmech.ensembles.threads import thread_count
from fastmech.integrators.batch import Batch
from fastmech.integrators.explicit import observe_nothing
from fastmech.integrators.method import Method
from fastmech.interrupts import check
from fastmech.kernels.single import in_single

Floats = NDArray[np.float64]
Progress = Callable[[int], None]

#: Lanes a block: at least as many as make calls cost little, at most as many as keep a block of all methods
#: in the caches.
BLOCK_LANES = (64, 256)

#: Bytes of a processor's first cache that a block may fill: all stages, state, their sum and parameters.
BLOCK_BYTES = 32768

#: Blocks that a task holds at most: one call runs them all, and where trajectories may stop, those still
#: running move up into full blocks.
TASK_BLOCKS = 32

#: Numbers that the output of one call holds at most.
CALL_OUTPUT = 2**21

#: Steps a call: between calls an interrupt is heard, and where trajectories may stop they make room.
CALL_STEPS = 2048
CALL_STEPS_WITH_STOPS = 64


@dataclass(frozen=True)
class Observation:
    """An observer (see :data:`fastmech.jit.OBSERVER_SIGNATURE`), its parameters and its empty record.

    ``record`` holds the start value of every row of a lane's record. Where ``stops`` is set, the rows begin
    with those of :mod:`fastmech.ensembles.stopping` (its own may follow), and a lane whose code is not zero
    is taken out after at most ``call_steps`` steps.
    """

    observe: Any
    params: Floats
    record: Floats
    stops: bool = False
    call_steps: int = CALL_STEPS_WITH_STOPS


NOTHING = Observation(observe_nothing, np.zeros(0), np.zeros(0))


@dataclass(frozen=True)
class Ensemble:
    """States at the output times (outputs, n, dim), records (rows, n) and :class:`Status` values (n,).

    A trajectory that fails has NaN from the next output on; ``failed`` (n,) is the time [s] of its last
    finite state, NaN for the others.
    """

    states: Floats
    records: Floats
    status: NDArray[np.int8]
    failed: Floats
    lost: list[
        tuple[NDArray[np.int64], Floats]
    ]  #: members that failed together, and their last finite states

    @property
    def last(self) -> Floats:
        """Last finite states, shape (n, dim)."""
        last = self.states[-1].copy()
        for members, states in self.lost:
            last[members] = states
        return last


def block_width(method: Method, dim: int, precision: type[np.floating[Any]] = np.float64) -> int:
    """Lanes of a block of ``dim`` states whose step stays in the first cache."""
    row = dim * np.dtype(precision).itemsize
    least, most = BLOCK_LANES
    return int(np.clip(BLOCK_BYTES // (row * (method.rows + 4)) // VECTOR_LANES * VECTOR_LANES, least, most))


def run_ensemble(
    rhs: Any,
    params: ArrayLike,
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
    ``progress`` is told the number of trajectories finished since its last call. In float32 nothing can be
    observed. ``block_lanes`` is :func:`block_width` by default.

    Raises:
        InputError: the step, the times or the number of threads are wrong.
    """
    begin = np.asarray(starts, dtype=np.float64)
    clock = np.asarray(times, dtype=np.float64)
    own = np.asarray(params, dtype=np.float64)
    own = np.broadcast_to(own, (len(begin), own.shape[-1]))
    workers = thread_count(threads)
    most = observation.call_steps * (1 + method.start_steps) if observation.stops else CALL_STEPS
    ensemble = Ensemble(
        states=np.empty((clock.size - 1, *begin.shape)),
        records=np.empty((observation.record.size, len(begin))),
        status=np.full(len(begin), Status.OK, dtype=np.int8),
        failed=np.full(len(begin), np.nan),
        lost=[],
    )
    interrupted = threading.Event()
    observe = observation.observe
    if precision is np.float32:
        rhs, observe = in_single(rhs), import_module("fastmech.integrators.single").observe_nothing
        begin, own = begin.astype(precision), own.astype(precision)

    if block_lanes is None:
        block_lanes = block_width(method, begin.shape[1], precision)

    def run_task(task: _Task) -> int:
        members = task.members
        lanes = Lanes(members, begin[members], own[members], observation.record, block_lanes)
        for span in task.way:
            check()
            if interrupted.is_set() or not lanes.members.size:
                break
            batch = lanes.batch(span, observation.params)
            begun = lanes.rows(lanes.Y).copy()
            given_up = method.run(rhs, observe, batch)
            now, failed = lanes.rows(batch.Y).copy(), np.full(lanes.members.size, np.nan)
            if given_up is not None:
                failed = given_up.reshape(-1)[: lanes.members.size].copy()
            stopped = _stopped(lanes, batch) if observation.stops else np.zeros(failed.size, dtype=np.bool_)
            failed[stopped] = np.nan
            lost = np.isnan(failed) & ~stopped & ~np.isfinite(now).all(axis=1)
            ensemble.status[lanes.members[~np.isnan(failed)]] = Status.NOT_CONVERGED
            ensemble.status[lanes.members[lost]] = Status.NOT_FINITE
            if lost.any():
                own_params = lanes.rows(lanes.params)[lost]
                failed[lost], now[lost] = last_finite(rhs, method, span, begun[lost], own_params)
            _store(ensemble, lanes, span, batch, now, failed, stopped)
        return members.size

    width = min(block_lanes, max(VECTOR_LANES, CALL_OUTPUT // (begin.shape[1] * clock.size)))
    tasks = list(_tasks(np.broadcast_to(dt, len(begin)), clock, most, workers, width * TASK_BLOCKS))
    for finished in _in_threads(run_task, tasks, min(workers, len(tasks)), interrupted):
        if progress is not None:
            progress(finished)
    return ensemble


@dataclass(frozen=True)
class _Task:
    """Trajectories of one step's length, and how they pass the output times."""

    members: NDArray[np.int64]
    way: list[Span]


def _tasks(dt: Floats, times: Floats, most: int, workers: int, lanes: int) -> Iterator[_Task]:
    """Trajectories sorted by their step, shared evenly among the workers in tasks of at most ``lanes``."""
    for step in np.unique(dt):
        members = np.flatnonzero(dt == step)
        way = list(spans(times, float(step), most))
        number = -(-members.size // (lanes * workers)) * workers
        size = -(-members.size // (number * VECTOR_LANES)) * VECTOR_LANES
        for first in range(0, members.size, size):
            yield _Task(members[first : first + size], way)


def _in_threads(
    work: Callable[[_Task], int], tasks: list[_Task], workers: int, interrupted: threading.Event
) -> Iterator[int]:
    """What ``work`` gives for each task; one worker is this thread itself, which costs nothing to start."""
    if workers <= 1:
        yield from map(work, tasks)
        return
    with ThreadPoolExecutor(workers) as pool:
        try:
            yield from pool.map(work, tasks)
        except BaseException:  # Ctrl-C too: calls in hand end, the other tasks never begin
            interrupted.set()
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _stopped(lanes: Lanes, batch: Batch) -> NDArray[np.bool_]:
    """Which trajectories have stopped."""
    return np.asarray(lanes.rows(batch.record)[:, STOP_CODE] != 0.0)


def _store(
    ensemble: Ensemble,
    lanes: Lanes,
    span: Span,
    batch: Batch,
    now: Floats,
    failed: Floats,
    stopped: NDArray[np.bool_],
) -> None:
    """Store what a span has brought; who has failed or stopped leaves and costs nothing any more."""
    record, members = lanes.rows(batch.record), lanes.members
    ensemble.records[:, members] = record.T
    stop_state = record[stopped, STOP_STATE : STOP_STATE + now.shape[1]]
    for piece, output in enumerate(span.outputs):
        if output >= 0:
            reached = lanes.rows(batch.out[:, piece])
            if stopped.any():
                before = record[stopped, STOP_TIME] <= span.times[piece + 1]
                reached[np.flatnonzero(stopped)[before]] = stop_state[before]
            reached[failed < span.times[piece + 1]] = np.nan
            ensemble.states[output, members] = reached
    over = ~np.isnan(failed)
    if stopped.any():
        ensemble.states[span.passed :, members[stopped]] = stop_state
    if over.any():
        ensemble.states[span.passed :, members[over]] = np.nan
        ensemble.failed[members[over]] = failed[over]
        ensemble.lost.append((members[over], now[over]))
    if stopped.any() or over.any():
        lanes.keep(~(stopped | over), at_once=bool(over.any()))
