"""What one call of a method is given: blocks of lanes and the times that they pass."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Numbers of a batch's phase.
PHASE = 3

#: Lengths of steps that differ by less than this share of the time are the same: times were rounded.
ROUNDED_TIME = 4 * 2.0**-52


@dataclass(frozen=True)
class Batch:
    """Equally wide blocks of lanes that pass the same times; the method writes all but the first four.

    A block lies together in memory, so that all it needs stays in the caches while it runs. With ``memory``
    and ``phase`` as a call has left them, the next goes on as if the two were one.
    """

    times: NDArray[np.float64]  #: start, then the end of every piece [s]
    steps: NDArray[np.int64]  #: steps of every piece
    params: Floats  #: parameters of the lanes, shape (blocks, count, lanes); (1, count, lanes): of all blocks
    observer_params: NDArray[np.float64]  #: parameters of the observer
    Y: Floats  #: states, advanced in place, shape (blocks, dim, lanes)
    record: NDArray[np.float64]  #: what the observer keeps, shape (blocks, rows, lanes)
    out: Floats  #: states at the end of every piece, shape (blocks, pieces, dim, lanes)
    #: What the method carries of each lane, shape (blocks, carried * dim, lanes); zeros and None: it starts.
    memory: Floats | None = None
    #: What it carries of all, shape (PHASE,).
    phase: NDArray[np.float64] = field(default_factory=lambda: np.zeros(PHASE))

    def memory_of(self, carried: int) -> Floats:
        """The memory, of a method that carries so many states."""
        blocks, dim, lanes = self.Y.shape
        if self.memory is None:
            return np.zeros((blocks, carried * dim, lanes), dtype=self.Y.dtype)
        return self.memory
