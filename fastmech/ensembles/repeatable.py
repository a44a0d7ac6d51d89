"""An ensemble of which some trajectories run again with steps of their own."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.fitting import EXPONENT_ONCE, fit_steps, vibration_frequency
from fastmech.ensembles.lanes import finite_rows
from fastmech.ensembles.problem import Problem
from fastmech.ensembles.richardson import distances
from fastmech.ensembles.solve import Settings, Solution, solve
from fastmech.ensembles.stiffness import total_work
from fastmech.ensembles.stopping import STOP_CODE
from fastmech.kernels.blocks import VECTOR_LANES

Floats = NDArray[np.float64]
Members = NDArray[np.int64]
Flags = NDArray[np.bool_]

#: Step times vibration frequency that small tolerances come to.
SHORT = 0.003


def usable_starts(problem: Problem, starts: Floats, t_end: float, threads: int | None) -> Flags:
    """Which starts (n, dim) have motions until ``t_end`` [s] that steps can follow.

    That is asked once, with steps that all tolerances may come to: it depends on a start alone.

    Raises:
        InputError: the number of threads is wrong.
    """
    usable, c = finite_rows(starts), problem.coefficients
    if c is None:
        return usable
    return usable & ~fit_steps(c, starts, SHORT / vibration_frequency(c), t_end, EXPONENT_ONCE, threads).aside


@dataclass
class Repeatable:
    """What is integrated, and how."""

    problem: Problem
    starts: Floats
    outputs: Floats
    settings: Settings  #: that a calibration has found
    tol: float
    threads: int | None
    shares: Floats = field(init=False)  #: mean fitted steps over the settings', (n,)

    def solve(self, who: Members, dt: Floats, settings: Settings | None = None) -> Solution:
        """A run of some of the trajectories with their own steps."""
        own = replace(settings or self.settings, dt=dt)
        return solve(self.problem.part(who), self.starts[who], self.outputs, own, self.threads)

    def apart(self, a: Solution, b: Solution) -> Floats:
        """Distances (n,); infinite where one has stopped and the other not, or for another reason."""
        apart = distances(a.y, b.y)
        if self.problem.observation.stops:
            apart[a.records[STOP_CODE] != b.records[STOP_CODE]] = np.inf
        return apart

    def work(self, who: Members, dt: Floats) -> float:
        """Right-hand sides of a run, whole vectors of trajectories counted."""
        return total_work(self.settings.method, dt * self.shares[who], self.outputs, VECTOR_LANES)
