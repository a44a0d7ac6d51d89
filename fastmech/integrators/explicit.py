"""Driver of explicit Runge-Kutta methods with a fixed step over blocks of lanes.

The driver knows neither the mechanism nor the method: right-hand side and observer come as functions, the
tableau as arrays.
"""

from __future__ import annotations

from numba import types

from fastmech.integrators.driver import TABLEAU, BlockRHS, Floats, Integers, Observer
from fastmech.integrators.sums import add_stages, rows_of
from fastmech.jit import driver_signature, inlined, kernel


@inlined
def one_step(
    rhs: BlockRHS,
    t: float,
    h: float,
    start: Integers,
    stage: Integers,
    weight: Floats,
    nodes: Floats,
    state: Floats,
    own: Floats,
    K: Floats,
    Z: Floats,
) -> None:
    """A step of a block ``state`` (dim, lanes) in place; ``K`` (stages, dim, lanes) and ``Z`` are scratch.

    The right-hand side takes the arrays as rows, the stage sums take them flat.
    """
    stages, n = nodes.shape[0], state.size
    y, k_flat, z = state.reshape(n), K.reshape((stages, n)), Z.reshape(n)
    rhs(t, state, K[0], own)
    for s in range(1, stages):
        add_stages(z, y, k_flat, h, stage, weight, int(start[s]), int(start[s + 1]))
        rhs(t + nodes[s] * h, Z, K[s], own)
    add_stages(y, None, k_flat, h, stage, weight, int(start[stages]), int(start[stages + 1]))


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
    K, Z = rows_of(Y[0], stages).reshape((stages, dim, lanes)), rows_of(Y[0], 1).reshape((dim, lanes))
    for b in range(Y.shape[0]):
        state, own, kept = Y[b], params[min(b, params.shape[0] - 1)], record[b]
        for j in range(steps.shape[0]):
            h = (times[j + 1] - times[j]) / max(steps[j], 1)
            for step in range(steps[j]):
                one_step(rhs, times[j] + step * h, h, start, stage, weight, nodes, state, own, K, Z)
                if kept.size:
                    observe(times[j] + (step + 1) * h, state, observer_params, kept)
            out[b, j] = state
