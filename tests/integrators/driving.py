"""One block through the driver of any method: right-hand sides, an observer, and the call."""

from __future__ import annotations

from typing import Any

import numpy as np
from integrators.systems import Floats

from fastmech.integrators.explicit import Batch, observe_nothing
from fastmech.integrators.methods import METHODS
from fastmech.jit import OBSERVER_SIGNATURE, RHS_SIGNATURE, kernel

#: y' = w x y, that is y' = A y.
W = np.array([0.7, -1.1, 0.4])
A = np.array([[0, -W[2], W[1]], [W[2], 0, -W[0]], [-W[1], W[0], 0]])


@kernel(RHS_SIGNATURE)
def polynomial(t: float, Y: Floats, dY: Floats, p: Floats) -> None:
    """y' = p0 + p1 t + p2 t^2 + ...: a method of order k is exact up to t^(k-1)."""
    for i in range(Y.shape[1]):
        dY[0, i] = 0.0
        for power in range(p.shape[0]):
            dY[0, i] += p[power, i] * t**power


@kernel(RHS_SIGNATURE)
def rotation(t: float, Y: Floats, dY: Floats, p: Floats) -> None:
    """A linear system of three states, y' = p x y."""
    for i in range(Y.shape[1]):
        dY[0, i] = p[1, i] * Y[2, i] - p[2, i] * Y[1, i]
        dY[1, i] = p[2, i] * Y[0, i] - p[0, i] * Y[2, i]
        dY[2, i] = p[0, i] * Y[1, i] - p[1, i] * Y[0, i]


@kernel(RHS_SIGNATURE)
def counting(t: float, Y: Floats, dY: Floats, p: Floats) -> None:
    """y' = 1; the first parameter counts the calls."""
    p[0, 0] += 1.0
    for i in range(Y.shape[1]):
        dY[0, i] = 1.0


@kernel(OBSERVER_SIGNATURE)
def observe_times(t: float, Y: Floats, params: Floats, record: Floats) -> None:
    """Number of calls, last time, sum of times, and the first state so far as it was seen last."""
    for i in range(Y.shape[1]):
        record[0, i] += 1.0
        record[1, i] = t
        record[2, i] += t * params[0]
        record[3, i] = Y[0, i]


def one_block(Y: Floats, params: Floats, times: Floats, steps: int) -> Batch:
    """A batch of one block (dim, lanes) that passes one interval, with parameters (count, lanes)."""
    return Batch(
        times=times,
        steps=np.array([steps]),
        params=params[None].copy(),
        observer_params=np.zeros(0),
        Y=Y[None].copy(),
        record=np.zeros((1, 0, Y.shape[1])),
        out=np.empty((1, 1, *Y.shape)),
    )


def drive(
    rhs: Any,
    method: str,
    Y: Floats,
    times: Floats,
    steps: list[int],
    params: Floats,
    observe: Any = observe_nothing,
) -> tuple[Floats, Floats, Floats, Floats]:
    """Outputs, the block's last state, the record and the parameters as the right-hand side left them."""
    lanes = Y.shape[1]
    batch = Batch(
        times=times,
        steps=np.array(steps, dtype=np.int64),
        params=np.repeat(params[None, :, None], lanes, axis=2),
        observer_params=np.array([2.0]),
        Y=Y[None].copy(),
        record=np.zeros((1, 4, lanes)),
        out=np.empty((1, len(steps), *Y.shape)),
    )
    METHODS[method].run(rhs, observe, batch)
    return batch.out[0], batch.Y[0], batch.record[0], batch.params[0]
