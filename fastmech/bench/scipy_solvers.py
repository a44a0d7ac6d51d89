"""SciPy's solvers, with the right-hand side compiled by Numba."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.integrate import solve_ivp

from fastmech.bench.entrant import Entrant, Prepare, Solve
from fastmech.bench.plain import scalar_rhs
from fastmech.bench.problem import Problem
from fastmech.mechanism.coefficients import reduce

#: Method, relative tolerances, and how many trajectories it is given.
RUNS = (
    ("LSODA", (1e-4, 1e-6, 1e-8, 1e-10, 1e-12), 64),
    ("DOP853", (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-13), 64),
    ("Radau", (1e-4, 1e-6), 16),
)


def entrants(problem: Problem) -> Iterator[Entrant]:
    """Every method at its tolerances."""
    for method, tolerances, most in RUNS:
        for tolerance in tolerances:
            yield Entrant(f"SciPy {method}", f"rtol = {tolerance:g}", prepared(method, tolerance), most)


def prepared(method: str, tolerance: float) -> Prepare:
    """One ``solve_ivp`` after the other."""

    def prepare(problem: Problem, threads: int) -> Solve:
        p, span = np.array(reduce(problem.scene)), (0.0, problem.t_end)
        options = {"method": method, "args": (p,), "rtol": tolerance, "atol": 0.1 * tolerance}
        return lambda starts: np.array(
            [solve_ivp(scalar_rhs, span, y0, t_eval=span[1:], **options).y[:, -1] for y0 in starts]
        )

    return prepare
