"""What the machine gives: its peak, right-hand sides, what a scene's missing terms save, more threads.

Of threads the same ensembles run on one and on all, in turns, and a yardstick goes along: a loop of
multiply-adds in registers, which shares nothing, once on one thread and once on each. What it falls short of
the number of threads the machine has kept from everybody.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from typing import Any

import numpy as np
from numba import njit

from fastmech.arrays import Floats
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.threads import thread_count
from fastmech.integrators.methods import find_method
from fastmech.jit import FLAGS
from fastmech.reports import Stage
from fastmech.scene import Scene
from fastmech.slider.kernels.select import right_hand_side
from fastmech.studies.bench.entrants import PACKAGE, prepared
from fastmech.studies.bench.measure import BenchProblem, fast_starts, rest_starts
from fastmech.studies.reporting import TURNS, in_turns, section

#: Independent chains of multiply-adds in a lane, and their length: enough to hide each one's latency.
CHAINS, LENGTH = 8, 32

#: Lanes of the block that the right-hand side alone is given.
LANES = 256

#: Trajectories of a call at least.
MANY = 4096


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


@njit(nogil=True, **FLAGS)  # type: ignore[untyped-decorator]
def evaluations(rhs: Any, t: float, Y: Floats, dY: Floats, p: Floats, turns: int) -> None:
    """Call a block right-hand side over and over."""
    for _ in range(turns):
        rhs(t, Y, dY, p)


def _timed(
    name: str, works: Mapping[str, Callable[[], Any]], counts: dict[str, int], stage: Stage
) -> dict[str, float]:
    """What each work has done per second, all in turns."""
    seconds, _ = in_turns(works, advance=stage(name, len(works) * (TURNS + 1)))
    return {work: counts[work] / statistics.median(each) for work, each in seconds.items()}


def rhs_section(problem: BenchProblem, stage: Stage) -> list[str]:
    """The measured peak [multiply-adds/s], and right-hand sides alone and inside of methods."""
    x, turns = np.ones(LANES), 2000
    Y = np.ascontiguousarray(np.resize(problem.starts, (LANES, 4)).T)
    p = np.repeat(np.array(problem.coefficients)[:, None], LANES, axis=1)
    rhs, dY = right_hand_side(problem.coefficients), np.empty_like(Y)
    many = np.tile(problem.starts, (max(1, MANY // len(problem.starts)), 1))
    works: dict[str, Callable[[], Any]] = {
        "peak": lambda: multiply_adds()(x, turns, 0.5),
        "kernel alone": lambda: evaluations(rhs, 0.0, Y, dY, p, turns=turns),
    }
    counts = {"peak": turns * x.size * CHAINS * LENGTH, "kernel alone": turns * LANES}
    for method, dt in (("rk4", 0.02), ("dop853", 0.05), ("abm12", 0.0125)):
        steps, name = int(np.ceil(problem.t_end / dt * (1.0 - 1e-12))), f"inside {method}"
        works[name] = partial(integrate, problem.scene, many, problem.t_end, dt, method=method, threads=1)
        counts[name] = len(many) * find_method(method).evaluations(steps)
    rates = _timed("right-hand sides", works, counts, stage)
    peak, alone = rates.pop("peak"), rates["kernel alone"]
    return section(
        "## Right-hand sides and the core's peak",
        f"Measured peak: {peak / 1e9:.1f} billion fused multiply-adds of doubles per core second.",
        "where | million right-hand sides/s | of the kernel alone | multiply-adds in that time",
        (f"{n} | {rate / 1e6:.1f} | {rate / alone:.2f} | {peak / rate:.0f}" for n, rate in rates.items()),
    )


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


def terms_section(problem: BenchProblem, stage: Stage) -> list[str]:
    """Trajectories per second of every kind of scene with the same method, step and starts."""
    starts = np.tile(problem.starts, (max(1, MANY // len(problem.starts)), 1))
    rng, table_1 = np.random.default_rng(3), Scene(alpha=0.0)
    own = {n: x * rng.uniform(0.99, 1.01, len(starts)) for n, x in table_1.parameters.items() if x}
    run = partial(integrate, y0=starts, t_end=problem.t_end, dt=DT, method=METHOD, threads=1)
    works = {name: partial(run, table_1.replace(**changes)) for name, changes in SCENES.items()}
    works[OWN_PARAMETERS] = partial(run, table_1, parameters=own)
    rates = _timed("terms", works, dict.fromkeys(works, len(starts)), stage)
    base = rates["damper, constant force"]
    cells = (f"{name} | {rate:,.0f} | {rate / base:.3f}" for name, rate in rates.items())
    head = "scene | trajectories per core second | relative"
    return section("## Terms of a scene (RK4, dt = 0.01 s)", "", head, cells)


#: Trajectories of a call, tenths of a second to seconds of work; turns of the yardstick, a third of one.
TRAJECTORIES, YARDSTICK = 32_768, 500_000

#: Method, step [s], how it is fitted, and from which starts.
RUNS = (
    ("rk4", 0.02, "", "from rest"),
    ("dop853", 0.05, "", "from rest"),
    ("ab6", 0.0175, "", "from rest"),
    ("abm10", 0.018, "`fit=True`", "from rest"),
    ("abm8", 0.028, "`fit=True`", "from rest"),
    ("abm12", 0.0115, "`fit=True`", "from rest"),
    ("abm8", 0.028, "fitted again", "fast starts"),
    ("abm10", 0.018, "fitted again", "fast starts"),
)

#: A run on so many threads.
Run = Callable[[int], object]


def threads_study(quick: bool, stage: Stage) -> list[str]:
    """``threads.md``; ``quick``: a turn of few trajectories."""
    many, turns, n = thread_count(None), 1 if quick else TURNS, 1024 if quick else TRAJECTORIES
    found = cases(n, YARDSTICK // 20 if quick else YARDSTICK)
    works = {(name, k): partial(run, k) for name, run in found.items() for k in sorted({1, many})}
    seconds, _ = in_turns(works, turns, stage("threads", len(works) * (turns + 1)), time.perf_counter)
    rows = []
    for name in found:
        ratios = [one / all_ for one, all_ in zip(seconds[name, 1], seconds[name, many], strict=True)]
        rows.append(f"{name} | {statistics.median(ratios):.2f} | {min(ratios):.2f} | {max(ratios):.2f}")
    about = (
        f"{n:,} trajectories to t = 10 s on {many} threads over one, by wall time: {turns} "
        f"turn{'s' * (turns > 1)}, each on one thread and at once on all. The multiply-adds share nothing: "
        "what they fall short of the number of threads, the machine gave to others."
    )
    return section("# Threads", about, "run | speed-up, median | least | greatest", rows)


def cases(n: int, turns: int) -> dict[str, Run]:
    """The yardstick and the engine's runs of ``n`` trajectories."""
    problems = {"from rest": rest_starts(), "fast starts": fast_starts()}
    found: dict[str, Run] = {"multiply-adds, one loop a thread": partial(_arithmetic, turns)}
    for method, dt, fitted, whence in RUNS:
        problem = problems[whence]
        again = [share * problem.t_end for share in PACKAGE["again"]]
        fit = {"": False, "`fit=True`": True, "fitted again": again}[fitted]
        run = partial(_ensemble, problem, n, {"method": method, "dt": dt, "fit": fit})
        found[", ".join(filter(None, (method, f"dt = {dt:g} s", fitted, whence)))] = run
    return found


def _ensemble(problem: BenchProblem, n: int, keywords: dict[str, Any], threads: int) -> object:
    return prepared(keywords | {"threads": threads})(problem)(np.resize(problem.starts, (n, 4)))


def _arithmetic(turns: int, threads: int) -> object:
    """So many turns of the loop in all, shared among the threads."""
    loop, lanes = multiply_adds(), [np.ones(LANES) for _ in range(threads)]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(lambda x: loop(x, turns // threads, 0.5), lanes))
