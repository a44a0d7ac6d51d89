"""Runs an ensemble: blocks of lanes, taken from a queue by threads that hold no interpreter lock.

A lane's result depends on nothing but its own start and parameters, so it is the same, bit for bit, for any
number of threads and any block size.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.status import Status
from fastmech.ensembles.threads import thread_count
from fastmech.integrators.explicit import integrate_block, observe_nothing
from fastmech.integrators.tableau import Tableau

Floats = NDArray[np.float64]

#: Lanes a block: large enough that calls cost little, small enough that all stages stay in the caches.
BLOCK_LANES = 256

#: Blocks that one task holds where trajectories may stop: those still running move up into full blocks.
CHUNK_BLOCKS = 16

#: Steps after which stopped trajectories make room.
SEGMENT_STEPS = 64

Progress = Callable[[int], None]


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
    """States at the output times (outputs, n, dim), records (rows, n) and :class:`Status` values (n,)."""

    states: Floats
    records: Floats
    status: NDArray[np.int8]


def output_steps(times: Floats, dt: float) -> NDArray[np.int64]:
    """Steps between output times: the fewest equal ones that are no longer than ``dt``."""
    # A quotient that is an integer but for rounding must not cost a step more.
    return np.ceil(np.diff(times) / dt * (1.0 - 1e-12)).astype(np.int64)


def run_ensemble(
    rhs: Any,
    params: Floats,
    starts: Floats,
    times: Floats,
    dt: float,
    tableau: Tableau,
    observation: Observation = NOTHING,
    *,
    threads: int | None = None,
    block_lanes: int = BLOCK_LANES,
    progress: Progress | None = None,
) -> Ensemble:
    """Integrate ``starts`` (n, dim) from ``times[0]`` through ``times[1:]``.

    ``params`` are the parameters of all trajectories (count,) or of each (n, count). A trajectory that has
    stopped keeps the state in which it did. ``progress`` is told the number of trajectories finished since
    its last call.
    """
    n, dim = starts.shape
    own = np.broadcast_to(params, (n, params.shape[-1]))
    ensemble = Ensemble(
        states=np.empty((times.size - 1, n, dim)),
        records=np.empty((observation.record.size, n)),
        status=np.empty(n, dtype=np.int8),
    )
    packed, nodes = tableau.packed, np.asarray(tableau.c, dtype=np.float64)

    def advance(span: Floats, lanes: _Lanes) -> Floats:
        """Take lanes through the times ``span``; their states at ``span[1:]``, shape (outputs, dim, m)."""
        steps, m = output_steps(span, dt), lanes.Y.shape[1]
        out = np.empty((span.size - 1, dim, m))
        for first in range(0, m, block_lanes):
            part = slice(first, first + block_lanes)
            Y, p, record = (np.ascontiguousarray(a[:, part]) for a in (lanes.Y, lanes.params, lanes.record))
            block_out = np.empty((span.size - 1, *Y.shape))
            integrate_block(
                rhs,
                observation.observe,
                packed.start,
                packed.stage,
                packed.weight,
                nodes,
                span,
                steps,
                Y,
                p,
                observation.params,
                record,
                block_out,
            )
            lanes.Y[:, part], lanes.record[:, part], out[:, :, part] = Y, record, block_out
        return out

    def run_chunk(first: int) -> int:
        members = np.arange(first, min(first + chunk, n))
        record = np.repeat(observation.record[:, None], members.size, axis=1)
        lanes = _Lanes(members, starts[members].T.copy(), own[members].T.copy(), record)
        if observation.stops:
            _run_with_stops(advance, lanes, times, dt, ensemble)
        else:
            ensemble.states[:, members] = advance(times, lanes).transpose(0, 2, 1)
            ensemble.records[:, members] = lanes.record
        finite = np.isfinite(ensemble.states[:, members]).all(axis=(0, 2))
        ensemble.status[members] = np.where(finite, Status.OK, Status.NOT_FINITE)
        return members.size

    chunk = block_lanes * CHUNK_BLOCKS if observation.stops else block_lanes
    with ThreadPoolExecutor(thread_count(threads)) as pool:
        for finished in pool.map(run_chunk, range(0, n, chunk)):
            if progress is not None:
                progress(finished)
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


def _run_with_stops(
    advance: Callable[[Floats, _Lanes], Floats], lanes: _Lanes, times: Floats, dt: float, ensemble: Ensemble
) -> None:
    """Segment by segment; whoever has stopped or is not finite any more leaves after each."""
    for output, until in enumerate(segments(times, dt)):
        for span in until:
            if lanes.members.size:
                advance(span, lanes)
                stopped = lanes.record[0] != 0.0
                lanes.Y[:, stopped] = lanes.record[2:, stopped]
                gone = stopped | ~np.isfinite(lanes.Y).all(axis=0)
                ensemble.records[:, lanes.members] = lanes.record
                ensemble.states[output:, lanes.members] = lanes.Y.T
                lanes.keep(~gone)


def segments(times: Floats, dt: float) -> Iterator[list[Floats]]:
    """For every output interval the pairs of times that cut it into at most ``SEGMENT_STEPS`` steps each."""
    for start, stop, steps in zip(times[:-1], times[1:], output_steps(times, dt), strict=True):
        cuts = np.append(np.arange(0, steps, SEGMENT_STEPS), steps)
        at = start + (stop - start) * cuts / max(steps, 1)
        yield [np.ascontiguousarray(pair) for pair in pairwise(at)]
