"""How an ensemble is shared: blocks of lanes in tasks, of which a thread runs one at a time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.spans import Way, way
from fastmech.integrators.method import Method
from fastmech.kernels.blocks import VECTOR_LANES

Floats = NDArray[np.float64]

#: Lanes a block: at least as many as make calls cost little, at most as many as keep a block of all methods
#: in the caches.
BLOCK_LANES = (64, 256)

#: Bytes of a processor's first cache that a block may fill: all stages, state, their sum and parameters.
BLOCK_BYTES = 32768

#: Lanes that a task holds at most, and bytes of their states and of what their method carries, which then
#: stay in the second cache: one call runs them all, and where trajectories may stop, those still running move
#: up into full blocks.
TASK_LANES, TASK_BYTES = 8192, 2**19


@dataclass(frozen=True)
class Task:
    """Trajectories of one step's length, and how they pass the output times."""

    members: NDArray[np.int64]
    way: Way


def block_width(method: Method, dim: int, precision: type[np.floating[Any]] = np.float64) -> int:
    """Lanes of a block of ``dim`` states whose step stays in the first cache, if the method can choose."""
    if method.lanes:
        return method.lanes
    row = dim * np.dtype(precision).itemsize
    least, most = BLOCK_LANES
    return int(np.clip(BLOCK_BYTES // (row * (method.rows + 4)) // VECTOR_LANES * VECTOR_LANES, least, most))


def task_lanes(method: Method, dim: int) -> int:
    """Lanes that a task of a method of ``dim`` states holds at most."""
    return min(TASK_LANES, TASK_BYTES // (np.dtype(np.float64).itemsize * dim * (1 + method.carried)))


def tasks_of(
    dt: Floats, usable: NDArray[np.bool_], times: Floats, workers: int, lanes: int
) -> Iterator[Task]:
    """Trajectories sorted by their step, shared evenly among the workers in tasks of at most ``lanes``."""
    for step in np.unique(dt):
        passed = way(times, float(step))
        members = np.flatnonzero(usable & (dt == step))
        if not members.size:
            continue
        number = -(-members.size // (lanes * workers)) * workers
        size = -(-members.size // (number * VECTOR_LANES)) * VECTOR_LANES
        for first in range(0, members.size, size):
            yield Task(members[first : first + size], passed)
