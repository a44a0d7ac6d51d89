"""CyRK: its C++ solvers called from one Numba loop over the trajectories."""

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
NEEDS = "CyRK"

TOLERANCES = {
    "DOP853": (1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-13),
    "TSIT5": (1e-3, 1e-5, 1e-7),
}

_COUNT = len(Coefficients._fields)
_POINTER = types.CPointer(types.float64)  # type: ignore[no-untyped-call]


def entrants(problem: Problem) -> Iterator[Entrant]:
    """Methods at their tolerances."""
    for method, tolerances in TOLERANCES.items():
        for tolerance in tolerances:
            prepare = prepared(method, tolerance)
            yield Entrant(f"CyRK {method}", f"rtol = {tolerance:g}", prepare, most=1024)


@cache
def compiled() -> Any:
    """The loop and the address of the right-hand side."""
    from CyRK import nbsolve2_ivp

    @cfunc(types.void(_POINTER, types.float64, _POINTER, _POINTER), **FLAGS)
    def rhs(dy, t, y, data):  # type: ignore[no-untyped-def]
        dy[0], dy[1] = y[2], y[3]
        dy[2], dy[3] = accelerations(y[0], y[1], y[2], y[3], carray(data, (_COUNT,)))

    @njit(nogil=True, **FLAGS)
    def loop(address, starts, t_end, p, method, tolerance):  # type: ignore[no-untyped-def]
        final = np.empty_like(starts)
        span, times = (0.0, t_end), np.array([t_end])
        for i in range(len(starts)):
            found = nbsolve2_ivp(
                address, span, starts[i], method=method, t_eval=times, args=p,
                rtol=tolerance, atol=0.1 * tolerance, max_num_steps=1000000, force_retain_solver=False,
            )  # fmt: skip
            final[i] = found.y[:, -1]
            found.free()
        return final

    return loop, rhs


def prepared(method: str, tolerance: float) -> Prepare:
    """A method at one tolerance."""

    def prepare(problem: Problem, threads: int) -> Solve:
        loop, rhs = compiled()
        p = np.array(reduce(problem.scene))
        return lambda starts: loop(rhs.address, starts, problem.t_end, p, method, tolerance)

    return prepare
