"""Runs an ensemble: blocks of lanes, taken from a queue by threads that hold no interpreter lock.

A lane's result depends on nothing but its own start, so it is the same, bit for bit, for any number of
threads and any block size.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.status import Status
from fastmech.integrators.explicit import integrate_block, observe_nothing
from fastmech.integrators.tableau import Tableau

Floats = NDArray[np.float64]

#: Lanes a block: large enough that calls cost little, small enough that all stages stay in the caches.
BLOCK_LANES = 256

Progress = Callable[[int], None]


@dataclass(frozen=True)
class Observation:
    """An observer (see :data:`fastmech.jit.OBSERVER_SIGNATURE`), its parameters and its empty record.

    ``record`` holds the start value of every row of a lane's record.
    """

    observe: Any
    params: Floats
    record: Floats


NOTHING = Observation(observe_nothing, np.zeros(0), np.zeros(0))


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
) -> tuple[Floats, Floats, NDArray[np.int8]]:
    """Integrate ``starts`` (n, dim) from ``times[0]`` through ``times[1:]``.

    Returns:
        states (times - 1, n, dim), records (rows, n) and :class:`Status` values (n,). ``progress`` is told
        the number of trajectories finished since its last call.
    """
    n, dim = starts.shape
    states = np.empty((times.size - 1, n, dim))
    records = np.empty((observation.record.size, n))
    steps = output_steps(times, dt)
    packed, nodes = tableau.packed, np.asarray(tableau.c, dtype=np.float64)

    def run_block(first: int) -> int:
        lanes = slice(first, min(first + block_lanes, n))
        Y = np.ascontiguousarray(starts[lanes].T)
        out = np.empty((times.size - 1, *Y.shape))
        record = np.repeat(observation.record[:, None], Y.shape[1], axis=1)
        integrate_block(
            rhs,
            observation.observe,
            packed.start,
            packed.stage,
            packed.weight,
            nodes,
            times,
            steps,
            Y,
            params,
            observation.params,
            record,
            out,
        )
        states[:, lanes] = out.transpose(0, 2, 1)
        records[:, lanes] = record
        return Y.shape[1]

    firsts = range(0, n, block_lanes)
    with ThreadPoolExecutor(thread_count(threads)) as pool:
        for finished in pool.map(run_block, firsts):
            if progress is not None:
                progress(finished)
    finite = np.isfinite(states).all(axis=(0, 2))
    status = np.where(finite, Status.OK, Status.NOT_FINITE).astype(np.int8)
    return states, records, status


def thread_count(threads: int | None) -> int:
    """Threads to use: as asked, else the processors that this process may run on."""
    if threads is not None:
        return threads
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
