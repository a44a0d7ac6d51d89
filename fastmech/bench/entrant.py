"""What takes part in the benchmark: one integrator at one setting."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastmech.bench.problem import Problem

Floats = NDArray[np.float64]

#: Starts (n, 4) to final states (n, 4): what is timed.
Solve = Callable[[Floats], Floats]

#: Makes a ``Solve`` for a problem and a number of threads: compiling and tables, not timed as speed.
Prepare = Callable[[Problem, int], Solve]


@dataclass(frozen=True)
class Entrant:
    """One integrator at one setting."""

    family: str  #: integrator; its settings make one curve
    setting: str  #: step or tolerance
    prepare: Prepare
    most: int = 32768  #: trajectories a call at most; slow integrators are given the first few
    least: int = 1  #: trajectories a call at least: a batch that needs them to be at its best
    threaded: bool = False  #: whether it also enters on all cores
