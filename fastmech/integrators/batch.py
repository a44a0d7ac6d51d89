"""What one call of a method is given: blocks of lanes, the times that they pass, and who looks on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import types

from fastmech.arrays import Floats, Integers
from fastmech.jit import INTEGERS, OBSERVER_SIGNATURE, VECTOR, kernel, lanes, named_tuple

BlockRHS = Callable[[float, Floats, Floats, Floats], None]
Observer = Callable[[float, Floats, Floats, Floats], None]

#: Numbers of a batch's phase.
PHASE = 3

#: Lengths of steps that differ by less than this share of the time are the same: times were rounded.
ROUNDED_TIME = 4 * 2.0**-52


class Batch(NamedTuple):
    """Equally wide blocks of lanes that pass the same times; the method writes all but the first four.

    A block lies together in memory, so that all it needs stays in the caches while it runs. With ``memory``
    and ``phase`` as a call has left them, the next goes on as if the two were one.
    """

    times: Floats  #: start, then the end of every piece [s]
    steps: Integers  #: steps of every piece
    params: Floats  #: parameters of the lanes, shape (blocks, count, lanes); (1, count, lanes): of all blocks
    observer_params: Floats  #: parameters of the observer
    Y: Floats  #: states, advanced in place, shape (blocks, dim, lanes)
    #: What the observer keeps, shape (blocks, rows, lanes); explicit methods let it look at several blocks
    #: together, whose lanes lie side by side here.
    record: Floats
    out: Floats  #: states at the end of every piece, shape (blocks, pieces, dim, lanes)
    #: What the method carries of each lane, shape (blocks, carried * dim, lanes), zeros where it starts, and
    #: of all, shape (PHASE,); None: it starts.
    memory: Any = None
    phase: Any = None

    def ready(self, carried: int) -> Batch:
        """With memory for a method that carries so many states."""
        memory, phase = self.memory, self.phase
        if memory is not None and phase is not None:
            return self
        blocks, dim, width = self.Y.shape
        return self._replace(
            memory=np.zeros((blocks, carried * dim, width), self.Y.dtype) if memory is None else memory,
            phase=np.zeros(PHASE) if phase is None else phase,
        )


def batch_type(precision: Any) -> Any:
    """Type of a :class:`Batch` that is ready."""
    three, record = lanes(precision, 3), lanes(types.float64, 3)
    return named_tuple(
        [VECTOR, INTEGERS, three, VECTOR, three, record, lanes(precision, 4), three, VECTOR], Batch
    )


@kernel(OBSERVER_SIGNATURE)
def observe_nothing(t: float, Y: Floats, params: Floats, record: Floats) -> None:
    """The observer of runs that keep nothing but states."""
