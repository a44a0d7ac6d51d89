"""A tolerance for systems whose right-hand sides have branches.

Every trajectory runs twice with steps that end where branches are passed
(:mod:`fastmech.ensembles.located`), the second time with smaller errors of its steps. Where the two are
apart by no more than the tolerance the second is kept, and their distance, which is nearly the error of the
first, is taken for its error. Else a third is compared with the second, and so on. What is not settled so
has no error that is known.
"""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.callee import callee
from fastmech.ensembles.lanes import finite_rows
from fastmech.ensembles.located import COSTS, ENDED, GRAZES, SINGULAR, SLIDES, UNCLEAR, Course, follow
from fastmech.ensembles.problem import Case
from fastmech.ensembles.run import Progress
from fastmech.ensembles.solve import Settings, Solution, distances, nothing, part_of, put_into, solve
from fastmech.ensembles.status import missed_line
from fastmech.ensembles.threads import in_threads, thread_count
from fastmech.integrators.methods import find_method
from fastmech.interrupts import check

Floats = NDArray[np.float64]
Members = NDArray[np.int64]

#: Error of a step in the first run over the tolerance, how many times smaller it is in the next one, the
#: least one, and runs at most.
FIRST, FINER, LEAST, RUNS = 0.01, 32.0, 1e-14, 5

#: Steps of a run at least.
FEW = 64.0

#: What steps where branches are located.
METHOD = "dopri5"

#: Steps that a trajectory may take, and those of all of them.
MOST, MOST_TOGETHER = 2**17, 2**22

#: Trajectories that a thread follows at a time.
TOGETHER = 8

#: Steps of a run, at least and at most, of trajectories that cannot be followed through their branches.
GIVEN_UP = (2.0**10, 2.0**17)

WHY = {
    ENDED: "finer runs stay apart (chaos, a start on a basin's border)",
    SLIDES: "slides along a branch's border",
    GRAZES: "touches a branch's border",
    COSTS: "shorter steps would cost too much",
    SINGULAR: "no step is short enough",
    UNCLEAR: "too many decisions in one call",
}


def follow_to_tolerance(
    case: Case, switches: Any, tol: float, progress: Progress | None
) -> tuple[Solution, Floats, str]:
    """The solution, errors (n,), infinite where none is known, and what is to be said about those.

    ``switches`` notes the decisions of the right-hand side, see :mod:`fastmech.ensembles.switches`.
    """
    problem, starts, outputs, _ = case
    n, usable = len(starts), finite_rows(starts)
    error, ended = np.full(n, np.inf), np.full(n, ENDED)
    last, best = None, nothing(problem, outputs.size, *starts.shape)
    who = np.flatnonzero(usable)
    if progress is not None:
        progress(n - who.size)
    for k in range(RUNS):
        local = max(FIRST * tol / FINER**k, LEAST)
        finer, ended[who] = _follow(case.part(who), switches, local, progress)
        put_into(best, who, finer)
        open_ = ended[who] == ENDED
        if last is not None:
            apart = distances(last, finer)
            kept = open_ & (apart <= tol)
            error[who[kept]] = apart[kept]
            open_ &= ~kept
        who, last, progress = who[open_], part_of(finer, open_), None
        if not who.size:
            break
    lost = np.flatnonzero(ended != ENDED)
    if lost.size or not usable.all():
        # What cannot be followed is integrated as if there were no branches.
        other = np.union1d(lost, np.flatnonzero(~usable))
        steps = np.exp2(np.ceil(np.log2(np.clip(best.steps[other], *GIVEN_UP))))
        settings = Settings(find_method(METHOD), float(outputs[-1]) / steps)
        given_up = solve(case.part(other), settings)
        put_into(best, other, given_up)
    missed = usable & np.isinf(error)
    return best, error, missed_line(missed, {why: missed & (ended == code) for code, why in WHY.items()})


def _follow(case: Case, switches: Any, local: float, progress: Progress | None) -> tuple[Solution, Members]:
    """The trajectories with so large errors of their steps, and what became of each."""
    problem, starts, outputs, threads = case
    n, seen = len(starts), problem.observation
    solution = nothing(problem, outputs.size, *starts.shape)
    steps = min(MOST, max(MOST_TOGETHER // max(n, 1), int(GIVEN_UP[0])))
    course = Course(
        starts=np.ascontiguousarray(starts),
        params=np.ascontiguousarray(problem.params.block(n).T),
        outputs=outputs,
        observer_params=seen.params,
        empty=seen.record,
        limits=np.array([float(outputs[-1]) / FEW, steps, local]),
        y=solution.y,
        records=np.ascontiguousarray(solution.records.T),
        told=np.zeros((n, 2)),
        ended=np.full(n, ENDED),
    )
    called = callee(problem.rhs), callee(switches), callee(seen.observe)

    def part(first: int) -> int:
        check()
        last = min(first + TOGETHER, n)
        follow(*called, course, first, last)
        return last - first

    firsts = list(range(0, n, TOGETHER))
    workers = min(thread_count(threads), len(firsts))
    for finished in in_threads(part, firsts, workers, threading.Event()):
        if progress is not None:
            progress(finished)
    solution.records[...] = course.records.T
    solution.steps[...], solution.dt[0] = course.told.T
    return solution, course.ended
