"""The trajectories of one task in blocks of equal width, their parameters, and how times are passed.

How the times of a run are passed: steps between outputs, in pieces of which a call takes some. Where a piece
ends depends on output times and step alone, never on who runs: it decides how times round. How many pieces a
call takes is free. Trajectories of equal steps share tasks, of which a thread runs one at a time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Flags, Floats, Integers
from fastmech.errors import InputError
from fastmech.integrators.explicit import PHASE, Batch
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
    steps: Integers
    outputs: Integers  #: index of the output at the end of each piece, -1: none
    passed: int  #: outputs passed at its end

    @cached_property
    def _steps_before(self) -> Integers:
        return np.concatenate([[0], np.cumsum(self.steps)])

    @cached_property
    def _passed(self) -> Integers:
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


def output_steps(times: Floats, dt: float) -> Integers:
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

    members: Integers
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


def tasks_of(dt: Floats, usable: Flags, times: Floats, workers: int, lanes: int) -> list[Task]:
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


#: Bytes that processors move at once, and the length of their longest vectors.
CACHE_LINE = 64

#: Share of the lanes that must have ended before the others move up: moving costs a copy of all.
WORTH_MOVING = 0.125


def finite_rows(values: Floats) -> Flags:
    """Which rows (n,) of an array (n, columns) are finite; most often all are, which is seen sooner."""
    finite = np.isfinite(values)
    return np.ones(len(values), dtype=np.bool_) if finite.all() else np.asarray(finite.all(axis=1))


def rows_at(values: Floats, which: Integers) -> Floats:
    """Rows of an array (n, count), rising, of which only the last may be there more than once.

    No copies where they lie together.
    """
    if lie_together(which):
        return values[which[0] : which[-1] + 1]
    return values.take(which, axis=0)  # an index in brackets takes five times as long


def lie_together(which: Integers) -> bool:
    """Whether rising indices, of which only the last may be there more than once, leave none out."""
    return which.size > 0 and which.size == which[-1] - which[0] + 1


def _on_lines(shape: tuple[int, ...], precision: Any, allocate: Any = np.empty) -> Floats:
    """An array in C order whose rows begin on lines of the cache: no vector lies on two."""
    kind = np.dtype(precision)
    memory = allocate(math.prod(shape) * kind.itemsize + CACHE_LINE, dtype=np.uint8)
    return np.ndarray(shape, kind, memory, -memory.ctypes.data % CACHE_LINE)


class Lanes:
    """Trajectories that still run, as blocks (blocks, rows, lanes) of states, parameters and records.

    So is what their method carries from call to call, see :class:`fastmech.integrators.explicit.Batch`.
    Parameters that all share are in one block for all.

    The last block is filled up with copies of the last trajectory, so every lane runs in whole vectors where
    blocks are not narrower.
    """

    def __init__(
        self,
        members: Integers,
        states: Floats,
        params: Floats,
        record: Floats,
        block_lanes: int,
        carried: int | Floats,
        together: int = 1,
    ) -> None:
        """From states (n, dim) of the members, their parameters and their records.

        ``params`` are those of all (count,), or of each (n, count); ``record`` is the empty one (rows,) of
        all, or those of each (n, rows). ``carried`` is how many states their method carries of each, or what
        it carries (n, carried * dim). An observer looks at so many blocks ``together``.
        """
        self.block_lanes, self._together = block_lanes, together
        self.members = members
        self.phase = np.zeros(PHASE)
        self._arrange(states, params, record)
        if isinstance(carried, int):
            blocks, dim, width = self.Y.shape
            self.memory = _on_lines((blocks, carried * dim, width), states.dtype, np.zeros)
        else:
            self.memory = self._blocked(carried)

    def _arrange(self, states: Floats, params: Floats, record: Floats) -> None:
        blocks = max(1, -(-len(states) // self.block_lanes))
        unit = min(self.block_lanes, VECTOR_LANES)
        self._width = -(-len(states) // (blocks * unit)) * unit
        self.Y, self._shared = self._blocked(states), params.ndim == 1
        given = np.broadcast_to(params, (self._width, params.size)) if self._shared else params
        self.params = self._blocked(given)
        each = np.broadcast_to(record, (len(states), record.shape[-1]))
        self.record = self._blocked(each, min(self._together, len(self.Y)))

    def _blocked(self, values: Floats, together: int = 1) -> Floats:
        """Values of each (n, rows) as blocks (blocks, rows, lanes), so many ``together``."""
        (n, rows), width = values.shape, self._width * together
        blocks = -(-n // width)
        if blocks * width > n:
            values = rows_at(values, np.minimum(np.arange(blocks * width), n - 1))
        blocked = _on_lines((blocks, rows, width), values.dtype)
        blocked[...] = values.reshape(blocks, width, rows).transpose(0, 2, 1)
        return blocked

    def own_params(self) -> Floats:
        """Parameters of all (count,), or of each member (members, count)."""
        return self.params[0, :, 0] if self._shared else self.rows(self.params)

    def batch(self, span: Span, observer_params: Floats) -> Batch:
        """What a method is given to take the lanes through a span."""
        blocks, dim, width = self.Y.shape
        out = np.empty((blocks, span.steps.size, dim, width), dtype=self.Y.dtype)
        own = self.params, observer_params, self.Y, self.record, out, self.memory, self.phase
        return Batch(span.times, span.steps, *own)

    def rows(self, blocked: Floats) -> Floats:
        """Values (members, rows) of an array (blocks, rows, lanes)."""
        blocks, rows, width = blocked.shape
        return blocked.transpose(0, 2, 1).reshape(blocks * width, rows)[: self.members.size]

    def put(self, blocked: Floats, values: Floats) -> None:
        """Write states of an array (blocks, dim, lanes) to the members' rows of one in C order (n, dim)."""
        blocks, dim, width = blocked.shape
        members = self.members
        if lie_together(members) and members.size == blocks * width:
            together = values[members[0] : members[-1] + 1].reshape(blocks, width, dim)
            together[...] = blocked.transpose(0, 2, 1)
        else:  # a row is copied as one thing: number by number takes twice as long
            rows = self.rows(blocked).astype(values.dtype, order="C", copy=False)
            row = f"V{values.strides[0]}"
            values.view(row)[members, 0] = rows.view(row)[:, 0]

    def keep(self, which: Flags, at_once: bool) -> None:
        """Let the others leave: ``at_once``, or if enough of them have ended to be worth the move."""
        few = which.any() and np.count_nonzero(~which) < WORTH_MOVING * which.size
        if which.all() or (few and not at_once):
            return
        states, record, memory = (self.rows(a)[which] for a in (self.Y, self.record, self.memory))
        params = self.own_params() if self._shared else self.own_params()[which]
        self.members = self.members[which]
        if self.members.size:
            self._arrange(states, params, record)
            self.memory = self._blocked(memory)


