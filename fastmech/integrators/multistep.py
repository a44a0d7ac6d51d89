"""Driver of Adams methods with a fixed step over blocks of lanes.

The derivatives of the last steps are kept as rows of a ring, so nothing is shifted: which row holds which age
is an index array. A Runge-Kutta method takes the first steps. Right-hand side, observer, times, steps and
outputs are those of :func:`fastmech.integrators.explicit.integrate_blocks`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types

from fastmech.integrators.batch import ROUNDED_TIME
from fastmech.integrators.driver import (
    TABLEAU,
    BlockRHS,
    Floats,
    Integers,
    Observer,
)
from fastmech.integrators.sums import add_stages, add_two_sums, rows_of
from fastmech.jit import VECTOR, driver_signature, inlined, kernel, lanes, rounded_to
from fastmech.kernels.last_term import EVERY, LOOKED_AT, note_term, term_weights


@inlined
def add_correction(y: Floats, w: Floats, d: Floats, weight: float) -> None:
    """y += w + weight d: one rounding of the state a step."""
    own = rounded_to(y, weight)
    for i in range(y.shape[0]):
        y[i] += w[i] + own * d[i]


def adams(precision: Any) -> tuple[Any, ...]:
    """Types of the starter's packed tableau, predictor, corrector, history and phase."""
    return (*TABLEAU, VECTOR, VECTOR, lanes(precision, 3), VECTOR)


@kernel(driver_signature(types.float64, *adams(types.float64)))
def integrate_multistep_blocks(
    rhs: BlockRHS,
    observe: Observer,
    start: Integers,
    stage: Integers,
    weight: Floats,
    nodes: Floats,
    predictor: Floats,
    corrector: Floats,
    memory: Floats,
    phase: Floats,
    times: Floats,
    steps: Integers,
    params: Floats,
    observer_params: Floats,
    Y: Floats,
    record: Floats,
    out: Floats,
) -> None:
    """Take blocks of lanes through all times, one block after the other.

    ``predictor`` weighs the derivatives at t_n, t_(n-1), ...; ``corrector`` that at the predicted t_(n+1),
    then the same ones, and is empty for an explicit method. ``start``, ``stage``, ``weight`` and ``nodes``
    are the packed tableau of the starter; the rest are the fields of
    :class:`fastmech.integrators.batch.Batch`. The method starts anew wherever the step's length changes; its
    ``memory`` is the history, then the greatest last terms of the predictor (see
    :mod:`fastmech.kernels.last_term`), its ``phase`` how much of the history is known, which row is the
    newest, and the step.
    """
    stages, rows = nodes.shape[0], predictor.shape[0]
    dim, width = Y.shape[1], Y.shape[2]
    n = dim * width
    F, K = (
        rows_of(Y[0], rows).reshape((rows, dim, width)),
        rows_of(Y[0], stages).reshape((stages, dim, width)),
    )
    Z, w = rows_of(Y[0], 1).reshape((dim, width)), rows_of(Y[0], 1)
    f, k_flat, z = F.reshape(rows, n), K.reshape(stages, n), Z.reshape(n)
    row = np.empty(rows, dtype=np.int64)  # row[a] holds the derivative of a steps ago
    weights, seen = term_weights(predictor), min(LOOKED_AT, dim) * width
    known, newest, last = 0, 0, 0.0
    for b in range(Y.shape[0]):
        state, own, kept = Y[b], params[min(b, params.shape[0] - 1)], record[b]
        y, history = state.reshape(n), memory[b].reshape(rows + 1, n)
        f[:] = history[:rows]
        known, newest, last = int(phase[0]), int(phase[1]), phase[2]
        for j in range(steps.shape[0]):
            if steps[j] == 0:
                out[b, j] = state
                continue
            h = (times[j + 1] - times[j]) / steps[j]
            if abs(h - last) > ROUNDED_TIME * max(abs(times[j]), abs(times[j + 1])):
                known, last = 0, h
            for step in range(steps[j]):
                t = times[j] + step * h
                newest = (newest + 1) % rows
                known = min(known + 1, rows)
                rhs(t, state, F[newest], own)
                if known < rows:
                    k_flat[0] = f[newest]
                    for s in range(1, stages):
                        add_stages(z, y, k_flat, h, stage, weight, int(start[s]), int(start[s + 1]))
                        rhs(t + nodes[s] * h, Z, K[s], own)
                    add_stages(y, None, k_flat, h, stage, weight, int(start[stages]), int(start[stages + 1]))
                else:
                    for a in range(rows):
                        row[a] = (newest - a) % rows
                    if step % EVERY == 0:
                        note_term(history[rows][:seen], z, f, row, weights, h)
                    if corrector.shape[0]:
                        add_two_sums(z, w, y, f, h, row, predictor, corrector[1:])
                        rhs(t + h, Z, K[0], own)
                        add_correction(y, w, k_flat[0], h * corrector[0])
                    else:
                        add_stages(y, None, f, h, row, predictor, 0, rows)
                if kept.size:
                    observe(times[j] + (step + 1) * h, state, observer_params, kept)
            out[b, j] = state
        history[:rows] = f
    phase[0], phase[1], phase[2] = known, newest, last
