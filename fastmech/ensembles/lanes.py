"""The trajectories of one task in blocks of equal width, and how those that have ended make room."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.spans import Span
from fastmech.integrators.batch import PHASE, Batch
from fastmech.integrators.sums import CACHE_LINE

Floats = NDArray[np.float64]

#: Widths of blocks are multiples of this: whole vectors of any processor, in either precision.
VECTOR_LANES = 16

#: Share of the lanes that must have ended before the others move up: moving costs a copy of all.
WORTH_MOVING = 0.125


def finite_rows(values: Floats) -> NDArray[np.bool_]:
    """Which rows (n,) of an array (n, columns) are finite; most often all are, which is seen sooner."""
    finite = np.isfinite(values)
    return np.ones(len(values), dtype=np.bool_) if finite.all() else np.asarray(finite.all(axis=1))


def rows_at(values: Floats, which: NDArray[np.int64]) -> Floats:
    """Rows of an array (n, count), rising, of which only the last may be there more than once.

    No copies where all rows are one (:func:`numpy.broadcast_to`), or where they lie together.
    """
    if values.strides[0] == 0:
        return np.broadcast_to(values[:1], (which.size, values.shape[1]))
    if lie_together(which):
        return values[which[0] : which[-1] + 1]
    return values.take(which, axis=0)  # an index in brackets takes five times as long


def lie_together(which: NDArray[np.int64]) -> bool:
    """Whether rising indices, of which only the last may be there more than once, leave none out."""
    return which.size > 0 and which.size == which[-1] - which[0] + 1


def _on_lines(values: Floats) -> Floats:
    """A copy in C order whose rows begin on lines of the cache: no vector lies on two."""
    memory = np.empty(values.nbytes + CACHE_LINE, dtype=np.uint8)
    first = -memory.ctypes.data % CACHE_LINE
    copy = memory[first : first + values.nbytes].view(values.dtype).reshape(values.shape)
    copy[...] = values
    return copy


class Lanes:
    """Trajectories that still run, as blocks (blocks, rows, lanes) of states, parameters and records.

    So is what their method carries from call to call, see :class:`fastmech.integrators.batch.Batch`.

    The last block is filled up with copies of the last trajectory, so every lane runs in whole vectors.
    """

    def __init__(
        self,
        members: NDArray[np.int64],
        states: Floats,
        params: Floats,
        record: Floats,
        block_lanes: int,
        memory: Floats,
    ) -> None:
        """From states (n, dim) and parameters (n, count) of the members, and their records.

        ``record`` is the empty one (rows,) of all, or those of each (n, rows).
        ``memory`` (n, carried * dim) is what their method carries of them, zeros where it starts.
        """
        self.block_lanes = block_lanes
        self.members = members
        self.phase = np.zeros(PHASE)
        self._arrange(states, params, np.broadcast_to(record, (members.size, record.shape[-1])), memory)

    def _arrange(self, states: Floats, params: Floats, record: NDArray[np.float64], memory: Floats) -> None:
        n = len(states)
        blocks = max(1, -(-n // self.block_lanes))
        width = -(-n // (blocks * VECTOR_LANES)) * VECTOR_LANES
        lanes = np.minimum(np.arange(blocks * width), n - 1)
        self.Y, self.params, self.record, self.memory = (
            _on_lines(rows_at(a, lanes).reshape(blocks, width, a.shape[1]).transpose(0, 2, 1))
            for a in (states, params, record, memory)
        )

    def batch(self, span: Span, observer_params: NDArray[np.float64]) -> Batch:
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
            rows, row = (
                self.rows(blocked).astype(values.dtype, order="C", copy=False),
                f"V{values.strides[0]}",
            )
            values.view(row)[members, 0] = rows.view(row)[:, 0]

    def keep(self, which: NDArray[np.bool_], at_once: bool) -> None:
        """Let the others leave: ``at_once``, or if enough of them have ended to be worth the move."""
        few = which.any() and np.count_nonzero(~which) < WORTH_MOVING * which.size
        if which.all() or (few and not at_once):
            return
        kept = [self.rows(a)[which] for a in (self.Y, self.params, self.record, self.memory)]
        self.members = self.members[which]
        if self.members.size:
            self._arrange(*kept)
