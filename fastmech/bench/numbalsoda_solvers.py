"""numbalsoda: LSODA and DOP853 called from one Numba loop over the trajectories."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
from numba import carray, cfunc, njit, types  # type: ignore[attr-defined]

from fastmech.bench.entrant import Entrant, Prepare, Solve
from fastmech.bench.plain import accelerations
from fastmech.bench.problem import Problem
from fastmech.jit import FLAGS
from fastmech.mechanism.coefficients import Coefficients, reduce

#: The module that this file needs.
NEEDS = "numbalsoda"

TOLERANCES = {
    "dop853": (1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-13),
    "lsoda": (1e-5, 1e-7, 1e-9, 1e-11),
}

_COUNT = len(Coefficients._fields)
_POINTER = types.CPointer(types.float64)  # type: ignore[no-untyped-call]


def entrants(problem: Problem) -> Iterator[Entrant]:
    """Both solvers at their tolerances."""
    for method, tolerances in TOLERANCES.items():
        for tolerance in tolerances:
            prepare = prepared(method, tolerance)
            yield Entrant(f"numbalsoda {method}", f"rtol = {tolerance:g}", prepare, most=1024)


@cache
def compiled(method: str) -> Any:
    """A solver's loop and the address of the right-hand side."""
    import numbalsoda

    solver = getattr(numbalsoda, method)

    @cfunc(types.void(types.float64, _POINTER, _POINTER, _POINTER), **FLAGS)
    def rhs(t, y, dy, data):  # type: ignore[no-untyped-def]
        dy[0], dy[1] = y[2], y[3]
        dy[2], dy[3] = accelerations(y[0], y[1], y[2], y[3], carray(data, (_COUNT,)))

    @njit(nogil=True, **FLAGS)
    def loop(address, starts, times, p, tolerance):  # type: ignore[no-untyped-def]
        final = np.empty_like(starts)
        for i in range(len(starts)):
            found, _ = solver(address, starts[i], times, p, tolerance, 0.1 * tolerance, 1000000)
            final[i] = found[-1]
        return final

    return loop, rhs


def prepared(method: str, tolerance: float) -> Prepare:
    """A solver at one tolerance."""

    def prepare(problem: Problem, threads: int) -> Solve:
        loop, rhs = compiled(method)
        p, times = np.array(reduce(problem.scene)), np.array([0.0, problem.t_end])
        return lambda starts: loop(rhs.address, starts, times, p, tolerance)

    return prepare
