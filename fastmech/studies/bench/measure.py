"""Timing: everyone is prepared first, then timed in turns, so that a busy machine disturbs all alike.

Rates are trajectories per second of processor time, all threads of the process together: on a quiet machine
that is wall time on one thread, on a busy one the time spent waiting for a core does not count, and an
integrator that secretly takes two threads pays for both. Wall times stand beside them.

The benchmark's problems, and what takes part: one integrator at one setting. Problems are ensembles whose
final states are known to more digits than a double holds: the references come from
``data/make_bench_reference.py``, which computes them without this package.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from importlib.resources import files
from typing import NamedTuple

import numpy as np

from fastmech.arrays import Floats
from fastmech.ensembles.run import Progress
from fastmech.ensembles.system import System
from fastmech.models.mechanism import Mechanism
from fastmech.scene import Scene
from fastmech.slider.coefficients import Coefficients, reduce

#: Starts of a problem that have a reference; larger ensembles repeat them.
STARTS = 1024


class BenchProblem(NamedTuple):
    """An ensemble whose final states are wanted."""

    name: str
    description: str
    scene: Scene | System | Mechanism
    starts: Floats  #: shape (n, dim)
    truth: Floats  #: final states, shape (n, dim)
    t_end: float  #: s
    pace: float  #: steps of fixed-step methods relative to those of the rest starts

    @property
    def coefficients(self) -> Coefficients:
        """The scene's reduced coefficients; a system has none."""
        assert isinstance(self.scene, Scene)
        return reduce(self.scene)


def _problem(name: str, description: str, rate: float, pace: float, n: int) -> BenchProblem:
    rng = np.random.default_rng(1)
    angles = [rng.uniform(0.5, 2.5, STARTS), rng.uniform(-1.0, 1.0, STARTS)]
    starts = np.stack([*angles, *(rng.uniform(-rate, rate, STARTS) for _ in range(2))], axis=1)
    return BenchProblem(
        name, description, Scene(alpha=0.0), starts[:n], reference(name)[:n], t_end=10.0, pace=pace
    )


def rest_starts(n: int = STARTS) -> BenchProblem:
    """Table 1, constant force, at rest with phi in [0.5, 2.5] and theta in [-1, 1], for 10 s."""
    return _problem("rest", "rest starts", 0.0, 1.0, n)


def fast_starts(n: int = STARTS) -> BenchProblem:
    """The same angles with rates up to 10 rad/s: up to fifteen turns, and passages close to saddles."""
    return _problem("fast", "starts with |phi'|, |theta'| up to 10 rad/s", 10.0, 0.15, n)


PROBLEMS: dict[str, Callable[..., BenchProblem]] = {"rest": rest_starts, "fast": fast_starts}


def reference(name: str) -> Floats:
    """Final states of all starts of a problem, shape (STARTS, 4), each the nearest double."""
    path = files(__package__).joinpath("references", f"{name}.csv")
    return np.loadtxt(path.read_text(encoding="utf-8").splitlines(), comments=["#", "phi"], delimiter=",")


#: Starts (n, 4) to final states (n, 4): what is timed.
Solve = Callable[[Floats], Floats]

#: Makes a ``Solve`` for a problem: compiling and tables, not timed as speed.
Prepare = Callable[[BenchProblem], Solve]


class Entrant(NamedTuple):
    """One integrator at one setting."""

    family: str  #: integrator; its settings make one curve
    setting: str  #: step or tolerance
    prepare: Prepare
    most: int = 32768  #: trajectories a call at most; slow integrators are given the first few
    least: int = 1  #: trajectories a call at least: a batch that needs them to be at its best


#: Processor seconds of timed calls that one entrant is given, and its calls at most.
BUDGET = 0.8
MOST_REPEATS = 7

#: Calls shorter than this [s] are given copies of the starts, up to the entrant's most.
SHORT_CALL = 0.1


class Row(NamedTuple):
    """What one entrant did on one problem."""

    problem: str
    family: str
    setting: str
    trajectories: int  #: in each timed call
    wall: float  #: s, median of timed calls
    processor: float  #: s of processor time, median of timed calls
    first_call: float  #: s, preparing and the first call: compiling or loading included
    errors: Floats  #: largest error of any component, by trajectory

    @property
    def rate(self) -> float:
        """Trajectories per second of processor time."""
        return self.trajectories / self.processor

    @property
    def max_error(self) -> float:
        """Largest over trajectories."""
        return float(self.errors.max())

    @property
    def median_error(self) -> float:
        """Median over trajectories."""
        return float(np.median(self.errors))


