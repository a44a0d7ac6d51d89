"""pynamicalsys: its RK4, a trajectory a call."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fastmech.bench.entrant import Entrant, Prepare, Solve
from fastmech.bench.plain import scalar_rhs
from fastmech.bench.problem import Problem
from fastmech.mechanism.coefficients import reduce

#: The module that this file needs.
NEEDS = "pynamicalsys"

STEPS = (0.05, 0.02, 0.01)


def entrants(problem: Problem) -> Iterator[Entrant]:
    """RK4 at some steps."""
    for dt in STEPS:
        h = dt * problem.pace
        yield Entrant("pynamicalsys rk4", f"dt = {h:g} s", prepared(h), most=256)


def prepared(h: float) -> Prepare:
    """RK4 at one step."""

    def prepare(problem: Problem, threads: int) -> Solve:
        from pynamicalsys import ContinuousDynamicalSystem

        p = np.array(reduce(problem.scene))
        steps = round(problem.t_end / h)
        system = ContinuousDynamicalSystem(
            equations_of_motion=scalar_rhs, system_dimension=4, parameters=p, number_of_parameters=p.size
        )
        system.integrator("rk4", time_step=problem.t_end / steps)
        end = problem.t_end - problem.t_end / steps  # it adds a step to the time that it is given
        return lambda starts: np.array([system.evolve_system(y0, end) for y0 in starts])

    return prepare
