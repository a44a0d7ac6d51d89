"""Outputs that are closer than steps: states between them by Hermite's interpolation.

Where a tolerance allows steps longer than the intervals between outputs, the run takes equal steps over its
whole time. A polynomial through the states and their derivatives at ``k`` neighbouring steps, of degree
2 k - 1 (Stoer, Bulirsch, *Introduction to Numerical Analysis*, section 2.1.5), gives the outputs; k is such
that its error is far below the method's.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from fastmech.arrays import Floats
from fastmech.ensembles.fitting import EXPONENT_ONCE, fit_steps
from fastmech.ensembles.problem import Case, Problem
from fastmech.ensembles.run import Progress
from fastmech.ensembles.solve import Settings, Solution, nothing, put_into, solve

#: Steps between outputs, on average, from which on steps end at the outputs. With fewer, two runs with steps
#: that differ by sqrt(2) could have the same ones: 2.13 are enough for one step more.
STEPS_BETWEEN = 2.2


def solve_at(case: Case, settings: Settings, progress: Progress | None = None) -> Solution:
    """Integrate from t = 0; states are interpolated where output times [s] are closer than steps.

    Not so with a stopping condition, or where steps are shorter at first than later.
    """
    problem, starts, outputs, threads = case
    until = float(outputs[-1])
    few = outputs.size * STEPS_BETWEEN * np.asarray(settings.dt) <= until
    if problem.observation.stops or settings.early or until == 0.0 or np.all(few):
        return solve(case, settings, progress)
    steps: Any = np.broadcast_to(np.asarray(settings.dt, dtype=np.float64), len(starts))
    if settings.fit and problem.coefficients is not None:
        fitted = fit_steps(problem.coefficients, starts, 1.0, until, EXPONENT_ONCE, threads=threads)
        steps = steps * fitted.shares
    found: Solution | None = None
    for length in np.unique(steps):
        who = np.flatnonzero(steps == length)
        own = replace(settings, dt=float(length), fit=())
        part = case.part(who)
        if outputs.size * STEPS_BETWEEN * length <= until:
            run = solve(part, own, progress)
        else:
            run = _interpolated(part, own, progress)
        if found is None:
            if who.size == len(starts):
                return run
            found = nothing(problem, outputs.size, *starts.shape)
        put_into(found, who, run)
    return solve(case, settings, progress) if found is None else found


def _interpolated(case: Case, settings: Settings, progress: Progress | None) -> Solution:
    """The same with equal steps of all trajectories, over the whole run."""
    problem, starts, outputs, _ = case
    until, nodes = float(outputs[-1]), (settings.method.order + 5) // 2
    number = max(math.ceil(until / float(settings.dt) * (1.0 - 1e-12)), nodes - 1)
    grid = until / number * np.arange(number + 1.0)
    grid[-1] = until
    run = solve(case._replace(outputs=grid), settings, progress)
    rates = _rates(problem, grid, run.y)
    y = np.empty((outputs.size, *starts.shape))
    for state, t in zip(y, outputs, strict=True):
        first, values, slopes = _weights(t / until * number, number, nodes)
        state[...] = 0.0
        for node, value, slope in zip(range(first, first + nodes), values, slopes, strict=True):
            # Not by a product of matrices, whose sums' order depends on how many trajectories there are.
            state += value * run.y[node]
            state += (until / number * slope) * rates[node]
    return replace(run, y=y)


def _weights(place: float, last: int, nodes: int) -> tuple[int, Floats, Floats]:
    """Weights of values and of slopes at the ``nodes`` around a place on the grid 0, 1, ..., ``last``.

    The first of the nodes comes before them.
    """
    first = min(max(math.floor(place) - (nodes - 1) // 2, 0), last + 1 - nodes)
    x, k = place - first, np.arange(float(nodes))
    apart = k[:, None] - k
    np.fill_diagonal(apart, 1.0)
    factors = np.broadcast_to(x - k, apart.shape).copy()
    np.fill_diagonal(factors, 1.0)
    square = np.prod(factors / apart, axis=1) ** 2
    np.fill_diagonal(apart, np.inf)
    slope = (1.0 / apart).sum(axis=1)  # of Lagrange's polynomials at their own nodes
    return first, (1.0 - 2.0 * (x - k) * slope) * square, (x - k) * square


def _rates(problem: Problem, times: Floats, y: Floats) -> Floats:
    """Derivatives of public states (times, n, dim)."""
    problem = problem.public
    rates, params = np.empty_like(y), problem.params.block(y.shape[1])
    into = np.empty((y.shape[2], y.shape[1]))
    for t, states, found in zip(times, y, rates, strict=True):
        problem.rhs(float(t), np.ascontiguousarray(states.T), into, params)
        found[...] = into.T
    return rates
