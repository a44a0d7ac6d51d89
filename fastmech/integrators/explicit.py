"""Driver of explicit Runge-Kutta methods with a fixed step over blocks of lanes.

The driver knows neither the mechanism nor the method: a block right-hand side and an observer come as
first-class functions (one indirect call a stage and block), the tableau as arrays. Stage sums run over the
block's flat memory, at most four terms a pass.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.jit import (
    INTEGERS,
    OBSERVER_SIGNATURE,
    VECTOR,
    driver_signature,
    inlined,
    kernel,
    rounded_to,
)

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
BlockRHS = Callable[[float, Floats, Floats, Floats], None]
Observer = Callable[[float, Floats, Floats, Floats], None]


@inlined
def add_stages(z: Floats, K: Floats, h: float, stage: Integers, weight: Floats, k: int, stop: int) -> None:
    """z += h * sum of weight[k:stop] times the stages they belong to."""
    n = z.shape[0]
    while k < stop:
        terms = min(4, stop - k)
        w0 = rounded_to(z, h * weight[k])
        K0 = K[stage[k]]
        if terms == 1:
            for i in range(n):
                z[i] += w0 * K0[i]
        elif terms == 2:
            w1 = rounded_to(z, h * weight[k + 1])
            K1 = K[stage[k + 1]]
            for i in range(n):
                z[i] += w0 * K0[i] + w1 * K1[i]
        elif terms == 3:
            w1, w2 = rounded_to(z, h * weight[k + 1]), rounded_to(z, h * weight[k + 2])
            K1, K2 = K[stage[k + 1]], K[stage[k + 2]]
            for i in range(n):
                z[i] += w0 * K0[i] + w1 * K1[i] + w2 * K2[i]
        else:
            w1, w2 = rounded_to(z, h * weight[k + 1]), rounded_to(z, h * weight[k + 2])
            w3 = rounded_to(z, h * weight[k + 3])
            K1, K2, K3 = K[stage[k + 1]], K[stage[k + 2]], K[stage[k + 3]]
            for i in range(n):
                z[i] += w0 * K0[i] + w1 * K1[i] + w2 * K2[i] + w3 * K3[i]
        k += terms


@inlined
def start_stage(
    z: Floats, y: Floats, K: Floats, h: float, stage: Integers, weight: Floats, k: int, stop: int
) -> int:
    """z = y + h * (the first at most four terms); returns the index of the first term left out."""
    n = z.shape[0]
    terms = min(4, stop - k)
    w0 = rounded_to(z, h * weight[k])
    K0 = K[stage[k]]
    if terms == 1:
        for i in range(n):
            z[i] = y[i] + w0 * K0[i]
    elif terms == 2:
        w1 = rounded_to(z, h * weight[k + 1])
        K1 = K[stage[k + 1]]
        for i in range(n):
            z[i] = y[i] + (w0 * K0[i] + w1 * K1[i])
    elif terms == 3:
        w1, w2 = rounded_to(z, h * weight[k + 1]), rounded_to(z, h * weight[k + 2])
        K1, K2 = K[stage[k + 1]], K[stage[k + 2]]
        for i in range(n):
            z[i] = y[i] + (w0 * K0[i] + w1 * K1[i] + w2 * K2[i])
    else:
        w1, w2 = rounded_to(z, h * weight[k + 1]), rounded_to(z, h * weight[k + 2])
        w3 = rounded_to(z, h * weight[k + 3])
        K1, K2, K3 = K[stage[k + 1]], K[stage[k + 2]], K[stage[k + 3]]
        for i in range(n):
            z[i] = y[i] + (w0 * K0[i] + w1 * K1[i] + w2 * K2[i] + w3 * K3[i])
    return k + terms


@kernel(OBSERVER_SIGNATURE)
def observe_nothing(t: float, Y: Floats, params: Floats, record: Floats) -> None:
    """The observer of runs that keep nothing but states."""


#: Types of a packed tableau: start, stage, weight, nodes.
TABLEAU = (INTEGERS, INTEGERS, VECTOR, VECTOR)


@kernel(driver_signature(types.float64, *TABLEAU))
def integrate_blocks(
    rhs: BlockRHS,
    observe: Observer,
    start: Integers,
    stage: Integers,
    weight: Floats,
    nodes: Floats,
    times: Floats,
    steps: Integers,
    params: Floats,
    observer_params: Floats,
    Y: Floats,
    record: Floats,
    out: Floats,
) -> None:
    """Take blocks of lanes through all times, one block after the other.

    ``start``, ``stage``, ``weight`` and ``nodes`` are a packed tableau; the rest are the fields of
    :class:`fastmech.integrators.batch.Batch`. ``observe`` is called after every
    step. A step's time is computed from its index, so rounding does not accumulate.
    """
    stages, dim, lanes = nodes.shape[0], Y.shape[1], Y.shape[2]
    n = dim * lanes
    # Each array once as rows for the right-hand side and once flat for the stage sums.
    K, Z = np.empty((stages, dim, lanes), dtype=Y.dtype), np.empty((dim, lanes), dtype=Y.dtype)
    k_flat, z = K.reshape(stages, n), Z.reshape(n)
    for b in range(Y.shape[0]):
        state, own, kept = Y[b], params[b], record[b]
        y = state.reshape(n)
        for j in range(steps.shape[0]):
            h = (times[j + 1] - times[j]) / max(steps[j], 1)
            for step in range(steps[j]):
                t = times[j] + step * h
                rhs(t, state, K[0], own)
                for s in range(1, stages):
                    k = start_stage(z, y, k_flat, h, stage, weight, int(start[s]), int(start[s + 1]))
                    add_stages(z, k_flat, h, stage, weight, k, int(start[s + 1]))
                    rhs(t + nodes[s] * h, Z, K[s], own)
                add_stages(y, k_flat, h, stage, weight, int(start[stages]), int(start[stages + 1]))
                observe(times[j] + (step + 1) * h, state, observer_params, kept)
            out[b, j] = state