@dataclass(frozen=True)
class Parameters:
    """Columns of parameters, each a number that all trajectories share, or one of each.

    Rows are made for those who run: all of ten million trajectories would take 640 MB.
    """

    columns: tuple[Floats, ...]  #: each of shape () or (n,)

    @classmethod
    def of(cls, values: ArrayLike | Parameters) -> Parameters:
        """From those of all (count,) or of each (n, count)."""
        if isinstance(values, Parameters):
            return values
        given = np.asarray(values, dtype=np.float64)
        return cls(tuple(np.asarray(column) for column in given.T))

    @property
    def shared(self) -> bool:
        """Whether all trajectories have the same ones."""
        return not any(column.ndim for column in self.columns)

    def at(self, members: Integers, precision: Any = np.float64) -> Floats:
        """Those of trajectories whose indices rise, shape (members, count), or of all (count,)."""
        with np.errstate(over="ignore"):  # trajectories of which one is too large for float32 have a status
            if self.shared:
                return np.array(self.columns, dtype=precision)
            rows = np.empty((members.size, len(self.columns)), dtype=precision)
            together = slice(members[0], members[-1] + 1) if lie_together(members) else None
            for k, column in enumerate(self.columns):
                if not column.ndim:
                    rows[:, k] = column
                else:
                    rows[:, k] = column.take(members) if together is None else column[together]
        return rows

    def block(self, n: int) -> Floats:
        """Those of n trajectories, which are all, as kernels are given them: shape (count, n)."""
        return np.reshape([np.broadcast_to(column, n) for column in self.columns], (len(self.columns), n))

    def part(self, members: Integers) -> Parameters:
        """Those of some trajectories."""
        return Parameters(tuple(column[members] if column.ndim else column for column in self.columns))
