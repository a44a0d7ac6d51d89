"""What one call of a method is given; driver of explicit Runge-Kutta and Adams methods over blocks of lanes.

The driver knows neither the mechanism nor the method: right-hand side, observer and whole steps
(:mod:`fastmech.kernels.steps`) come as functions, the method's weights as arrays. By those it takes steps
stage by stage where there are no whole ones (systems of many states), where an Adams method starts, and for
single lanes that need the library's trigonometry.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import types

from fastmech.arrays import Floats, Integers
from fastmech.callee import CalleeType, callee, entry
from fastmech.integrators.tableau import Tableau
from fastmech.jit import (
    INTEGERS,
    OBSERVER_SIGNATURE,
    VECTOR,
    called,
    in_precision,
    kernel,
    lanes,
    named_tuple,
    observer_signature,
    rhs_signature,
    rounded_to,
)
from fastmech.kernels.blocks import VECTOR_LANES, in_single
from fastmech.kernels.steps import (
    EVERY,
    Advance,
    Formula,
    LaneArrays,
    Steps,
    advance_signature,
    term_weights,
    whole_steps,
)

BlockRHS = Callable[[float, Floats, Floats, Floats], None]
Observer = Callable[[float, Floats, Floats, Floats], None]

#: Numbers of a batch's phase.
PHASE = 3

#: Lengths of steps that differ by less than this share of the time are the same: times were rounded.
ROUNDED_TIME = 4 * 2.0**-52


class Batch(NamedTuple):
    """Equally wide blocks of lanes that pass the same times; the method writes all but the first four.

    A block lies together in memory, so that all it needs stays in the caches while it runs. With ``memory``
    and ``phase`` as a call has left them, the next goes on as if the two were one.
    """

    times: Floats  #: start, then the end of every piece [s]
    steps: Integers  #: steps of every piece
    params: Floats  #: parameters of the lanes, shape (blocks, count, lanes); (1, count, lanes): of all blocks
    observer_params: Floats  #: parameters of the observer
    Y: Floats  #: states, advanced in place, shape (blocks, dim, lanes)
    #: What the observer keeps, shape (blocks, rows, lanes); explicit methods let it look at several blocks
    #: together, whose lanes lie side by side here.
    record: Floats
    out: Floats  #: states at the end of every piece, shape (blocks, pieces, dim, lanes)
    #: What the method carries of each lane, shape (blocks, carried * dim, lanes), zeros where it starts, and
    #: of all, shape (PHASE,); None: it starts.
    memory: Any = None
    phase: Any = None

    def ready(self, carried: int) -> Batch:
        """With memory for a method that carries so many states."""
        memory, phase = self.memory, self.phase
        if memory is not None and phase is not None:
            return self
        blocks, dim, width = self.Y.shape
        return self._replace(
            memory=np.zeros((blocks, carried * dim, width), self.Y.dtype) if memory is None else memory,
            phase=np.zeros(PHASE) if phase is None else phase,
        )


def batch_type(precision: Any) -> Any:
    """Type of a :class:`Batch` that is ready."""
    three, record = lanes(precision, 3), lanes(types.float64, 3)
    return named_tuple(
        [VECTOR, INTEGERS, three, VECTOR, three, record, lanes(precision, 4), three, VECTOR], Batch
    )


@kernel(OBSERVER_SIGNATURE)
def observe_nothing(t: float, Y: Floats, params: Floats, record: Floats) -> None:
    """The observer of runs that keep nothing but states."""


#: Rows that a pass of a sum adds.
TERMS = 4

#: Bytes that blocks which take a step together may fill, and how many these are at most.
GROUP_BYTES, GROUP = 65536, 4


class Weights(NamedTuple):
    """A method's weights as sums over rows: ``weight[k]`` belongs to row ``row[k]``.

    Sum s lies from ``start[s]`` to ``start[s + 1]``, filled up with weights of zero to whole :data:`TERMS`.
    The first ones are those of a Runge-Kutta method's stages and of its step; an Adams method has such a
    starter. Its own follow: predictor, the predictor's last term, and corrector, whose rows are those of the
    history, counted from the oldest on.
    """

    start: Integers
    row: Integers
    weight: Floats
    nodes: Floats
    new: float  #: belongs to the predicted derivative in the corrector; 0: there is none
    rows: int  #: of the history; 0: a Runge-Kutta method
    group: int  #: blocks that take whole steps together, unless an observer looks on; 0: there are none


class Calls(NamedTuple):
    """What the driver calls."""

    rhs: BlockRHS
    observe: Observer
    start: Advance  #: whole steps of an Adams method's starter
    advance: Advance  #: those of the method, if any


class Stepped(NamedTuple):
    """A block that takes a step stage by stage."""

    Y: Floats  #: states (dim, lanes)
    params: Floats  #: (count, lanes)
    history: Floats  #: (2 rows + 3, dim, lanes), see :mod:`fastmech.kernels.steps`
    stages: Floats  #: scratch (stages + 2, dim, lanes)


class Moment(NamedTuple):
    """When a block takes a step."""

    t: float  #: begin [s]
    h: float  #: step [s]
    oldest: int  #: row before the oldest of the history
    ready: bool  #: the history is known


WEIGHTS = named_tuple([INTEGERS, INTEGERS, VECTOR, VECTOR, types.float64, types.int64, types.int64], Weights)


def calls_type(precision: Any) -> Any:
    """Type of :class:`Calls`."""
    kinds = [CalleeType(rhs_signature(precision)), CalleeType(observer_signature(precision))]
    return named_tuple([*kinds, *[CalleeType(advance_signature(precision))] * 2], Calls)


def driver_signature(precision: Any) -> Any:
    """``drive(calls, weights, batch)``."""
    return types.void(calls_type(precision), WEIGHTS, batch_type(precision))


@called
def add_rows(total: Floats, rows: Floats, first: int, weights: Weights, s: int) -> None:
    """total = sum ``s`` of the weights, over rows from ``first`` on, :data:`TERMS` in a pass."""
    row, weight = weights.row, weights.weight
    for x in range(total.shape[0]):
        total[x] = 0.0
    for k in range(weights.start[s], weights.start[s + 1], TERMS):
        a, b, c, d = (
            rows[first + row[k]],
            rows[first + row[k + 1]],
            rows[first + row[k + 2]],
            rows[first + row[k + 3]],
        )
        wa, wb = rounded_to(total, weight[k]), rounded_to(total, weight[k + 1])
        wc, wd = rounded_to(total, weight[k + 2]), rounded_to(total, weight[k + 3])
        for x in range(total.shape[0]):
            total[x] += wa * a[x] + wb * b[x] + wc * c[x] + wd * d[x]


@called
def move(z: Floats, y: Floats, h: float, total: Floats) -> None:
    """z = y + h total."""
    own = rounded_to(z, h)
    for x in range(z.shape[0]):
        z[x] = y[x] + own * total[x]


@called
def step_by_stages(rhs: BlockRHS, weights: Weights, block: Stepped, at: Moment) -> None:
    """A Runge-Kutta step of a block in place; the first stage is there."""
    n, last = block.Y.size, block.stages.shape[0] - 1
    y, rows = block.Y.reshape(n), block.stages.reshape((last + 1, n))
    z, total = rows[last - 1], rows[last]
    for s in range(1, last):
        add_rows(total, rows, 0, weights, s)
        if s == last - 1:
            move(y, y, at.h, total)
        else:
            move(z, y, at.h, total)
            rhs(at.t + weights.nodes[s] * at.h, block.stages[last - 1], block.stages[s], block.params)


@called
def step_by_history(rhs: BlockRHS, weights: Weights, block: Stepped, at: Moment) -> None:
    """A step of an Adams method of a block in place; its derivative takes the place of the first stage's."""
    n, last = block.Y.size, block.stages.shape[0] - 1
    y, rows = block.Y.reshape(n), block.stages.reshape((last + 1, n))
    history = block.history.reshape((block.history.shape[0], n))
    z, total, own = rows[last - 1], rows[last], weights.nodes.shape[0] + 1
    add_rows(total, history, at.oldest + 1, weights, own)
    move(z, y, at.h, total)
    rhs(at.t + at.h, block.stages[last - 1], block.stages[0], block.params)
    if weights.new != 0.0:
        add_rows(total, history, at.oldest + 1, weights, own + 2)
        move(total, total, weights.new, rows[0])
        move(z, y, at.h, total)
        rhs(at.t + at.h, block.stages[last - 1], block.stages[0], block.params)
    for x in range(n):
        y[x] = z[x]


