"""Threads: the same ensembles on one thread and on all, in turns, beside what the machine itself gives.

A yardstick goes along in every turn: a loop of multiply-adds in registers, which shares nothing, once on one
thread and once on each. What it falls short of the number of threads the machine has kept from everybody.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np

from fastmech.ensembles.threads import thread_count
from fastmech.reports import Stage
from fastmech.studies.bench.entrants import PACKAGE, prepared
from fastmech.studies.bench.machine import LANES, multiply_adds
from fastmech.studies.bench.measure import fast_starts, rest_starts
from fastmech.studies.reporting import TURNS, in_turns, section

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
        starts, keywords = np.resize(problem.starts, (n, 4)), {"method": method, "dt": dt, "fit": fit}

        def run(threads: int, problem=problem, starts=starts, keywords=keywords):  # type: ignore[no-untyped-def]
            return prepared(keywords | {"threads": threads})(problem)(starts)

        found[", ".join(filter(None, (method, f"dt = {dt:g} s", fitted, whence)))] = run
    return found


def _arithmetic(turns: int, threads: int) -> object:
    """So many turns of the loop in all, shared among the threads."""
    loop, lanes = multiply_adds(), [np.ones(LANES) for _ in range(threads)]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(lambda x: loop(x, turns // threads, 0.5), lanes))
