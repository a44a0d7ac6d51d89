"""What becomes of trajectories that fail on the way: their last finite state and its time."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.spans import Span
from fastmech.integrators.method import Method
from fastmech.jit import OBSERVER_SIGNATURE, kernel

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
    """Times (lanes,) and states (dim, lanes) of lanes that began a span finite and did not end it so.

    The lanes go through the span once more, alone and watched: healthy trajectories pay nothing for it, and
    the same arithmetic gives the same states.
    """
    # Chosen lanes come in columns' order; kernels want rows.
    start, own = np.ascontiguousarray(begin), np.ascontiguousarray(params)
    record = np.ascontiguousarray(np.concatenate([np.full((1, start.shape[1]), span.times[0]), start]))
    out = np.empty((span.steps.size, *start.shape))
    method.run(
        rhs,
        observe_last_finite,
        span.times,
        span.steps,
        start.copy(),
        own,
        np.zeros(0),
        record,
        out,
    )
    return record[0], record[1:]
