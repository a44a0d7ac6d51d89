"""What takes part in the benchmark: one integrator at one setting."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.bench.problem import Problem

Floats = NDArray[np.float64]

#: Starts (n, 4) to final states (n, 4): what is timed.
Solve = Callable[[Floats], Floats]

#: Makes a ``Solve`` for a problem and a number of threads: compiling and tables, not timed as speed.
Prepare = Callable[[Problem, int], Solve]


class Entrant(NamedTuple):
    """One integrator at one setting."""

    family: str  #: integrator; its settings make one curve
    setting: str  #: step or tolerance
    prepare: Prepare
    most: int = 32768  #: trajectories a call at most; slow integrators are given the first few
    least: int = 1  #: trajectories a call at least: a batch that needs them to be at its best
    threaded: bool = False  #: whether it also enters on all cores


class Series(NamedTuple):
    """One integrator at its settings."""

    family: str
    setting: str  #: ``dt = {:g} s`` or ``rtol = {:g}``: steps are scaled by a problem's pace
    values: tuple[float, ...]
    prepare: Callable[[Problem, int, float], Solve]  #: for a problem, a number of threads and a value
    most: int = 32768
    least: int = 1

    def entrants(self, problem: Problem) -> Iterator[Entrant]:
        """One for each value."""
        for value in self.values:
            x = value * problem.pace if self.setting.startswith("dt") else value

            def prepare(problem: Problem, threads: int, x: float = x) -> Solve:
                return self.prepare(problem, threads, x)

            yield Entrant(self.family, self.setting.format(x), prepare, self.most, self.least)
