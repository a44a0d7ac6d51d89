"""What a scene's missing terms save, and what parameters of each trajectory's own cost."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from fastmech.bench.problem import Problem
from fastmech.ensembles.integrate import integrate
from fastmech.reports import TURNS, Stage, in_turns
from fastmech.scene import Scene

METHOD, DT = "rk4", 0.01

#: Scenes by the terms that they have, as changes of Table 1.
SCENES: dict[str, dict[str, float]] = {
    "damper, decaying force": {"alpha": 0.7},
    "damper, constant force": {"alpha": 0.0},
    "damper, no force": {"F0": 0.0},
    "no damper, decaying force": {"beta": 0.0, "alpha": 0.7},
    "no damper, constant force": {"beta": 0.0, "alpha": 0.0},
    "no damper, no force": {"beta": 0.0, "F0": 0.0},
}
OWN_PARAMETERS = "damper, constant force, every trajectory its own ten parameters"


class Cost(NamedTuple):
    """Trajectories per second of a kind of scene."""

    kind: str
    rate: float  #: per second of one core
    relative: float  #: to the damper with constant force


def costs(problem: Problem, stage: Stage) -> list[Cost]:
    """Every kind of scene with the same method, step and starts, in turns."""
    starts = np.tile(problem.starts, (max(1, 4096 // len(problem.starts)), 1))
    rng = np.random.default_rng(3)
    own = {
        name: value * rng.uniform(0.99, 1.01, len(starts))
        for name, value in Scene(alpha=0.0).model_dump().items()
        if value
    }

    def work(changes: dict[str, float], parameters: dict[str, Any]) -> Callable[[], object]:
        scene = Scene(alpha=0.0).replace(**changes)
        return lambda: integrate(scene, starts, problem.t_end, DT, METHOD, threads=1, parameters=parameters)

    works = {name: work(changes, {}) for name, changes in SCENES.items()} | {OWN_PARAMETERS: work({}, own)}
    seconds = in_turns(works, advance=stage("terms", len(works) * (TURNS + 1)))
    rates = {name: len(starts) / statistics.median(times) for name, times in seconds.items()}
    base = rates["damper, constant force"]
    return [Cost(name, rate, rate / base) for name, rate in rates.items()]