@called
def look(weights: Weights, block: Stepped, at: Moment) -> None:
    """Keep the greatest last terms of the predictor, see :mod:`fastmech.kernels.steps`."""
    (dim, width), last = block.Y.shape, block.stages.shape[0] - 1
    total = block.stages[last].reshape(dim * width)
    history = block.history.reshape((block.history.shape[0], dim * width))
    add_rows(total, history, at.oldest + 1, weights, weights.nodes.shape[0] + 2)
    for d in range(dim):
        for i in range(width):
            term = abs(at.h * block.stages[last, d, i])
            greatest = block.history[block.history.shape[0] - 1, 0, i]
            block.history[block.history.shape[0] - 1, 0, i] = term if term > greatest else greatest


@called
def keep(weights: Weights, block: Stepped, oldest: int) -> None:
    """Put the first stage's derivative into the history, twice."""
    if weights.rows:
        for d in range(block.Y.shape[0]):
            for i in range(block.Y.shape[1]):
                value = block.stages[0, d, i]
                block.history[oldest, d, i] = block.history[oldest + weights.rows + 1, d, i] = value


@called
def step_once(rhs: BlockRHS, weights: Weights, block: Stepped, at: Moment) -> None:
    """A step of a block in place: the method's, or its starter's."""
    if at.ready and weights.rows:
        step_by_history(rhs, weights, block, at)
    else:
        rhs(at.t, block.Y, block.stages[0], block.params)
        step_by_stages(rhs, weights, block, at)
    keep(weights, block, at.oldest)


