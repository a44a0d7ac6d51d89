"""How the times of a run are passed: steps between outputs, in pieces of which a call takes some.

Where a piece ends depends on output times and step alone, never on who runs: it decides how times round.
How many pieces a call takes is free. Trajectories of equal steps share tasks, of which a thread runs one at a
time.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.errors import InputError
from fastmech.integrators.methods import Method
from fastmech.kernels.blocks import VECTOR_LANES

#: More steps than this take hours, and the times of their pieces more memory than most machines have.
MOST_STEPS = 2.0**34

#: Steps of a piece: as few as these, more where an interval has more than so many pieces, never above most.
PIECE_STEPS, PIECES, MOST_PIECE_STEPS = 64, 1024, 2048


@dataclass(frozen=True)
class Span:
    """Times that a run passes, or one call: where it starts, then where each ``steps`` ends."""

    times: Floats
    steps: NDArray[np.int64]
    outputs: NDArray[np.int64]  #: index of the output at the end of each piece, -1: none
    passed: int  #: outputs passed at its end

    @cached_property
    def _steps_before(self) -> NDArray[np.int64]:
        return np.concatenate([[0], np.cumsum(self.steps)])

    @cached_property
    def _passed(self) -> NDArray[np.int64]:
        return np.cumsum(self.outputs >= 0)

    def part(self, first: int, end: int) -> Span:
        """Pieces from ``first`` on, before ``end``."""
        passed = int(self._passed[end - 1])
        return Span(self.times[first : end + 1], self.steps[first:end], self.outputs[first:end], passed)

    def span(self, first: int, most: int) -> Span:
        """What a call passes from piece ``first`` on: one piece, or more while steps are at most ``most``."""
        before = self._steps_before
        if not first and before[-1] <= most:
            return self
        end = max(first + 1, int(np.searchsorted(before, before[first] + most, side="right")) - 1)
        return self.part(first, end)


def output_steps(times: Floats, dt: float) -> NDArray[np.int64]:
    """Steps between output times: the fewest equal ones that are no longer than ``dt``.

    Raises:
        InputError: the step is not positive, the times do not rise, or there would be too many steps.
    """
    intervals = times[1:] - times[:-1]
    if not dt > 0.0 or not (intervals >= 0.0).all():
        raise InputError(f"dt = {dt:g} s: must be greater than 0, and the times must rise")
    # A quotient that is an integer but for rounding must not cost a step more.
    with np.errstate(over="ignore"):  # an infinite number is refused below
        steps = np.ceil(intervals / dt * (1.0 - 1e-12))
        number = steps.sum()
    if not number <= MOST_STEPS:
        raise InputError(f"dt = {dt:g} s: gives {number:.3g} steps, at most {MOST_STEPS:.0e} are possible")
    return steps.astype(np.int64)


def way(times: Floats, dt: float) -> Span:
    """The way through all output times; an interval of many steps is cut into pieces."""
    totals = output_steps(times, dt)
    if totals.max(initial=0) <= PIECE_STEPS:
        return Span(times, totals, np.arange(totals.size), totals.size)
    lengths = np.minimum(np.maximum(-(-totals // PIECES), PIECE_STEPS), MOST_PIECE_STEPS)
    pieces = np.maximum(1, -(-totals // lengths))
    output = np.repeat(np.arange(totals.size), pieces)
    number = np.arange(output.size) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    total, begin = totals[output], number * lengths[output]
    end = np.minimum(begin + lengths[output], total)
    start, stop, last = times[output], times[output + 1], end == total
    at = np.where(last, stop, start + (stop - start) * (end / np.maximum(total, 1)))
    outputs = np.where(last, output, -1)
    return Span(np.concatenate([times[:1], at]), end - begin, outputs, totals.size)


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
    way: Span


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
    if dt.ndim:
        groups = [(way(times, float(step)), np.flatnonzero(usable & (dt == step))) for step in np.unique(dt)]
    else:
        groups = [(way(times, float(dt)), np.flatnonzero(usable))]
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