class _Runner:
    """A prepared entrant, warmed up and compared with the truth, and its times so far."""

    def __init__(self, problem: BenchProblem, entrant: Entrant, budget: float) -> None:
        self.entrant, self.problem = entrant, problem.name
        n = min(len(problem.starts), entrant.most)
        self.starts = np.tile(problem.starts[:n], (max(1, -(-entrant.least // n)), 1))
        began = time.perf_counter()
        self.solve = entrant.prepare(problem)
        final = self.solve(self.starts)
        self.first_call = time.perf_counter() - began
        self.errors = np.abs(final[:n] - problem.truth[:n]).max(axis=1)
        self.errors[~np.isfinite(self.errors)] = np.inf
        self.times: list[tuple[float, float]] = []  # wall, processor [s]
        self.time()
        taken = max(self.times[0][1], 1e-6)
        short = min(SHORT_CALL, budget / MOST_REPEATS)
        more = min(entrant.most // len(self.starts), int(np.ceil(short / taken)))
        if more > 1:
            self.starts, self.times = np.tile(self.starts, (more, 1)), []
            taken *= more
        self.repeats = int(np.clip(budget / taken, 1, MOST_REPEATS)) - len(self.times)

    def time(self) -> None:
        """One more call."""
        wall, processor = time.perf_counter(), time.process_time()
        self.solve(self.starts)
        self.times.append((time.perf_counter() - wall, time.process_time() - processor))

    def row(self) -> Row:
        """Medians of the calls."""
        wall, processor = (statistics.median(each) for each in zip(*self.times, strict=True))
        e, n = self.entrant, len(self.starts)
        told = self.problem, e.family, e.setting, n, wall
        return Row(*told, processor=processor, first_call=self.first_call, errors=self.errors)


def measure(
    problem: BenchProblem,
    everyone: Sequence[Entrant],
    advance: Progress = lambda done: None,
    budget: float = BUDGET,
) -> tuple[list[Row], list[tuple[Entrant, Exception]]]:
    """Time entrants on one thread; ``advance`` is told 1 twice for each.

    ``budget`` is what each is given [s of processor time]; a call that takes longer is made once.

    Returns:
        Rows, and the entrants that have failed with their exceptions.
    """
    runners, failed = [], []
    for entrant in everyone:
        try:
            runners.append(_Runner(problem, entrant, budget))
        except Exception as error:
            failed.append((entrant, error))
            advance(1)
        advance(1)
    for turn in range(MOST_REPEATS):
        for runner in runners:
            if turn < runner.repeats:
                runner.time()
            if turn == 0:
                advance(1)
    return [runner.row() for runner in runners], failed


#: Largest errors [rad, rad/s] at which integrators are compared.
TARGETS = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13)


def frontier(rows: Iterable[Row]) -> list[Row]:
    """Settings that no other beats in both speed and error, the most accurate first."""
    best: list[Row] = []
    # Errors that differ by rounding alone are equal.
    for row in sorted(rows, key=lambda row: (float(f"{row.max_error:.2e}"), -row.rate)):
        if np.isfinite(row.max_error) and (not best or row.rate > best[-1].rate):
            best.append(row)
    return best


def rate_at(rows: Iterable[Row], error: float) -> float | None:
    """Trajectories per second at a largest error, between neighbours on the frontier in logarithms.

    An integrator whose every setting is more accurate than that gives its fastest one; ``None`` where none
    is as accurate.
    """
    best = frontier(rows)
    errors = [row.max_error for row in best]
    if not best or error < errors[0]:
        return None
    logs = np.log(np.maximum(errors, 1e-300))
    return float(np.exp(np.interp(np.log(error), logs, np.log([row.rate for row in best]))))


def by_family(rows: Iterable[Row]) -> dict[str, list[Row]]:
    """Rows of each family, the families in their order."""
    families: dict[str, list[Row]] = {}
    for row in rows:
        families.setdefault(row.family, []).append(row)
    return families


def fastest_at(rows: Iterable[Row], error: float) -> tuple[str, float] | None:
    """The family that is fastest at an error, and its rate."""
    found = ((name, rate_at(own, error)) for name, own in by_family(rows).items())
    known = [(name, rate) for name, rate in found if rate is not None]
    return max(known, key=lambda item: item[1], default=None)