@called
def step_alone(rhs: BlockRHS, weights: Weights, block: Stepped, i: int, at: Moment) -> None:
    """The same of one lane of a block."""
    dim, count, carried = block.Y.shape[0], block.params.shape[0], block.history.shape[0]
    alone = Stepped(
        np.empty((dim, 1), block.Y.dtype),
        np.empty((count, 1), block.Y.dtype),
        np.empty((carried, dim, 1), block.Y.dtype),
        np.empty((block.stages.shape[0], dim, 1), block.Y.dtype),
    )
    for row in range(count):
        alone.params[row, 0] = block.params[row, i]
    for d in range(dim):
        alone.Y[d, 0] = block.Y[d, i]
        for row in range(carried):
            alone.history[row, d, 0] = block.history[row, d, i]
    step_once(rhs, weights, alone, at)
    for d in range(dim):
        block.Y[d, i] = alone.Y[d, 0]
        for row in range(carried):
            block.history[row, d, i] = alone.history[row, d, 0]


@called
def see(Y: Floats, begin: int, seen: Floats) -> None:
    """States of blocks from ``begin`` on side by side; where there are no more, the last one's."""
    blocks, dim, width = Y.shape
    for place in range(0, seen.shape[1], width):
        b = min(begin + place // width, blocks - 1)
        for d in range(dim):
            for i in range(width):
                seen[d, place + i] = Y[b, d, i]


@kernel(driver_signature(types.float64))
def drive(calls: Calls, weights: Weights, run: Batch) -> None:
    """Take blocks of lanes through all times, some blocks after the others.

    The observer is called after every step, for as many blocks together as the record has lanes. A step's
    time is computed from its index, so rounding does not accumulate. An Adams method starts anew wherever the
    step's length changes, and after a piece of no steps; its ``phase`` is how many rows of the history are
    known, the row before the oldest, and the step.
    """
    (blocks, dim, width), rows = run.Y.shape, weights.rows
    carried, observed, whole = run.memory.shape[1] // dim, run.record.size > 0, weights.group > 0
    group = run.record.shape[2] // width if observed else max(weights.group, 1)
    seen = np.empty((dim, group * width if observed else 0), run.Y.dtype)
    stages = np.empty((weights.nodes.shape[0] + 2, dim, width), run.Y.dtype)
    lost = np.zeros(group * width, dtype=np.bool_)
    flat = LaneArrays(
        run.Y.reshape(run.Y.size),
        run.params.reshape(run.params.size),
        run.memory.reshape(run.memory.size),
        lost,
    )
    given = run.params.shape[1] * width if run.params.shape[0] > 1 else 0
    known, oldest, last = 0, 0, 0.0
    for begin in range(0, blocks, group):
        end = min(begin + group, blocks)
        known, oldest, last = int(run.phase[0]), int(run.phase[1]), run.phase[2]
        for j in range(run.steps.shape[0]):
            now, taken, wanted = run.times[j], 0, run.steps[j]
            h = (run.times[j + 1] - now) / max(wanted, 1)
            if rows and abs(h - last) > ROUNDED_TIME * max(abs(now), abs(run.times[j + 1])):
                known, last = 0, h
            while taken < wanted:
                fresh = rows > 0 and known == rows - 1  # all but the derivative at the present state
                oldest, known = (oldest + 1) % (rows + 1) if fresh else oldest, known + fresh
                ready, done = known >= rows, 1
                if whole and not fresh:
                    until = wanted if ready else min(wanted, taken + rows - 1 - known)
                    until = taken + 1 if observed else until
                    steps = Steps(now, h, taken, until, begin, end=end, given=given, oldest=oldest)
                    done = calls.advance(flat, steps) if ready else calls.start(flat, steps)
                number = abs(done)
                at = Moment(now + (taken + number - 1) * h, h, (oldest + number - 1) % (rows + 1), ready)
                for b in range(begin, end if fresh or done < 0 or not whole else begin):
                    params = run.params[min(b, run.params.shape[0] - 1)]
                    block = Stepped(run.Y[b], params, run.memory[b].reshape((carried, dim, width)), stages)
                    if fresh:
                        calls.rhs(at.t, block.Y, stages[0], params)
                        keep(weights, block, (oldest - 1) % (rows + 1))
                    elif not whole:
                        if ready and rows and taken % EVERY == 0:
                            look(weights, block, at)
                        step_once(calls.rhs, weights, block, at)
                    elif done < 0:
                        for i in range(width):
                            if lost[(b - begin) * width + i]:
                                step_alone(calls.rhs, weights, block, i, at)
                if not fresh:
                    if observed:
                        see(run.Y, begin, seen)
                        t = now + (taken + number) * h
                        calls.observe(t, seen, run.observer_params, run.record[begin // group])
                    oldest, taken = (oldest + number) % (rows + 1), taken + number
                    known = known if ready else known + number
            for b in range(begin, end):
                for d in range(dim):
                    for i in range(width):
                        run.out[b, j, d, i] = run.Y[b, d, i]
    run.phase[0], run.phase[1], run.phase[2] = known, oldest, last


@kernel(advance_signature(types.float64))
def no_steps(flat: LaneArrays, steps: Steps) -> int:
    """Where there are no whole steps."""
    return 0


def _filled(rows: Sequence[Sequence[tuple[int, float]]]) -> tuple[Integers, Integers, Floats]:
    """Where sums begin, and their rows and weights, without zeros and filled up to whole :data:`TERMS`."""
    full = []
    for row in rows:
        kept = [(place, weight) for place, weight in row if weight]
        full.append(kept + [(kept[0][0], 0.0)] * (-len(kept) % TERMS) if kept else [])
    entries = [entry for row in full for entry in row]
    start = np.cumsum([0, *map(len, full)], dtype=np.int64)
    places, weights = zip(*entries, strict=True) if entries else ((), ())
    return start, np.array(places, dtype=np.int64), np.array(weights, dtype=np.float64)


def weights_of(formula: Formula, own: Formula | None = None) -> Weights:
    """The weights of a Runge-Kutta method, or of an Adams method that it starts."""
    sums, rows, new = [list(enumerate(line)) for line in (*formula.a, formula.b)], 0, 0.0
    if own is not None and own.predictor:
        rows, (new, *others) = len(own.predictor), own.corrector or (0.0,)
        histories = own.predictor, term_weights(own.predictor), others
        sums += [list(enumerate(list(weights)[::-1])) for weights in histories]
    start, row, weight = _filled(sums)
    return Weights(start, row, weight, np.array(formula.c, dtype=np.float64), new, rows=rows, group=0)


def formula_of(tableau: Tableau, rows: int = 0) -> Formula:
    """A Runge-Kutta method, or the starter of an Adams method with a history of so many rows."""
    a = tuple(tuple(map(float, row)) for row in tableau.a)
    return Formula(tableau.name, a, tuple(map(float, tableau.b)), tuple(map(float, tableau.c)), rows=rows)


def bound(method: Any, functions: tuple[Any, Any], lanes: tuple[Any, int, int]) -> tuple[Any, Calls, Weights]:
    """The driver, what it calls and its weights, for blocks of so many states and lanes of a precision."""
    (rhs, observe), (dtype, dim, width), group = functions, lanes, 0
    precision, rates = dtype.name, getattr(rhs, "rates", None)
    advance = (in_precision(no_steps, precision, advance_signature),) * 2
    if rates is not None and width == VECTOR_LANES:
        made = tuple(whole_steps(rates, formula, precision) for formula in method.formulas)
        if None not in made:
            advance = made
            group = max(
                1, min(GROUP, GROUP_BYTES // (dtype.itemsize * dim * (method.carried + 2) * VECTOR_LANES))
            )
    own = rhs if precision == "float64" else in_single(rhs)
    calls = Calls(*map(callee, (own, observe, *advance)))
    return (
        entry(in_precision(drive, precision, driver_signature)),
        calls,
        weights_of(*method.formulas)._replace(group=group),
    )
