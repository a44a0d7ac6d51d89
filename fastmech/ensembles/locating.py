"""Where in its step a trajectory stopped.

A stopping condition is looked at after whole steps, so a stop is seen up to a step too late. Here the step in
which that happened is taken again from its begin, shorter and shorter or longer and longer, until the time of
the stop is known to rounding. The shortened steps are those of a one-step method of the order of the run, so
the time of a stop and the state at it have that order too (Hairer, Norsett, Wanner, *Solving ODEs I*,
section II.6), wherever the condition's border is smooth. A condition gives codes, not values, so the interval
is halved: no secant would know better.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.callee import callee
from fastmech.ensembles.failing import Resumption
from fastmech.ensembles.run import Observation
from fastmech.ensembles.spans import Span
from fastmech.ensembles.stopping import STOP_CODE, STOP_TIME
from fastmech.integrators.batch import PHASE
from fastmech.integrators.explicit import WEIGHTS, Moment, Stepped, step_by_stages, weights_of
from fastmech.integrators.implicit import integrate_implicit_block
from fastmech.integrators.implicit_method import ImplicitRungeKutta
from fastmech.integrators.method import Adams, Method
from fastmech.integrators.newton import DIFFERENCES
from fastmech.jit import MATRIX, OBSERVER, OBSERVER_SIGNATURE, RHS, VECTOR, kernel

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Halvings at most: of a step that begins at t = 0, where times have no last digit.
HALVINGS = 60

#: Trajectories that look for the begin of their step together.
TOGETHER = 256

_SEARCH = (VECTOR, MATRIX, MATRIX, VECTOR, VECTOR, MATRIX)


@kernel(OBSERVER_SIGNATURE)
def observe_before(t: float, Y: Floats, params: Floats, record: Floats) -> None:
    """Keep time and state, rows 1 and 2.., of every lane until the time in row 0."""
    for i in range(Y.shape[1]):
        if t < record[0, i]:
            record[1, i] = t
            for d in range(Y.shape[0]):
                record[2 + d, i] = Y[d, i]


@kernel(types.void(RHS, OBSERVER, WEIGHTS, *_SEARCH))
def halve_steps(
    rhs: Any,
    observe: Any,
    weights: Any,
    begin: Floats,
    states: Floats,
    params: Floats,
    observer_params: Floats,
    empty: Floats,
    record: Floats,
) -> None:
    """Move the stops in ``record`` (n, rows) to where they happened, by an explicit one-step method.

    ``begin`` (n,) and ``states`` (n, dim) are where each trajectory's last step began, ``params`` (n, count)
    its parameters, ``empty`` (rows,) a record of no stop, ``weights`` the method's.
    """
    n, dim = states.shape
    Y, own, seen = np.empty((dim, 1)), np.empty((params.shape[1], 1)), np.empty((empty.size, 1))
    stages = np.empty((weights.nodes.size + 2, dim, 1))
    block = Stepped(Y, own, np.empty((0, dim, 1)), stages)
    for i in range(n):
        for row in range(params.shape[1]):
            own[row, 0] = params[i, row]
        low, high = begin[i], record[i, STOP_TIME]
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
            for d in range(dim):
                Y[d, 0] = states[i, d]
            for row in range(empty.size):
                seen[row, 0] = empty[row]
            rhs(begin[i], Y, stages[0], own)
            step_by_stages(rhs, weights, block, Moment(begin[i], middle - begin[i], 0, False))
            observe(middle, Y, observer_params, seen)
            if seen[STOP_CODE, 0] != 0.0:
                high = middle
                for row in range(empty.size):
                    record[i, row] = seen[row, 0]
            else:
                low = middle


@kernel(
    types.void(
        RHS,
        OBSERVER,
        MATRIX,
        VECTOR,
        VECTOR,
        MATRIX,
        MATRIX,
        VECTOR,
        MATRIX,
        types.float64,
        types.int64,
        *_SEARCH,
    )
)
def halve_implicit_steps(
    rhs: Any,
    observe: Any,
    a: Floats,
    nodes: Floats,
    final: Floats,
    back: Floats,
    forth: Floats,
    eigenvalues: Floats,
    extrapolation: Floats,
    remainder: float,
    carried: int,
    begin: Floats,
    states: Floats,
    params: Floats,
    observer_params: Floats,
    empty: Floats,
    record: Floats,
) -> None:
    """The same by an implicit method: see :func:`halve_steps`; ``a`` to ``carried`` are its tableau.

    A shortened step of which Newton's iteration finds no solution counts as one that does not reach the stop.
    """
    n, dim = states.shape
    Y, out = np.empty((dim, 1)), np.empty((1, dim, 1))
    own, seen = np.empty((params.shape[1], 1)), np.empty((empty.size, 1))
    times, steps, failed = np.empty(2), np.ones(1, dtype=np.int64), np.empty(1)
    memory, phase = np.empty((carried * dim, 1)), np.zeros(PHASE)
    for i in range(n):
        own[:, 0] = params[i]
        low, high = begin[i], record[i, STOP_TIME]
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
            times[0], times[1] = begin[i], middle
            Y[:, 0], seen[:, 0], failed[0] = states[i], empty, np.nan
            memory[:], phase[:] = 0.0, 0.0
            integrate_implicit_block(
                rhs, rhs, observe, DIFFERENCES, a, nodes, final, back, forth, eigenvalues, extrapolation,
                remainder, times, steps, Y, own, observer_params, seen, out, failed, memory, phase,
            )  # fmt: skip
            if seen[STOP_CODE, 0] != 0.0:
                high = middle
                record[i] = seen[:, 0]
            else:
                low = middle


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
        called = callee(rhs), callee(observation.observe)
        search = (begin, states, own, observation.params, observation.record, found)
        if isinstance(method, ImplicitRungeKutta):
            p = method.tableau.prepared
            halve_implicit_steps(
                *called, p.a, p.nodes, p.final, p.back, p.forth, p.eigenvalues,
                p.extrapolation, p.remainder, method.carried, *search,
            )  # fmt: skip
        else:
            one_step: Any = method
            tableau = method.starter if isinstance(method, Adams) else one_step.tableau
            halve_steps(*called, weights_of(tableau), *search)
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
