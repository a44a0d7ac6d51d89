"""Right-hand sides per second against the core's peak, and what a scene's missing terms save."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from fastmech.ensembles.integrate import integrate
from fastmech.integrators.methods import find_method
from fastmech.jit import FLAGS
from fastmech.kernels.select import right_hand_side
from fastmech.reports import Stage
from fastmech.scene import Scene
from fastmech.studies.bench.measure import Problem
from fastmech.studies.reporting import TURNS, in_turns

#: Independent chains of multiply-adds in a lane, and their length: enough to hide each one's latency.
CHAINS, LENGTH = 8, 32

#: Lanes of the block that the right-hand side alone is given.
LANES = 256


class Throughput(NamedTuple):
    """Evaluations of right-hand sides per second of one core."""

    place: str
    rhs: float  #: right-hand sides of one trajectory, per second
    share: float  #: of the kernel alone
    slots: float  #: multiply-adds that the core could have done in the time of one


@cache
def multiply_adds() -> Any:
    """A loop over lanes that does CHAINS x LENGTH multiply-adds in each, as machine code."""
    names = [f"a{j}" for j in range(CHAINS)]
    lines = [
        "def loop(x, turns, factor):",
        "    for _ in range(turns):",
        "        for i in range(x.shape[0]):",
    ]
    lines += [f"            {name} = x[i] + {j}.0" for j, name in enumerate(names)]
    lines += [f"            {name} = {name} * factor + 1.0" for _ in range(LENGTH) for name in names]
    lines += [f"            x[i] = {' + '.join(names)}"]
    scope: dict[str, Any] = {}
    exec(compile("\n".join(lines), "<multiply-adds>", "exec"), scope)
    return njit(["void(float64[::1], int64, float64)"], nogil=True, **FLAGS)(scope["loop"])


@cache
def evaluations() -> Any:
    """A loop that calls a block right-hand side over and over."""

    def loop(rhs, t, Y, dY, p, turns):  # type: ignore[no-untyped-def]
        for _ in range(turns):
            rhs(t, Y, dY, p)

    return njit(nogil=True, **FLAGS)(loop)


def throughputs(problem: Problem, stage: Stage) -> tuple[float, list[Throughput]]:
    """The measured peak [multiply-adds/s], and right-hand sides alone and inside of methods."""
    x, turns = np.ones(LANES), 2000
    Y = np.ascontiguousarray(np.resize(problem.starts, (LANES, 4)).T)
    coefficients = problem.coefficients
    p = np.repeat(np.array(coefficients)[:, None], LANES, axis=1)
    rhs, dY = right_hand_side(coefficients), np.empty_like(Y)
    many = np.tile(problem.starts, (max(1, 4096 // len(problem.starts)), 1))
    works: dict[str, tuple[Callable[[], Any], int]] = {
        "peak": (lambda: multiply_adds()(x, turns, 0.5), turns * x.size * CHAINS * LENGTH),
        "kernel alone": (lambda: evaluations()(rhs, 0.0, Y, dY, p, turns), turns * LANES),
    }
    for method, dt in (("rk4", 0.02), ("dop853", 0.05), ("abm12", 0.0125)):
        steps = int(np.ceil(problem.t_end / dt * (1.0 - 1e-12)))

        def run(method: str = method, dt: float = dt) -> Any:
            return integrate(problem.scene, many, problem.t_end, dt, method, threads=1)

        works[f"inside {method}"] = (run, len(many) * find_method(method).evaluations(steps))
    calls = {name: work for name, (work, _) in works.items()}
    seconds, _ = in_turns(calls, advance=stage("right-hand sides", len(works) * (TURNS + 1)))
    rates = {name: count / statistics.median(seconds[name]) for name, (_, count) in works.items()}
    peak = rates.pop("peak")
    alone = rates["kernel alone"]
    return peak, [Throughput(name, rate, rate / alone, peak / rate) for name, rate in rates.items()]


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
        for name, value in Scene(alpha=0.0).parameters.items()
        if value
    }

    def work(changes: dict[str, float], parameters: dict[str, Any]) -> Callable[[], object]:
        scene = Scene(alpha=0.0).replace(**changes)
        return lambda: integrate(scene, starts, problem.t_end, DT, METHOD, threads=1, parameters=parameters)

    works = {name: work(changes, {}) for name, changes in SCENES.items()} | {OWN_PARAMETERS: work({}, own)}
    seconds, _ = in_turns(works, advance=stage("terms", len(works) * (TURNS + 1)))
    rates = {name: len(starts) / statistics.median(times) for name, times in seconds.items()}
    base = rates["damper, constant force"]
    return [Cost(name, rate, rate / base) for name, rate in rates.items()]
