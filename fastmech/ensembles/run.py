"""Runs an ensemble: blocks of lanes, taken from a queue by threads that hold no interpreter lock.

A lane's result depends on nothing but its own start and parameters, so it is the same, bit for bit, for any
number of threads and any block size.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.ensembles.failing import last_finite
from fastmech.ensembles.spans import Span, spans
from fastmech.ensembles.status import Status
from fastmech.ensembles.stopping import STOP_CODE, STOP_STATE, STOP_TIME
from fastmech.ensembles.threads import thread_count
from fastmech.integrators.explicit import observe_nothing
from fastmech.integrators.method import Method

Floats = NDArray[np.float64]
Progress = Callable[[int], None]

#: Lanes a block: large enough that calls cost little, small enough that all stages stay in the caches.
BLOCK_LANES = 256

#: Blocks that one task holds where trajectories may stop: those still running move up into full blocks.
CHUNK_BLOCKS = 16

#: Steps a call: between calls an interrupt is heard, and where trajectories may stop they make room.
CALL_STEPS = 4096
CALL_STEPS_WITH_STOPS = 64


@dataclass(frozen=True)
class Observation:
    """An observer (see :data:`fastmech.jit.OBSERVER_SIGNATURE`), its parameters and its empty record.

    ``record`` holds the start value of every row of a lane's record. Where ``stops`` is set, the rows begin
    with those of :mod:`fastmech.ensembles.stopping`, and a lane whose code is not zero is taken out.
    """

    observe: Any
    params: Floats
    record: Floats
    stops: bool = False


NOTHING = Observation(observe_nothing, np.zeros(0), np.zeros(0))


@dataclass(frozen=True)
class Ensemble:
    """States at the output times (outputs, n, dim), records (rows, n) and :class:`Status` values (n,).

    A trajectory that fails has NaN from the next output on; ``failed`` (n,) is the time [s] of its last
    finite state, NaN for the others, and ``last`` (n, dim) the last finite state of every trajectory.
    """

    states: Floats
    records: Floats
    status: NDArray[np.int8]
    failed: Floats
    last: Floats


def run_ensemble(
    rhs: Any,
    params: ArrayLike,
    starts: ArrayLike,
    times: ArrayLike,
    dt: float,
    method: Method,
    observation: Observation = NOTHING,
    *,
    threads: int | None = None,
    block_lanes: int = BLOCK_LANES,
    progress: Progress | None = None,
) -> Ensemble:
    """Integrate ``starts`` (n, dim) from ``times[0]`` through ``times[1:]`` [s].

    ``params`` are the parameters of all trajectories (count,) or of each (n, count). A trajectory that has
    stopped keeps the state in which it did. ``progress`` is told the number of trajectories finished since
    its last call.

    Raises:
        InputError: the step, the times or the number of threads are wrong.
    """
    begin = np.asarray(starts, dtype=np.float64)
    clock = np.asarray(times, dtype=np.float64)
    own = np.asarray(params, dtype=np.float64)
    own = np.broadcast_to(own, (len(begin), own.shape[-1]))
    workers = thread_count(threads)
    # Small ensembles are shared among the threads too, in whole vectors.
    width = max(1, min(block_lanes, -(-len(begin) // (8 * workers)) * 8))
    chunk = width * CHUNK_BLOCKS if observation.stops else width
    most = CALL_STEPS_WITH_STOPS * (1 + method.start_steps) if observation.stops else CALL_STEPS
    way = list(spans(clock, dt, most))
    ensemble = Ensemble(
        states=np.empty((clock.size - 1, *begin.shape)),
        records=np.empty((observation.record.size, len(begin))),
        status=np.full(len(begin), Status.OK, dtype=np.int8),
        failed=np.full(len(begin), np.nan),
        last=begin.copy(),
    )
    interrupted = threading.Event()

    def run_chunk(first: int) -> int:
        members = np.arange(first, min(first + chunk, len(begin)))
        record = np.repeat(observation.record[:, None], members.size, axis=1)
        lanes = _Lanes(members, begin[members].T.copy(), own[members].T.copy(), record)
        for span in way:
            if interrupted.is_set() or not lanes.members.size:
                break
            begun = lanes.Y
            lanes.Y = begun.copy()
            reached, failed = _advance(rhs, observation, method, lanes, span, width)
            _find_failures(rhs, method, ensemble, lanes, span, begun, failed, observation.stops)
            _store(ensemble, lanes, span, reached, failed, observation.stops)
        ensemble.last[lanes.members] = lanes.Y.T
        return members.size

    with ThreadPoolExecutor(workers) as pool:
        try:
            for finished in pool.map(run_chunk, range(0, len(begin), chunk)):
                if progress is not None:
                    progress(finished)
        except BaseException:  # Ctrl-C too: blocks in hand end with their call, the others never begin
            interrupted.set()
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return ensemble


@dataclass
class _Lanes:
    """The trajectories of one task that still run: who they are, states, parameters and records."""

    members: NDArray[np.int64]
    Y: Floats
    params: Floats
    record: Floats

    def keep(self, which: NDArray[np.bool_]) -> None:
        self.members, self.Y = self.members[which], self.Y[:, which]
        self.params, self.record = self.params[:, which], self.record[:, which]


def _advance(
    rhs: Any, observation: Observation, method: Method, lanes: _Lanes, span: Span, width: int
) -> tuple[Floats, Floats]:
    """Take lanes through a span, block by block.

    Their states at its times, shape (pieces, dim, lanes), and when the method gave them up (lanes,), or NaN.
    """
    reached = np.empty((span.steps.size, *lanes.Y.shape))
    failed = np.full(lanes.members.size, np.nan)
    for first in range(0, lanes.members.size, width):
        part = slice(first, first + width)
        Y, params, record = (a[:, part].copy() for a in (lanes.Y, lanes.params, lanes.record))
        out = np.empty((span.steps.size, *Y.shape))
        given_up = method.run(
            rhs,
            observation.observe,
            span.times,
            span.steps,
            Y,
            params,
            observation.params,
            record,
            out,
        )
        lanes.Y[:, part], lanes.record[:, part], reached[:, :, part] = Y, record, out
        if given_up is not None:
            failed[part] = given_up
    return reached, failed


def _find_failures(
    rhs: Any,
    method: Method,
    ensemble: Ensemble,
    lanes: _Lanes,
    span: Span,
    begun: Floats,
    failed: Floats,
    stops: bool,
) -> None:
    """Complete ``failed`` (lanes,) by those that are not finite; note status, last state and its time."""
    running = ~_stopped(lanes) if stops else np.ones(lanes.members.size, dtype=bool)
    failed[~running] = np.nan
    given_up = ~np.isnan(failed)
    lost = running & ~given_up & ~np.isfinite(lanes.Y).all(axis=0)
    if lost.any():
        failed[lost], lanes.Y[:, lost] = last_finite(rhs, method, span, begun[:, lost], lanes.params[:, lost])
    ensemble.status[lanes.members[given_up]] = Status.NOT_CONVERGED
    ensemble.status[lanes.members[lost]] = Status.NOT_FINITE
    over = given_up | lost
    ensemble.failed[lanes.members[over]] = failed[over]
    ensemble.last[lanes.members[over]] = lanes.Y[:, over].T


def _store(
    ensemble: Ensemble, lanes: _Lanes, span: Span, reached: Floats, failed: Floats, stops: bool
) -> None:
    """Store what a span has brought; who has failed or stopped leaves and costs nothing any more."""
    ensemble.records[:, lanes.members] = lanes.record
    for piece, output in enumerate(span.outputs):
        if output >= 0:
            if stops:
                before = _stopped(lanes) & (lanes.record[STOP_TIME] <= span.times[piece + 1])
                reached[piece][:, before] = lanes.record[STOP_STATE:, before]
            reached[piece][:, failed < span.times[piece + 1]] = np.nan
            ensemble.states[output, lanes.members] = reached[piece].T
    gone = ~np.isnan(failed)
    ensemble.states[span.passed :, lanes.members[gone]] = np.nan
    if stops:
        stopped = _stopped(lanes)
        lanes.Y[:, stopped] = lanes.record[STOP_STATE:, stopped]
        ensemble.states[span.passed :, lanes.members[stopped]] = lanes.Y[:, stopped].T
        ensemble.last[lanes.members[stopped]] = lanes.Y[:, stopped].T
        gone |= stopped
    if gone.any():
        lanes.keep(~gone)


def _stopped(lanes: _Lanes) -> NDArray[np.bool_]:
    return np.asarray(lanes.record[STOP_CODE] != 0.0)
