"""Where rounding rules: a typical one of several runs, and its distance from their median as its error.

There a run differs from another by about as much as each does from the truth, or by luck far less. So the
truth is taken to be the median of several runs, each state's for itself, and what is kept is no run that is
near it by luck but a typical one. They are runs of a one-step method, which rounds less than an Adams method.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.calibration import CALM
from fastmech.ensembles.places import part_of
from fastmech.ensembles.repeatable import Floats, Members, Repeatable
from fastmech.ensembles.richardson import RATIO, distances
from fastmech.ensembles.solve import Solution
from fastmech.ensembles.stiffness import total_work
from fastmech.ensembles.stopping import STOP_CODE
from fastmech.integrators.methods import find_method
from fastmech.kernels.blocks import VECTOR_LANES

#: Longest step of :data:`fastmech.ensembles.calibration.CALM` in an Adams method's, runs of it, and which of
#: them is kept, the nearest to their median being 0.
LONGER, RUNS, TYPICAL = RATIO**3, 6, 3

#: States of a part of the trajectories: so many times RUNS are in memory at a time.
PART = 2**16


@dataclass(frozen=True)
class Typical:
    """Some of the trajectories with the same run of the several, and their errors."""

    who: Members
    run: Solution
    error: Floats  #: infinite where not all runs are finite and stop alike


def typical_runs(of: Repeatable, which: Members) -> Iterator[Typical]:
    """A typical run of each of the trajectories, in parts."""
    size = max(VECTOR_LANES, PART // (of.outputs.size * of.starts.shape[1]))
    calm = replace(of.settings, method=find_method(CALM))
    for begin in range(0, which.size, size):
        who = which[begin : begin + size]
        runs = [of.solve(who, np.full(who.size, dt), calm) for dt in _steps(of)]
        truth = np.median([run.y for run in runs], axis=0)
        errors = np.array([distances(run.y, truth) for run in runs])
        if of.problem.observation.stops:
            codes = np.array([run.records[STOP_CODE] for run in runs])
            errors[:, (codes != codes[0]).any(axis=0)] = np.inf
        typical = np.argsort(errors, axis=0, kind="stable")[TYPICAL]
        for k, run in enumerate(runs):
            chosen: NDArray[np.bool_] = typical == k
            yield Typical(who[chosen], part_of(run, chosen), errors[k, chosen])


def typical_work(of: Repeatable, which: Members) -> float:
    """Right-hand sides of all these runs."""
    calm, shares = find_method(CALM), of.shares[which]
    return sum(total_work(calm, dt * shares, of.outputs, VECTOR_LANES) for dt in _steps(of))


def _steps(of: Repeatable) -> list[float]:
    """Of the several runs [s], before they are fitted."""
    longest = float(of.settings.dt) * (LONGER if of.settings.method.start_steps else 1.0)
    return [longest / RATIO**k for k in range(RUNS)]
