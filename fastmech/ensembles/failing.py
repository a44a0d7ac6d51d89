"""What becomes of trajectories that fail on the way: their last finite state and its time."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.ensembles.lanes import Lanes
from fastmech.ensembles.spans import Span
from fastmech.integrators.method import Method
from fastmech.jit import OBSERVER_SIGNATURE, kernel, observer_signature, single

Floats = NDArray[np.float64]


@kernel(OBSERVER_SIGNATURE)
def observe_last_finite(t: float, Y: Floats, params: Floats, record: Floats) -> None:
    """Keep time and state, rows 0 and 1.., of every lane as long as all of its states are finite."""
    for i in range(Y.shape[1]):
        finite = True
        for d in range(Y.shape[0]):
            finite &= bool(np.isfinite(Y[d, i]))
        if finite:
            record[0, i] = t
            for d in range(Y.shape[0]):
                record[1 + d, i] = Y[d, i]


def last_finite(rhs: Any, method: Method, span: Span, begin: Floats, params: Floats) -> tuple[Floats, Floats]:
    """Times (n,) and states (n, dim) of trajectories that began a span finite and did not end it so.

    ``begin`` (n, dim) and ``params`` (n, count) are what they began with. They go through the span once more,
    alone and watched: healthy trajectories pay nothing for it, and the same arithmetic gives the same states.
    """
    observe, dim = observe_last_finite, begin.shape[1]
    if begin.dtype == np.float32:
        observe = _in_single()
    record = np.concatenate([[span.times[0]], np.full(dim, np.nan)])
    lanes = Lanes(np.arange(len(begin)), begin, params, record, len(begin))
    lanes.record[:, 1:] = lanes.Y
    batch = lanes.batch(span, np.zeros(0))
    method.run(rhs, observe, batch)
    seen = lanes.rows(batch.record)
    return seen[:, 0], seen[:, 1:]


@cache
def _in_single() -> Any:
    return single(observe_last_finite, observer_signature(types.float32))
