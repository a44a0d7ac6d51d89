"""How an ensemble is shared: blocks of lanes in tasks, of which a thread runs one at a time."""

from __future__ import annotations

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


#: Tasks for each worker, if no step's trajectories are more than others'.
SHARES = 3


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


def tasks_of(dt: Floats, usable: NDArray[np.bool_], times: Floats, workers: int, lanes: int) -> list[Task]:
    """Trajectories of one step each in tasks of at most ``lanes``, the costliest first.

    All workers share a step's trajectories where they are all there are. Of several steps' each is divided as
    far as its part of the work asks for: a task costs about as much beside its steps as a hundred of them.
    """
    groups = [(way(times, float(step)), np.flatnonzero(usable & (dt == step))) for step in np.unique(dt)]
    groups = [(passed, members) for passed, members in groups if members.size]
    work = [members.size * max(int(passed.steps.sum()), 1) for passed, members in groups]
    equal = workers if len(groups) == 1 else SHARES * workers
    tasks: list[tuple[int, Task]] = []
    for (passed, members), own in zip(groups, work, strict=True):
        number = max(-(-members.size // lanes), -(-own * equal // sum(work)) if workers > 1 else 1)
        number = -(-number // workers) * workers if len(groups) == 1 else number
        size = -(-members.size // (number * VECTOR_LANES)) * VECTOR_LANES
        for first in range(0, members.size, size):
            part = members[first : first + size]
            tasks.append((own * part.size // members.size, Task(part, passed)))
    return [task for _, task in sorted(tasks, key=lambda costed: -costed[0])]
