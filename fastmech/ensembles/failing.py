"""What becomes of trajectories that fail on the way: their last finite state and its time."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.lanes import Lanes
from fastmech.ensembles.spans import Span
from fastmech.integrators.method import Method
from fastmech.jit import OBSERVER_SIGNATURE, kernel
from fastmech.kernels.blocks import observer_in_single

Floats = NDArray[np.float64]


#: Rows of the record: whether the lane is finite now, the time, and the state, when it was so last.
FINITE, TIME, STATE = 0, 1, 2


@kernel(OBSERVER_SIGNATURE)
def observe_last_finite(t: float, Y: Floats, params: Floats, record: Floats) -> None:
    """Keep time and state of every lane as long as all of its states are finite; branch-free."""
    for i in range(Y.shape[1]):
        record[FINITE, i] = 0.0
    for d in range(Y.shape[0]):
        for i in range(Y.shape[1]):
            record[FINITE, i] += Y[d, i] - Y[d, i]  # NaN where it is not finite
    for i in range(Y.shape[1]):
        record[TIME, i] = t if record[FINITE, i] == 0.0 else record[TIME, i]
    for d in range(Y.shape[0]):
        for i in range(Y.shape[1]):
            record[STATE + d, i] = Y[d, i] if record[FINITE, i] == 0.0 else record[STATE + d, i]


class Resumption:
    """What lanes were like before a call, so that some of them can be taken through it once more."""

    def __init__(self, lanes: Lanes) -> None:
        """From the lanes as they are."""
        self._lanes = lanes
        self._Y, self._phase = lanes.states_before(), lanes.phase.copy()
        self._memory = lanes.memory_before() if lanes.phase.any() else None  # None: the method starts

    def last_finite(
        self, rhs: Any, method: Method, span: Span, out: Floats, which: NDArray[np.int64]
    ) -> tuple[Floats, Floats]:
        """Times (n,) and states (n, dim) of lanes that began a call finite and did not end it so.

        ``which`` (n,) are their places, ``out`` is what the call wrote. They go once more through the pieces
        in which they failed, alone and watched, and through those before of which a method carries anything:
        healthy trajectories pay nothing for it, and the same arithmetic gives the same states.
        """
        dim = out.shape[2]
        block, lane = np.divmod(which, out.shape[3])
        reached = out[block, :, :, lane]
        failing = np.argmin(np.isfinite(reached).all(axis=2), axis=1)
        first, end = 0 if method.carried else int(failing.min()), int(failing.max()) + 1
        begin = reached[:, first - 1] if first else self.states(which)
        record = np.empty((which.size, STATE + dim))
        record[:, FINITE], record[:, TIME], record[:, STATE:] = 0.0, span.times[first], begin
        observe = last_finite_observer(begin.dtype.type)
        seen = self.watched(rhs, observe, method, span.part(first, end), which, begin, record)
        return seen[:, TIME], seen[:, STATE:]

    def states(self, which: NDArray[np.int64]) -> Floats:
        """States (n, dim) at the places ``which`` (n,)."""
        return self._lanes.rows(self._Y)[which]

    def params(self, which: NDArray[np.int64]) -> Floats:
        """Parameters (n, count) at the places ``which`` (n,)."""
        params = self._lanes.own_params()
        return np.repeat(params[None], which.size, axis=0) if params.ndim == 1 else params[which]

    def watched(
        self,
        rhs: Any,
        observe: Any,
        method: Method,
        span: Span,
        which: NDArray[np.int64],
        begin: Floats,
        record: Floats,
    ) -> Floats:
        """Records (n, rows) that ``observe`` makes of lanes which go through pieces of the call once more.

        They begin with the states ``begin`` (n, dim) and the records ``record`` (n, rows).
        """
        lanes, memory = self._lanes, self._memory
        carried = method.carried if memory is None else lanes.rows(memory)[which]
        again = Lanes(np.arange(which.size), begin, self.params(which), record, lanes.block_lanes, carried)
        again.phase[:] = self._phase
        batch = again.batch(span, np.zeros(0))
        method.run(rhs, observe, batch)
        return again.rows(batch.record)


def last_finite_observer(precision: Any) -> Any:
    """:func:`observe_last_finite` for lanes of a precision."""
    return observer_in_single(observe_last_finite) if precision is np.float32 else observe_last_finite
