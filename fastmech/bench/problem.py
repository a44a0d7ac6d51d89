"""The benchmark's problems, and what takes part: one integrator at one setting.

Problems are ensembles whose final states are known to more digits than a double holds: the references come
from ``data/make_bench_reference.py``, which computes them without this package.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.resources import files
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.system import System
from fastmech.mechanism.coefficients import Coefficients, reduce
from fastmech.models.mechanism import Mechanism
from fastmech.scene import Scene

Floats = NDArray[np.float64]

#: Starts of a problem that have a reference; larger ensembles repeat them.
STARTS = 1024


@dataclass(frozen=True)
class Problem:
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


def _problem(name: str, description: str, rate: float, pace: float, n: int) -> Problem:
    rng = np.random.default_rng(1)
    angles = [rng.uniform(0.5, 2.5, STARTS), rng.uniform(-1.0, 1.0, STARTS)]
    starts = np.stack([*angles, *(rng.uniform(-rate, rate, STARTS) for _ in range(2))], axis=1)
    return Problem(name, description, Scene(alpha=0.0), starts[:n], reference(name)[:n], 10.0, pace)


def rest_starts(n: int = STARTS) -> Problem:
    """Table 1, constant force, at rest with phi in [0.5, 2.5] and theta in [-1, 1], for 10 s."""
    return _problem("rest", "rest starts", 0.0, 1.0, n)


def fast_starts(n: int = STARTS) -> Problem:
    """The same angles with rates up to 10 rad/s: up to fifteen turns, and passages close to saddles."""
    return _problem("fast", "starts with |phi'|, |theta'| up to 10 rad/s", 10.0, 0.15, n)


PROBLEMS: dict[str, Callable[..., Problem]] = {"rest": rest_starts, "fast": fast_starts}


def reference(name: str) -> Floats:
    """Final states of all starts of a problem, shape (STARTS, 4), each the nearest double."""
    text = files("fastmech.bench").joinpath("references", f"{name}.csv").read_text(encoding="utf-8")
    rows = [line for line in text.splitlines() if not line.startswith(("#", "phi"))]
    return np.array([[float(x) for x in row.split(",")] for row in rows])


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
