"""How trajectories end on the way: by a stopping condition, or by failing; when, and in which state.

Healthy trajectories pay nothing for it: those that ended in a call go through it once more, alone and
watched, by the same arithmetic.

A stopping condition is looked at after whole steps, so a stop is seen up to a step too late. Where that is
too late, the step is taken again from its begin, shorter and shorter or longer and longer, until the time of
the stop is known to rounding. The shortened steps are those of a one-step method of the order of the run, so
the time of a stop and the state at it have that order too (Hairer, Norsett, Wanner, *Solving ODEs I*,
section II.6), wherever the condition's border is smooth. A condition gives codes, not values, so the interval
is halved: no secant would know better.

A condition that becomes true and false again between two looks is not seen, by any run. So runs to a
tolerance look at the values that its decisions compare (:mod:`fastmech.ensembles.switches`). Where the line
through two in a row comes to zero in the next step, and the value does not, or where there is no telling, the
trajectory is marked: between its looks such a value may have been zero, if it is bent away from zero.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types

from fastmech.arrays import Flags, Floats, Integers
from fastmech.callee import callee
from fastmech.ensembles.lanes import Lanes, Span
from fastmech.integrators.explicit import (
    PHASE,
    WEIGHTS,
    Batch,
    Calls,
    batch_type,
    calls_type,
    drive,
    no_steps,
    weights_of,
)
from fastmech.integrators.implicit import CALLS, SCHEME, ImplicitCalls, drive_implicit, inverse_by_elimination
from fastmech.integrators.methods import ImplicitRungeKutta, Method
from fastmech.jit import (
    MATRIX,
    OBSERVER_SIGNATURE,
    VECTOR,
    in_precision,
    inlined,
    kernel,
    named_tuple,
    observer_signature,
)

#: Rows of the record of a stopping condition: the stop's code (0: runs on), its time [s], then the state.
STOP_CODE, STOP_TIME, STOP_STATE = 0, 1, 2

#: Rows behind these of a condition whose decisions are watched: whether it may have been true between two
#: looks, the last two times [s]; then, for each decision, its last two values, its outcome, and how many
#: values in a row are known (3: or more), less than zero where a branch has made it a new one.
NEAR, BEFORE_LAST, LAST, OF_EACH = range(4)
ROWS_OF_EACH = 4

#: Decisions that are watched at most: of a condition with more every trajectory is marked.
MOST_WATCHED = 16

#: How much steeper than between two looks a value may fall in the next step.
STEEPER = 2.0

#: Rows of the record of last states: until when they are kept, and the last one's time and state.
UNTIL, TIME, STATE = 0, 1, 2

#: Halvings at most: of a step that begins at t = 0, where times have no last digit.
HALVINGS = 60

#: Trajectories that look for the begin of their step together.
TOGETHER = 256

ONE = np.ones(1, dtype=np.int64)


@inlined
def note_stop(code: float, t: float, Y: Floats, record: Floats, i: int) -> None:
    """Keep code, time and state of lane ``i`` when its code is not zero for the first time.

    A state that is not finite stops nothing, whatever its code: the trajectory has failed before.
    """
    if code != 0.0 and record[STOP_CODE, i] == 0.0:
        for d in range(Y.shape[0]):
            if not np.isfinite(Y[d, i]):
                return
        record[STOP_CODE, i], record[STOP_TIME, i] = code, t
        for d in range(Y.shape[0]):
            record[STOP_STATE + d, i] = Y[d, i]


@inlined
def note_near(t: float, code: float, seen: Floats, record: Floats, place: tuple[int, int, int]) -> None:
    """Mark a lane where a condition may have been true since the last look.

    ``seen`` are its decisions at ``t``; ``place`` is the lane, the first row of what is watched, and how many
    decisions are.
    """
    i, own, most = place
    before, last = record[own + BEFORE_LAST, i], record[own + LAST, i]
    h, older, number = t - last, last - before, int(seen[0])
    if not h > 0.0:
        return
    near, other = number > most, False
    for k in range(most):
        row = own + OF_EACH + ROWS_OF_EACH * k
        known = record[row + 3, i]
        older_value, last_value = record[row, i], record[row + 1, i]
        if k >= number or other:  # another decision than before at this place
            if code == 0.0 and known != 0.0:
                on = last_value + STEEPER * (last_value - older_value) * (h / older)
                near |= abs(known) < 3.0 or on * last_value < 0.0  # seldom looked at, or on its way
            record[row + 3, i] = known = 0.0
        if k >= number:
            continue
        value, outcome = seen[1 + 2 * k], seen[2 + 2 * k]
        if abs(known) > 1.0 and older_value * value > 0.0 and last_value * value > 0.0:
            near |= _dips((older_value, last_value, value), (older, h), known)
        turned = known != 0.0 and outcome != record[row + 2, i]
        record[row, i], record[row + 1, i], record[row + 2, i] = last_value, value, outcome
        known = known - 1.0 if known < 0.0 else known + 1.0
        record[row + 3, i] = -1.0 if other else 3.0 if abs(known) > 2.0 else known
        other |= turned
    record[own + BEFORE_LAST, i], record[own + LAST, i] = last, t
    if near:
        record[own + NEAR, i] = 1.0


def near_stops(records: Floats, rows: range) -> Flags:
    """Who (n,) may have stopped between two looks; after a branch they may be too few to tell."""
    known = np.abs(records[rows.start + OF_EACH + 3 : rows.stop : ROWS_OF_EACH])
    seldom = ((known > 0.0) & (known < 3.0)).any(axis=0) & (records[STOP_CODE] == 0.0)
    return np.asarray(seldom | (records[rows.start + NEAR] > 0.0))


@inlined
def _dips(values: tuple[float, float, float], steps: tuple[float, float], known: float) -> bool:
    """Whether a line through two of three values of one sign comes to zero in the next step.

    Between two looks a value that is bent away from zero lies above the lines that go on from its neighbours.
    """
    (older, h), sign = steps, 1.0 if values[2] > 0.0 else -1.0
    first, middle, end = sign * values[0], sign * values[1], sign * values[2]
    near = middle + STEEPER * (middle - first) * (h / older) < 0.0
    if known != 3.0:  # nothing has looked at the step between the first two, nor at the one before
        near |= middle + STEEPER * (middle - end) * (older / h) < 0.0
        near |= first + STEEPER * (first - middle) < 0.0
    return near


@kernel(OBSERVER_SIGNATURE)
def observe_last(t: float, Y: Floats, params: Floats, record: Floats) -> None:
    """Keep time and state of every lane until its time, as long as all of its states are finite."""
    for i in range(Y.shape[1]):
        keeps = t < record[UNTIL, i]
        for d in range(Y.shape[0]):
            keeps &= np.isfinite(Y[d, i])
        if keeps:
            record[TIME, i] = t
            for d in range(Y.shape[0]):
                record[STATE + d, i] = Y[d, i]


class StopSearch(NamedTuple):
    """Trajectories (n) that have stopped, and where their last steps began."""

    begin: Floats  #: times [s] (n,)
    states: Floats  #: (n, dim)
    params: Floats  #: (n, count)
    observer_params: Floats
    empty: Floats  #: records of no stop (n, rows)
    record: Floats  #: (n, rows); its stops move to where they happened


SEARCH = named_tuple([VECTOR, MATRIX, MATRIX, VECTOR, MATRIX, MATRIX], StopSearch)


@inlined
def _narrowed(of: StopSearch, i: int, seen: Floats, times: tuple[float, float, float]) -> tuple[float, float]:
    """Where trajectory ``i`` stops, after a step to the middle one of three times."""
    low, middle, high = times
    if seen[STOP_CODE, 0] == 0.0:
        return middle, high
    for row in range(STOP_STATE + of.states.shape[1]):
        of.record[i, row] = seen[row, 0]
    return low, middle


@inlined
def _begun(of: StopSearch, i: int, until: float, batch: Batch) -> None:
    """Make trajectory ``i`` begin its last step, up to a time [s], as the one lane of a batch."""
    batch.times[0], batch.times[1] = of.begin[i], until
    for row in range(of.params.shape[1]):
        batch.params[0, row, 0] = of.params[i, row]
    for d in range(of.states.shape[1]):
        batch.Y[0, d, 0] = of.states[i, d]
    for row in range(of.record.shape[1]):
        batch.record[0, row, 0] = of.empty[i, row]
    for row in range(batch.memory.shape[1]):
        batch.memory[0, row, 0] = 0.0
    for k in range(PHASE):
        batch.phase[k] = 0.0


@kernel(types.void(calls_type(types.float64), WEIGHTS, SEARCH, batch_type(types.float64)))
def halve_steps(calls: Any, weights: Any, of: StopSearch, batch: Batch) -> None:
    """Find the stops of a search by an explicit one-step method of these weights."""
    for i in range(of.begin.size):
        low, high = of.begin[i], of.record[i, STOP_TIME]
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
            _begun(of, i, middle, batch)
            drive(calls, weights, batch)
            low, high = _narrowed(of, i, batch.record[0], (low, middle, high))


@kernel(types.void(CALLS, SCHEME, SEARCH, batch_type(types.float64)))
def halve_implicit_steps(calls: Any, scheme: Any, of: StopSearch, batch: Batch) -> None:
    """The same by an implicit method.

    A shortened step of which Newton's iteration finds no solution counts as one that does not reach the stop.
    """
    failed = np.empty((1, 1))
    for i in range(of.begin.size):
        low, high = of.begin[i], of.record[i, STOP_TIME]
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
            _begun(of, i, middle, batch)
            failed[0, 0] = np.nan
            drive_implicit(calls, scheme, batch, failed)
            low, high = _narrowed(of, i, batch.record[0], (low, middle, high))


class Resumption:
    """What lanes were like before a call, so that some of them can be taken through it once more."""

    def __init__(self, lanes: Lanes, rhs: Any, method: Method, span: Span) -> None:
        """From the lanes as they are, and what the call does."""
        self._lanes, self._rhs, self._method, self._span = lanes, rhs, method, span
        self._Y, self._phase = lanes.Y.copy(), lanes.phase.copy()
        self._memory = lanes.memory.copy() if lanes.phase.any() else None  # None: the method starts

    def last_finite(self, out: Floats, which: Integers) -> tuple[Floats, Floats]:
        """Times (n,) and states (n, dim) of lanes that began a call finite and did not end it so.

        ``which`` (n,) are their places, ``out`` is what the call wrote. They go once more through the pieces
        in which they failed, and through those before of which a method carries anything.
        """
        block, lane = np.divmod(which, out.shape[3])
        reached = out[block, :, :, lane]
        failing = np.argmin(np.isfinite(reached).all(axis=2), axis=1)
        first, end = 0 if self._method.carried else int(failing.min()), int(failing.max()) + 1
        begin = reached[:, first - 1] if first else self._states(which)
        seen = self._watched(self._span.part(first, end), which, begin)
        return seen[:, TIME], seen[:, STATE:]

    def locate_stops(self, observation: Any, which: Integers, record: Floats) -> Floats:
        """Records (n, rows) of trajectories that stopped in a call, of the stops themselves.

        ``which`` (n,) are their places, ``record`` (n, rows) is what the observer of ``observation`` saw
        after a whole step.
        """
        located = np.ascontiguousarray(record)
        params = self._lanes.own_params()
        for first in range(0, which.size, TOGETHER):
            some, found = which[first : first + TOGETHER], located[first : first + TOGETHER]
            seen = self._watched(self._span, some, self._states(some), found[:, STOP_TIME])
            begin, states = np.ascontiguousarray(seen[:, TIME]), np.ascontiguousarray(seen[:, STATE:])
            own = np.repeat(params[None], some.size, axis=0) if params.ndim == 1 else params[some]
            empty = np.array(np.broadcast_to(observation.empty(states, own), found.shape), order="C")
            search = StopSearch(begin, states, own, observation.params, empty=empty, record=found)
            method: Any = self._method
            lane = Lanes(np.arange(1), states[:1], own[:1], found[0], block_lanes=1, carried=method.carried)
            batch = lane.batch(Span(np.zeros(2), ONE, ONE, 1), observation.params)
            rhs, observe = callee(self._rhs), callee(observation.observe)
            if isinstance(method, ImplicitRungeKutta):
                implicit = ImplicitCalls(rhs, callee(inverse_by_elimination), observe)
                halve_implicit_steps(implicit, method.tableau.scheme, search, batch)
            else:
                calls = Calls(rhs, observe, callee(no_steps), callee(no_steps))
                halve_steps(calls, weights_of(method.formulas[0]), search, batch)
        return located

    def _states(self, which: Integers) -> Floats:
        """States (n, dim) at the places ``which`` (n,)."""
        return self._lanes.rows(self._Y)[which]

    def _watched(self, span: Span, which: Integers, begin: Floats, until: Floats | float = np.inf) -> Floats:
        """Records (n, 2 + dim) of lanes which go through pieces of the call once more, up to a time [s].

        They begin with the states ``begin`` (n, dim).
        """
        lanes, memory = self._lanes, self._memory
        record = np.empty((which.size, STATE + begin.shape[1]))
        record[:, UNTIL], record[:, TIME], record[:, STATE:] = until, span.times[0], begin
        carried = self._method.carried if memory is None else lanes.rows(memory)[which]
        params = lanes.own_params()
        params = params if params.ndim == 1 else params[which]
        again = Lanes(
            np.arange(which.size), begin, params, record, block_lanes=lanes.block_lanes, carried=carried
        )
        again.phase[:] = self._phase
        batch = again.batch(span, np.zeros(0))
        observe = in_precision(observe_last, begin.dtype.name, observer_signature)
        self._method.run(self._rhs, observe, batch)
        return again.rows(batch.record)
