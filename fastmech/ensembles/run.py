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
    with those of :mod:`fastmech.ensembles.stopping` (its own may follow), and a lane whose code
    is not zero is taken out after at most ``call_steps`` steps.
    """

    observe: Any
    params: Floats
    record: Floats
    stops: bool = False
    call_steps: int = CALL_STEPS_WITH_STOPS


NOTHING = Observation(observe_nothing, np.zeros(0), np.zeros(0))


@dataclass(frozen=True)
class Ensemble:
    """States at the output times (outputs, n, dim), records (rows, n) and :class:`Status` values (n,)."""

    states: Floats
    records: Floats
    status: NDArray[np.int8]


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
    most = observation.call_steps * (1 + method.start_steps) if observation.stops else CALL_STEPS
    way = list(spans(clock, dt, most))
    ensemble = Ensemble(
        states=np.empty((clock.size - 1, *begin.shape)),
        records=np.empty((observation.record.size, len(begin))),
        status=np.empty(len(begin), dtype=np.int8),
    )
    interrupted = threading.Event()

    def run_chunk(first: int) -> int:
        members = np.arange(first, min(first + chunk, len(begin)))
        record = np.repeat(observation.record[:, None], members.size, axis=1)
        lanes = _Lanes(members, begin[members].T.copy(), own[members].T.copy(), record)
        for span in way:
            if interrupted.is_set() or not lanes.members.size:
                break
            reached = _advance(rhs, observation, method, lanes, span, width)
            _store(ensemble, lanes, span, reached, observation.stops)
        finite = np.isfinite(ensemble.states[:, members]).all(axis=(0, 2))
        ensemble.status[members] = np.where(finite, Status.OK, Status.NOT_FINITE)
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

    @property
    def stop_state(self) -> Floats:
        """States at which lanes stopped, where they did."""
        return self.record[STOP_STATE : STOP_STATE + len(self.Y)]

    def keep(self, which: NDArray[np.bool_]) -> None:
        self.members, self.Y = self.members[which], self.Y[:, which]
        self.params, self.record = self.params[:, which], self.record[:, which]


def _advance(
    rhs: Any, observation: Observation, method: Method, lanes: _Lanes, span: Span, width: int
) -> Floats:
    """Take lanes through a span, block by block; their states at its times, shape (pieces, dim, lanes)."""
    reached = np.empty((span.steps.size, *lanes.Y.shape))
    for first in range(0, lanes.members.size, width):
        part = slice(first, first + width)
        Y, params, record = (a[:, part].copy() for a in (lanes.Y, lanes.params, lanes.record))
        out = np.empty((span.steps.size, *Y.shape))
        method.run(
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
    return reached


def _store(ensemble: Ensemble, lanes: _Lanes, span: Span, reached: Floats, stops: bool) -> None:
    """Store what a span has brought; who has stopped or is not finite any more leaves, if ``stops``."""
    ensemble.records[:, lanes.members] = lanes.record
    for piece, output in enumerate(span.outputs):
        if output >= 0:
            if stops:
                before = _stopped(lanes) & (lanes.record[STOP_TIME] <= span.times[piece + 1])
                reached[piece][:, before] = lanes.stop_state[:, before]
            ensemble.states[output, lanes.members] = reached[piece].T
    if stops:
        stopped = _stopped(lanes)
        lanes.Y[:, stopped] = lanes.stop_state[:, stopped]
        gone = stopped | ~np.isfinite(lanes.Y).all(axis=0)
        ensemble.states[span.passed :, lanes.members[gone]] = lanes.Y[:, gone].T
        lanes.keep(~gone)


def _stopped(lanes: _Lanes) -> NDArray[np.bool_]:
    return np.asarray(lanes.record[STOP_CODE] != 0.0)
