"""Driver of Adams methods whose steps are compiled whole, see :mod:`fastmech.kernels.whole_adams`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numba import types

from fastmech.callee import callee
from fastmech.integrators.batch import ROUNDED_TIME, Batch
from fastmech.integrators.driver import BlockRHS, Floats, Integers, Observer
from fastmech.integrators.method import Adams
from fastmech.integrators.multistep import adams
from fastmech.integrators.sums import rows_of
from fastmech.integrators.whole import BlockStep, redo
from fastmech.jit import ADVANCE, STEP, driver_signature, inlined, kernel
from fastmech.kernels.blocks import VECTOR_LANES
from fastmech.kernels.far import STRETCH, Marks, mark_far
from fastmech.kernels.last_term import LOOKED_AT
from fastmech.kernels.whole_adams import whole_adams_steps
from fastmech.kernels.whole_steps import whole_step

Advance = Callable[[float, float, int, int, Floats, int, Floats, Floats, Floats, bool], int]

#: Steps between two moves of a block's history: it grows at its end, and then goes back to the begin of its
#: memory.
MOVED = 8 * STRETCH


@inlined
def redo_adams(
    rhs: BlockRHS,
    t: float,
    h: float,
    predictor: Floats,
    corrector: Floats,
    F: Floats,
    newest: int,
    now: Floats,
    then: Floats,
    params: Floats,
    far: Marks,
) -> None:
    """The step once more for marked lanes, one by one, with the library's trigonometry where it is needed.

    ``F`` (rows, dim, lanes) holds the history up to the row ``newest``; the next one is written too. The
    newest is computed anew: a lane may have left the range in the stretch before.
    """
    dim, rows = now.shape[0], predictor.shape[0]
    own, y, f = np.empty((params.shape[0], 1)), np.empty((dim, 1)), np.empty((dim, 1))
    past = np.empty((2, dim))
    for i in range(now.shape[1]):
        if far[i]:
            own[:, 0], y[:, 0] = params[:, i], now[:, i]
            rhs(t, y, f, own)
            F[newest, :, i] = f[:, 0]
            past[:] = 0.0
            for a in range(rows):
                for d in range(dim):
                    past[0, d] += predictor[a] * F[newest - a, d, i]
                    if corrector.shape[0]:
                        past[1, d] += corrector[a + 1] * F[newest - a, d, i]
            y[:, 0] = now[:, i] + h * past[0]
            rhs(t + h, y, f, own)
            if corrector.shape[0]:
                y[:, 0] = now[:, i] + h * (past[1] + corrector[0] * f[:, 0])
                rhs(t + h, y, f, own)
            then[:, i], F[newest + 1, :, i] = y[:, 0], f[:, 0]


@kernel(driver_signature(types.float64, STEP, ADVANCE, *adams(types.float64)))
def integrate_whole_multistep(
    rhs: BlockRHS,
    observe: Observer,
    begin: BlockStep,
    advance: Advance,
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
    """Take blocks of ``VECTOR_LANES`` lanes through all times, one block after the other.

    ``begin`` is a whole step of the starter, ``advance`` takes those of the method; the rest is as in
    :func:`fastmech.integrators.multistep.integrate_multistep_blocks`, except that the history ends with the
    derivative at the present state, and that its rows are in the order of their times.
    ``advance`` keeps the predictor's greatest last terms in the last rows of ``work``.
    """
    rows, dim, lanes = predictor.shape[0], Y.shape[1], Y.shape[2]
    f = rows_of(Y[0], rows + MOVED)
    F = f.reshape((rows + MOVED, dim, lanes))
    work = rows_of(Y[0, 0], nodes.shape[0] + LOOKED_AT).reshape((nodes.shape[0] + LOOKED_AT, lanes))
    terms = work[nodes.shape[0] :]
    far = np.zeros(lanes, dtype=np.bool_)
    before = rows_of(Y[0], 1).reshape((dim, lanes))
    known, last, some_far = 0, 0.0, False
    for b in range(Y.shape[0]):
        state, own, kept, newest = Y[b], params[min(b, params.shape[0] - 1)], record[b], rows - 1
        known, last = int(phase[0]), phase[2]
        carried = memory[b].reshape((rows + 1, dim, lanes))
        terms[:] = carried[rows, :LOOKED_AT]
        if known:
            F[:rows] = carried[:rows]
        for j in range(steps.shape[0]):
            if steps[j] > 0:
                h = (times[j + 1] - times[j]) / steps[j]
                if abs(h - last) > ROUNDED_TIME * max(abs(times[j]), abs(times[j + 1])):
                    known, last = 0, h
                if known == 0:
                    rhs(times[j], state, F[newest], own)
                    known = 1
                k = slow = 0  # so many steps are taken one by one
                while k < steps[j]:
                    if newest + STRETCH >= F.shape[0]:
                        F[:rows] = F[newest + 1 - rows : newest + 1].copy()
                        newest = rows - 1
                    t, many = times[j] + k * h, 1
                    if known < rows:
                        if k % STRETCH == 0:
                            some_far = mark_far(state, h, far)
                        before[:] = state
                        begin(t, h, before, state, own, work)
                        if some_far:
                            redo(rhs, t, h, start, stage, weight, nodes, before, state, own, far)
                        rhs(t + h, state, F[newest + 1], own)
                        known += 1
                    elif slow == 0 and not kept.size:
                        room = (F.shape[0] - newest - 1) // STRETCH * STRETCH
                        wanted, oldest = min(room, steps[j] - k), newest + 1 - rows
                        many = advance(times[j], h, k, k + wanted, f, oldest, state, own, work, True)
                        if many < wanted:
                            slow, some_far = STRETCH, mark_far(state, h, far)
                    else:
                        if slow == 0:
                            slow, some_far = STRETCH, mark_far(state, h, far)
                        if some_far:
                            before[:] = state
                        advance(times[j], h, k, k + 1, f, newest + 1 - rows, state, own, work, False)
                        if some_far:
                            redo_adams(rhs, t, h, predictor, corrector, F, newest, before, state, own, far)
                        slow -= 1
                    newest += many
                    k += many
                    if kept.size:
                        observe(times[j] + k * h, state, observer_params, kept)
            out[b, j] = state
        carried[:rows], carried[rows, :LOOKED_AT] = F[newest + 1 - rows : newest + 1], terms
    phase[0], phase[2] = known, last


@dataclass(frozen=True)
class WholeAdams(Adams):
    """An Adams method with compiled steps for one right-hand side."""

    begin: Any
    advance: Any

    @property
    def lanes(self) -> int:
        """What its steps are compiled for."""
        return VECTOR_LANES

    def evaluations(self, steps: int) -> int:
        """Right-hand sides that so many steps of equal length take, the starter's and the first included."""
        return super().evaluations(steps) + min(steps, self.start_steps) + 1

    def run(self, rhs: Any, observe: Any, batch: Batch) -> None:
        """Take a batch through its times.

        Raises:
            ValueError: its blocks are not :attr:`lanes` wide, for which steps are compiled.
        """
        if batch.Y.shape[2] != self.lanes:
            raise ValueError(f"blocks of {batch.Y.shape[2]} lanes: must be {self.lanes} wide")
        packed = self.starter.packed
        integrate_whole_multistep(
            callee(rhs),
            callee(observe),
            callee(self.begin),
            callee(self.advance),
            packed.start,
            packed.stage,
            packed.weight,
            packed.nodes,
            self.predictor,
            self.corrector,
            batch.memory_of(self.carried),
            batch.phase,
            batch.times,
            batch.steps,
            batch.params,
            batch.observer_params,
            batch.Y,
            batch.record,
            batch.out,
        )


@cache
def adams_in_whole_steps(method: Adams, rhs: Any) -> WholeAdams:
    """The same method with compiled steps for one of Lagrange's right-hand sides."""
    own = method.name, method.order, method.corrects, method.starter, method.source
    return WholeAdams(*own, begin=whole_step(rhs, method.starter), advance=whole_adams_steps(rhs, method))
