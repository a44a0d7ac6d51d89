"""Driver of Adams methods with a fixed step over blocks of lanes.

The derivatives of the last steps are kept as rows of a ring, so nothing is shifted: which row holds which age
is an index array. A Runge-Kutta method takes the first steps. Right-hand side, observer, times, steps and
outputs are those of :func:`fastmech.integrators.explicit.integrate_blocks`.
"""

from __future__ import annotations

import numpy as np
from numba import types

from fastmech.integrators.explicit import (
    TABLEAU,
    BlockRHS,
    Floats,
    Integers,
    Observer,
    add_stages,
    start_stage,
)
from fastmech.jit import VECTOR, driver_signature, inlined, kernel, rounded_to

#: Step lengths that differ by less than this share of the time are the same: outputs were rounded.
ROUNDED_TIME = 4 * 2.0**-52


@inlined
def predict_and_correct(
    z: Floats, w: Floats, y: Floats, F: Floats, h: float, row: Integers, p: Floats, c: Floats
) -> None:
    """z = y + h sum_a p[a] F[row[a]] and w = h sum_a c[a] F[row[a]] in common passes over the history.

    Each pass takes three or four rows, of which any number from six on is a sum.
    """
    n, rows = z.shape[0], p.shape[0]
    for i in range(n):
        z[i] = y[i]
        w[i] = 0
    a = 0
    while a < rows:
        p0, c0 = rounded_to(z, h * p[a]), rounded_to(z, h * c[a])
        p1, c1 = rounded_to(z, h * p[a + 1]), rounded_to(z, h * c[a + 1])
        p2, c2 = rounded_to(z, h * p[a + 2]), rounded_to(z, h * c[a + 2])
        F0, F1, F2 = F[row[a]], F[row[a + 1]], F[row[a + 2]]
        if (rows - a) % 4:
            for i in range(n):
                z[i] += p0 * F0[i] + p1 * F1[i] + p2 * F2[i]
                w[i] += c0 * F0[i] + c1 * F1[i] + c2 * F2[i]
            a += 3
        else:
            p3, c3 = rounded_to(z, h * p[a + 3]), rounded_to(z, h * c[a + 3])
            F3 = F[row[a + 3]]
            for i in range(n):
                z[i] += p0 * F0[i] + p1 * F1[i] + p2 * F2[i] + p3 * F3[i]
                w[i] += c0 * F0[i] + c1 * F1[i] + c2 * F2[i] + c3 * F3[i]
            a += 4


@inlined
def add_correction(y: Floats, w: Floats, d: Floats, weight: float) -> None:
    """y += w + weight d: one rounding of the state a step."""
    own = rounded_to(y, weight)
    for i in range(y.shape[0]):
        y[i] += w[i] + own * d[i]


#: Types of the starter's packed tableau, of the predictor and of the corrector.
ADAMS = (*TABLEAU, VECTOR, VECTOR)


@kernel(driver_signature(types.float64, *ADAMS))
def integrate_multistep_blocks(
    rhs: BlockRHS,
    observe: Observer,
    start: Integers,
    stage: Integers,
    weight: Floats,
    nodes: Floats,
    predictor: Floats,
    corrector: Floats,
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
    :class:`fastmech.integrators.batch.Batch`. The method starts anew wherever the step's length changes.
    """
    stages, rows = nodes.shape[0], predictor.shape[0]
    dim, lanes = Y.shape[1], Y.shape[2]
    n = dim * lanes
    F, K = np.empty((rows, dim, lanes), dtype=Y.dtype), np.empty((stages, dim, lanes), dtype=Y.dtype)
    Z, w = np.empty((dim, lanes), dtype=Y.dtype), np.empty(n, dtype=Y.dtype)
    f, k_flat, z = F.reshape(rows, n), K.reshape(stages, n), Z.reshape(n)
    row = np.empty(rows, dtype=np.int64)  # row[a] holds the derivative of a steps ago
    for b in range(Y.shape[0]):
        state, own, kept = Y[b], params[b], record[b]
        y = state.reshape(n)
        known, newest, last = 0, 0, 0.0
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
                        k = start_stage(z, y, k_flat, h, stage, weight, int(start[s]), int(start[s + 1]))
                        add_stages(z, k_flat, h, stage, weight, k, int(start[s + 1]))
                        rhs(t + nodes[s] * h, Z, K[s], own)
                    add_stages(y, k_flat, h, stage, weight, int(start[stages]), int(start[stages + 1]))
                else:
                    for a in range(rows):
                        row[a] = (newest - a) % rows
                    if corrector.shape[0]:
                        predict_and_correct(z, w, y, f, h, row, predictor, corrector[1:])
                        rhs(t + h, Z, K[0], own)
                        add_correction(y, w, k_flat[0], h * corrector[0])
                    else:
                        add_stages(y, f, h, row, predictor, 0, rows)
                observe(times[j] + (step + 1) * h, state, observer_params, kept)
            out[b, j] = state
