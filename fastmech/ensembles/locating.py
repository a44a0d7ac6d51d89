"""Where in its step a trajectory stopped.

A stopping condition is looked at after whole steps, so a stop is seen up to a step too late. Here the step in
which that happened is taken again from its begin, shorter and shorter or longer and longer, until the time of
the stop is known to rounding. The shortened steps are those of a one-step method of the order of the run, so
the time of a stop and the state at it have that order too (Hairer, Norsett, Wanner, *Solving ODEs I*,
section II.6), wherever the condition's border is smooth. A condition gives codes, not values, so the interval
is halved: no secant would know better.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.callee import callee
from fastmech.ensembles.failing import Resumption
from fastmech.ensembles.run import Observation
from fastmech.ensembles.spans import Span
from fastmech.ensembles.stopping import STOP_CODE, STOP_TIME
from fastmech.integrators.batch import PHASE, Batch
from fastmech.integrators.explicit import WEIGHTS, Moment, Stepped, step_by_stages, weights_of
from fastmech.integrators.implicit import CALLS, SCHEME, Calls, drive_implicit, inverse_by_elimination
from fastmech.integrators.method import Adams, ImplicitRungeKutta, Method
from fastmech.jit import (
    MATRIX,
    OBSERVER,
    OBSERVER_SIGNATURE,
    RHS,
    VECTOR,
    inlined,
    kernel,
    named_tuple,
)

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Halvings at most: of a step that begins at t = 0, where times have no last digit.
HALVINGS = 60

#: Trajectories that look for the begin of their step together.
TOGETHER = 256


class Search(NamedTuple):
    """Trajectories (n) that have stopped, and where their last steps began."""

    begin: Floats  #: times [s] (n,)
    states: Floats  #: (n, dim)
    params: Floats  #: (n, count)
    observer_params: Floats
    empty: Floats  #: a record of no stop (rows,)
    record: Floats  #: (n, rows); its stops move to where they happened


SEARCH = named_tuple([VECTOR, MATRIX, MATRIX, VECTOR, VECTOR, MATRIX], Search)


@kernel(OBSERVER_SIGNATURE)
def observe_before(t: float, Y: Floats, params: Floats, record: Floats) -> None:
    """Keep time and state, rows 1 and 2.., of every lane until the time in row 0."""
    for i in range(Y.shape[1]):
        if t < record[0, i]:
            record[1, i] = t
            for d in range(Y.shape[0]):
                record[2 + d, i] = Y[d, i]


@kernel(types.void(RHS, OBSERVER, WEIGHTS, SEARCH))
def halve_steps(rhs: Any, observe: Any, weights: Any, of: Search) -> None:
    """Find the stops of a search by an explicit one-step method of these weights."""
    (n, dim), count = of.states.shape, of.params.shape[1]
    Y, own, seen = np.empty((dim, 1)), np.empty((count, 1)), np.empty((of.empty.size, 1))
    stages = np.empty((weights.nodes.size + 2, dim, 1))
    block = Stepped(Y, own, np.empty((0, dim, 1)), stages)
    for i in range(n):
        for row in range(count):
            own[row, 0] = of.params[i, row]
        begin, low, high = of.begin[i], of.begin[i], of.record[i, STOP_TIME]
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
            for d in range(dim):
                Y[d, 0] = of.states[i, d]
            for row in range(of.empty.size):
                seen[row, 0] = of.empty[row]
            rhs(begin, Y, stages[0], own)
            step_by_stages(rhs, weights, block, Moment(begin, middle - begin, 0, False))
            observe(middle, Y, of.observer_params, seen)
            low, high = _narrowed(of, i, seen, (low, middle, high))


@kernel(types.void(CALLS, SCHEME, SEARCH))
def halve_implicit_steps(call: Any, scheme: Any, of: Search) -> None:
    """The same by an implicit method.

    A shortened step of which Newton's iteration finds no solution counts as one that does not reach the stop.
    """
    (n, dim), count, stages = of.states.shape, of.params.shape[1], scheme.nodes.shape[0]
    failed = np.empty((1, 1))
    batch = Batch(
        np.empty(2), np.ones(1, dtype=np.int64), np.empty((1, count, 1)), of.observer_params,
        np.empty((1, dim, 1)), np.empty((1, of.empty.size, 1)), np.empty((1, 1, dim, 1)),
        np.empty((1, (stages + 1) * dim, 1)), np.zeros(PHASE),
    )  # fmt: skip
    for i in range(n):
        for row in range(count):
            batch.params[0, row, 0] = of.params[i, row]
        low, high = of.begin[i], of.record[i, STOP_TIME]
        batch.times[0] = low
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
            batch.times[1], batch.phase[0], failed[0, 0] = middle, 0.0, np.nan
            for d in range(dim):
                batch.Y[0, d, 0] = of.states[i, d]
            for row in range(batch.memory.shape[1]):
                batch.memory[0, row, 0] = 0.0
            for row in range(of.empty.size):
                batch.record[0, row, 0] = of.empty[row]
            drive_implicit(call, scheme, batch, failed)
            low, high = _narrowed(of, i, batch.record[0], (low, middle, high))


@inlined
def _narrowed(of: Search, i: int, seen: Floats, times: tuple[float, float, float]) -> tuple[float, float]:
    """Where trajectory ``i`` stops, after a step to the middle one of three times."""
    low, middle, high = times
    if seen[STOP_CODE, 0] == 0.0:
        return middle, high
    for row in range(of.empty.size):
        of.record[i, row] = seen[row, 0]
    return low, middle


def locate_stops(
    rhs: Any,
    observation: Observation,
    method: Method,
    before: Resumption,
    span: Span,
    which: NDArray[np.int64],
    record: Floats,
) -> Floats:
    """Records (n, rows) of trajectories that stopped in a call, with code, time and state of the stop itself.

    ``which`` (n,) are their places among the lanes as they were ``before`` the call, ``record`` (n, rows) is
    what was seen after a whole step. The state before that step is not kept on the way, where it would cost
    every trajectory: those that stopped go through the call once more.
    """
    located = np.ascontiguousarray(record)
    for first in range(0, which.size, TOGETHER):
        part = which[first : first + TOGETHER]
        found = located[first : first + TOGETHER]
        begin, states = _step_begins(rhs, method, before, span, part, found[:, STOP_TIME])
        own = np.ascontiguousarray(before.params(part))
        search = Search(begin, states, own, observation.params, observation.record, found)
        if isinstance(method, ImplicitRungeKutta):
            functions = rhs, rhs, inverse_by_elimination, observation.observe
            scheme = method.tableau.scheme._replace(differences=True)
            halve_implicit_steps(Calls(*map(callee, functions)), scheme, search)
        else:
            one_step: Any = method
            tableau = method.starter if isinstance(method, Adams) else one_step.tableau
            halve_steps(callee(rhs), callee(observation.observe), weights_of(tableau), search)
    return located


def _step_begins(
    rhs: Any, method: Method, before: Resumption, span: Span, which: NDArray[np.int64], stop_time: Floats
) -> tuple[Floats, Floats]:
    """Times (n,) and states (n, dim) before the steps that end at ``stop_time``; by the same arithmetic."""
    begin = before.states(which)
    record = np.empty((which.size, 2 + begin.shape[1]))
    record[:, 0], record[:, 1], record[:, 2:] = stop_time, span.times[0], begin
    seen = before.watched(rhs, observe_before, method, span, which, begin, record)
    return np.ascontiguousarray(seen[:, 1]), np.ascontiguousarray(seen[:, 2:])
