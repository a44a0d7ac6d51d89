"""What is timed: every method of the package, and what a user would write without it.

An entrant takes the problem's starts and gives final states. Each runs on one thread; the entrants of the
package also on all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from fastmech.bench.problem import Problem, scalar_rhs
from fastmech.ensembles.integrate import integrate
from fastmech.jit import FLAGS
from fastmech.mechanism.coefficients import reduce

Floats = NDArray[np.float64]

jitted_rhs = njit(**FLAGS)(scalar_rhs)

#: Steps [s] at which each method of the package enters.
STEPS = {
    "rk4": (0.05, 0.02, 0.01, 0.005),
    "tsit5": (0.1, 0.05, 0.02, 0.01),
    "dopri5": (0.1, 0.05, 0.02, 0.01),
    "dop853": (0.2, 0.1, 0.05, 0.025, 0.0125),
    "hairer10": (0.1, 0.05, 0.025),
    "ab6": (0.02, 0.0125, 0.00625),
    "abm12": (0.0125, 0.01, 0.00625, 0.0045),
}


@dataclass(frozen=True)
class Entrant:
    """One integrator at one setting."""

    family: str  #: integrator
    setting: str  #: step or tolerance
    share: float  #: share of the ensemble that it is given: slow ones get fewer trajectories
    run: Callable[[Problem, Floats, int], Floats]  #: (problem, starts, threads) -> final states
    threaded: bool = False


@njit(nogil=True, **FLAGS)  # type: ignore[untyped-decorator]
def one_at_a_time(starts: Floats, p: Floats, h: float, steps: int) -> Floats:
    """RK4 as most users write it in numba: one trajectory after the other."""
    final = np.empty_like(starts)
    for i in range(len(starts)):
        y = starts[i].copy()
        for step in range(steps):
            k1 = jitted_rhs(step * h, y, p)
            k2 = jitted_rhs(step * h, y + 0.5 * h * k1, p)
            k3 = jitted_rhs(step * h, y + 0.5 * h * k2, p)
            k4 = jitted_rhs(step * h, y + h * k3, p)
            y = y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        final[i] = y
    return final


def entrants() -> Iterator[Entrant]:
    """Every entrant, the package's first."""
    for method, steps in STEPS.items():
        for h in steps:
            yield Entrant(f"fastmech {method}", f"dt = {h:g} s", 1.0, _package(method, h), threaded=True)
    for h in STEPS["rk4"]:
        yield Entrant("numba RK4, one at a time", f"dt = {h:g} s", 0.25, _plain(h))
    for method, tolerances in (("LSODA", (1e-6, 1e-9)), ("DOP853", (1e-6, 1e-9)), ("Radau", (1e-6,))):
        for tolerance in tolerances:
            yield Entrant(f"SciPy {method}", f"rtol = {tolerance:g}", 1 / 32, _scipy(method, tolerance))


def _package(method: str, h: float) -> Callable[[Problem, Floats, int], Floats]:
    def run(problem: Problem, starts: Floats, threads: int) -> Floats:
        return integrate(problem.scene, starts, problem.t_end, dt=h, method=method, threads=threads).y[-1]

    return run


def _plain(h: float) -> Callable[[Problem, Floats, int], Floats]:
    def run(problem: Problem, starts: Floats, threads: int) -> Floats:
        final: Floats = one_at_a_time(starts, np.array(reduce(problem.scene)), h, round(problem.t_end / h))
        return final

    return run


def _scipy(method: str, tolerance: float) -> Callable[[Problem, Floats, int], Floats]:
    def run(problem: Problem, starts: Floats, threads: int) -> Floats:
        p, span = np.array(reduce(problem.scene)), (0.0, problem.t_end)
        solve = [
            solve_ivp(jitted_rhs, span, y0, method=method, args=(p,), rtol=tolerance, atol=tolerance * 1e-2)
            for y0 in starts
        ]
        return np.array([solution.y[:, -1] for solution in solve])

    return run
