"""Some of a solution's trajectories, and how they take the places of another run's."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.solve import Solution

Members = NDArray[np.int64]


def part_of(solution: Solution, who: NDArray[np.int64] | NDArray[np.bool_]) -> Solution:
    """Some of a solution's trajectories."""
    s = solution
    last = None if s.last is None else s.last[who]
    return Solution(
        s.y[:, who],
        s.records[:, who],
        s.status[who],
        s.steps[who],
        s.dt[:, who],
        s.failed[who],
        last,
        s.last_term[who] if s.last_term.size else s.last_term,
    )


def put_into(best: Solution, which: Members, run: Solution, part: NDArray[np.bool_]) -> None:
    """Put some trajectories of a run into the places ``which`` of the solution."""
    for old, new in ((best.y, run.y), (best.records, run.records), (best.dt, run.dt)):
        old[:, which] = new[:, part]
    best.status[which], best.steps[which] = run.status[part], run.steps[part]
    best.failed[which] = run.failed[part]
    if best.last is not None or run.last is not None:
        best.last = best.y[-1].copy() if best.last is None else best.last
        best.last[which] = (run.y[-1] if run.last is None else run.last)[part]
