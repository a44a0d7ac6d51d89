"""Timing: everyone is prepared first, then timed in turns, so that a busy machine disturbs all alike.

Rates are trajectories per second of processor time, all threads of the process together: on a quiet machine
that is wall time on one thread, on a busy one the time spent waiting for a core does not count, and an
integrator that secretly takes two threads pays for both. Wall times stand beside them.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fastmech.bench.problem import Entrant, Floats, Problem, Solve
from fastmech.ensembles.run import Progress
from fastmech.reports import Stage as Stage

#: Processor seconds of timed calls that one entrant is given, and its calls at most.
BUDGET = 0.8
MOST_REPEATS = 7

#: Calls shorter than this [s] are given copies of the starts, up to the entrant's most.
SHORT_CALL = 0.1


@dataclass(frozen=True)
class Row:
    """What one entrant did on one problem."""

    problem: str
    family: str
    setting: str
    threads: int
    trajectories: int  #: in each timed call
    wall: float  #: s, median of timed calls
    processor: float  #: s of processor time, median of timed calls
    first_call: float  #: s, preparing and the first call: compiling or loading included
    errors: NDArray[np.float64] = field(repr=False)  #: largest error of any component, by trajectory

    @property
    def rate(self) -> float:
        """Trajectories per second: of processor time on one thread, of wall time on more."""
        return self.trajectories / (self.processor if self.threads == 1 else self.wall)

    def max_error(self, count: int | None = None) -> float:
        """Largest error of the first ``count`` trajectories, of all known by default."""
        return float(self.errors[:count].max())

    @property
    def median_error(self) -> float:
        """Median over trajectories."""
        return float(np.median(self.errors))


@dataclass
class _Runner:
    """A prepared entrant and its times so far."""

    entrant: Entrant
    threads: int
    solve: Solve
    starts: Floats
    first_call: float
    errors: Floats
    repeats: int
    wall: list[float] = field(default_factory=list)
    processor: list[float] = field(default_factory=list)

    def time(self) -> None:
        wall, processor = time.perf_counter(), time.process_time()
        self.solve(self.starts)
        self.processor.append(time.process_time() - processor)
        self.wall.append(time.perf_counter() - wall)

    def row(self, problem: str) -> Row:
        named = self.entrant.family, self.entrant.setting, self.threads, len(self.starts)
        wall, processor = statistics.median(self.wall), statistics.median(self.processor)
        return Row(problem, *named, wall, processor, self.first_call, self.errors)


def measure(
    problem: Problem,
    everyone: Sequence[tuple[Entrant, int]],
    advance: Progress = lambda done: None,
    failed: Callable[[Entrant, Exception], None] | None = None,
    budget: float = BUDGET,
) -> list[Row]:
    """Time entrants, each with its number of threads; ``advance`` is told 1 twice for each.

    ``budget`` is what each is given [s of processor time]; a call that takes longer is made once. An
    exception of an entrant is raised, or handed to ``failed`` where it is given.
    """
    runners = []
    for entrant, threads in everyone:
        try:
            runners.append(_prepare(problem, entrant, threads, budget))
        except Exception as error:
            if failed is None:
                raise
            failed(entrant, error)
        advance(1)
    for turn in range(MOST_REPEATS):
        for runner in runners:
            if turn < runner.repeats:
                runner.time()
            if turn == 0:
                advance(1)
    return [runner.row(problem.name) for runner in runners]


def _prepare(problem: Problem, entrant: Entrant, threads: int, budget: float) -> _Runner:
    """Compile, warm up, compare with the truth, and decide how often and on how many trajectories to time."""
    n = min(len(problem.starts), entrant.most)
    copies = max(1, -(-entrant.least // n))
    starts = np.tile(problem.starts[:n], (copies, 1))
    began = time.perf_counter()
    solve = entrant.prepare(problem, threads)
    final = solve(starts)
    first_call = time.perf_counter() - began
    errors = np.abs(final[:n] - problem.truth[:n]).max(axis=1)
    errors[~np.isfinite(errors)] = np.inf
    runner = _Runner(entrant, threads, solve, starts, first_call, errors, 0)
    runner.time()
    taken = max(runner.processor[0], 1e-6)
    short = min(SHORT_CALL, budget / MOST_REPEATS)
    more = min(entrant.most // len(starts), int(np.ceil(short / taken)))
    if more > 1:
        runner.starts = np.tile(starts, (more, 1))
        runner.wall.clear()
        runner.processor.clear()
        taken *= more
    runner.repeats = int(np.clip(budget / taken, 1, MOST_REPEATS)) - len(runner.wall)
    return runner


#: Largest errors [rad, rad/s] at which integrators are compared.
TARGETS = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13)


def frontier(rows: Iterable[Row], count: int | None = None) -> list[Row]:
    """Settings that no other beats in both speed and error, the most accurate first."""
    best: list[Row] = []
    # Errors that differ by rounding alone are equal.
    for row in sorted(rows, key=lambda row: (float(f"{row.max_error(count):.2e}"), -row.rate)):
        if np.isfinite(row.max_error(count)) and (not best or row.rate > best[-1].rate):
            best.append(row)
    return best


def rate_at(rows: Iterable[Row], error: float, count: int | None = None) -> float | None:
    """Trajectories per second at a largest error, between neighbours on the frontier in logarithms.

    An integrator whose every setting is more accurate than that gives its fastest one; ``None`` where none
    is as accurate.
    """
    best = frontier(rows, count)
    errors = [row.max_error(count) for row in best]
    if not best or error < errors[0]:
        return None
    logs = np.log(np.maximum(errors, 1e-300))
    return float(np.exp(np.interp(np.log(error), logs, np.log([row.rate for row in best]))))


def fastest_at(rows: Iterable[Row], error: float, count: int | None = None) -> tuple[str, float] | None:
    """The family that is fastest at an error, and its rate."""
    families: dict[str, list[Row]] = {}
    for row in rows:
        families.setdefault(row.family, []).append(row)
    found = {name: rate_at(own, error, count) for name, own in families.items()}
    known = {name: rate for name, rate in found.items() if rate is not None}
    return max(known.items(), key=lambda item: item[1]) if known else None
