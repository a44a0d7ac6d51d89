"""Driver of Runge-Kutta methods whose steps are compiled whole, see :mod:`fastmech.kernels.whole_steps`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.callee import callee
from fastmech.integrators.batch import Batch
from fastmech.integrators.driver import TABLEAU, BlockRHS, Observer
from fastmech.integrators.method import Adams, Method, RungeKutta
from fastmech.integrators.sums import rows_of
from fastmech.jit import STEP, driver_signature, inlined, kernel
from fastmech.kernels.far import STRETCH, Marks, mark_far
from fastmech.kernels.whole_steps import is_lagrange, whole_step

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
BlockStep = Callable[[float, float, Floats, Floats, Floats, Floats], None]

#: Runge-Kutta methods that have whole steps, as all Adams methods do: the fourth order that everybody knows
#: and the best of order 8. Each costs a compilation for each combination of terms, on first use.
IN_WHOLE_STEPS = ("rk4", "dop853")


@inlined
def redo(
    rhs: BlockRHS,
    t: float,
    h: float,
    start: Integers,
    stage: Integers,
    weight: Floats,
    nodes: Floats,
    now: Floats,
    then: Floats,
    params: Floats,
    far: Marks,
) -> None:
    """The step once more, stage by stage, for marked lanes: one by one.

    The sums are plain loops: those of :func:`fastmech.integrators.explicit.one_step` are fast, but long to
    compile, and no run needs them here.
    """
    dim, stages = now.shape[0], nodes.shape[0]
    own, y, K = np.empty((params.shape[0], 1)), np.empty((dim, 1)), np.empty((stages, dim, 1))
    for i in range(now.shape[1]):
        if far[i]:
            own[:, 0] = params[:, i]
            for s in range(stages + 1):
                for d in range(dim):
                    total = 0.0
                    for k in range(start[s], start[s + 1]):
                        total += weight[k] * K[stage[k], d, 0]
                    y[d, 0] = now[d, i] + h * total
                if s < stages:
                    rhs(t + nodes[s] * h, y, K[s], own)
            then[:, i] = y[:, 0]


@kernel(driver_signature(types.float64, STEP, *TABLEAU))
def integrate_whole_steps(
    rhs: BlockRHS,
    observe: Observer,
    step: BlockStep,
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
    """Take blocks of lanes through all times, as :func:`fastmech.integrators.explicit.integrate_blocks` does.

    ``step`` does the work; ``rhs`` and the packed tableau serve lanes that are far out. States go to and fro
    between the block and a second one: a copy would cost as much as a stage.
    """
    dim, lanes = Y.shape[1], Y.shape[2]
    work = rows_of(Y[0, 0], nodes.shape[0]).reshape((nodes.shape[0], lanes))
    other = rows_of(Y[0], 1).reshape((dim, lanes))
    far, some_far = np.zeros(lanes, dtype=np.bool_), False
    for b in range(Y.shape[0]):
        now, then, own, kept = Y[b], other, params[min(b, params.shape[0] - 1)], record[b]
        for j in range(steps.shape[0]):
            h = (times[j + 1] - times[j]) / max(steps[j], 1)
            for k in range(steps[j]):
                t = times[j] + k * h
                if k % STRETCH == 0:
                    some_far = mark_far(now, h, far)
                step(t, h, now, then, own, work)
                if some_far:
                    redo(rhs, t, h, start, stage, weight, nodes, now, then, own, far)
                now, then = then, now
                if kept.size:
                    observe(times[j] + (k + 1) * h, now, observer_params, kept)
            out[b, j] = now
        if steps.sum() % 2:
            Y[b] = other


@dataclass(frozen=True)
class WholeSteps(RungeKutta):
    """An explicit Runge-Kutta method with a compiled step for one right-hand side."""

    step: Any

    @property
    def rows(self) -> int:
        """None: stages are local numbers."""
        return 0

    def run(self, rhs: Any, observe: Any, batch: Batch) -> None:
        """Take a batch through its times."""
        packed = self.tableau.packed
        integrate_whole_steps(
            callee(rhs),
            callee(observe),
            callee(self.step),
            packed.start,
            packed.stage,
            packed.weight,
            packed.nodes,
            batch.times,
            batch.steps,
            batch.params,
            batch.observer_params,
            batch.Y,
            batch.record,
            batch.out,
        )


def in_whole_steps(method: Method, rhs: Any) -> Method:
    """The same method with compiled steps for this right-hand side, where it has them."""
    if not is_lagrange(rhs):
        return method
    if isinstance(method, Adams):
        module = import_module("fastmech.integrators.whole_multistep")  # a driver that few runs need
        whole: Method = module.adams_in_whole_steps(method, rhs)
        return whole
    if isinstance(method, RungeKutta) and method.name in IN_WHOLE_STEPS:
        return WholeSteps(method.tableau, whole_step(rhs, method.tableau))
    return method
