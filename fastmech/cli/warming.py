"""Compiling beforehand what computations need, in several processes.

Each job is a small computation by public functions, so that it compiles what they need and nothing else.
Processes take the jobs one after another; of a kernel that several need one compiles it and the others wait
(:class:`fastmech.jit.Kernel`). A process is a new interpreter, whatever the caller's main module is. It takes
its jobs from its standard input and ends when that does, so it never outlives the caller by more than a job.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

import numpy as np

import fastmech as fm
from fastmech import jit
from fastmech.ensembles.threads import thread_count
from fastmech.equilibria.find import find_equilibria

_SCENES = {"constant": fm.Scene(alpha=0.0), "decaying": fm.Scene()}
_STARTS = np.array([[1.0, 0.2, 0.0, 0.0], [0.9, -0.3, 0.5, 0.0]])
_ANGLES = {"phi": np.linspace(0.0, 1.0, 3), "theta": np.linspace(0.0, 1.0, 3)}
_FORCES = {"F0": np.linspace(90.0, 110.0, 3), "c1": np.linspace(150.0, 170.0, 3)}


def _integrate(force: str, **how: object) -> None:
    fm.integrate(_SCENES[force], _STARTS, 0.5, **how)  # type: ignore[arg-type]


def _disturb() -> None:
    scene = _SCENES["constant"]
    fm.disturb(scene, find_equilibria(scene)[0], 16, radius=0.1, t_end=0.5)


#: What each purpose runs, the longest first.
JOBS: dict[str, dict[str, Callable[[], object]]] = {
    "integrate": {
        "integrate, tolerance": lambda: _integrate("constant", tol=1e-6),
        "integrate, decaying force": lambda: _integrate("decaying", dt=0.01),
        "integrate, constant force": lambda: _integrate("constant", dt=0.01),
    },
    "atlas": {
        "map of equilibria": lambda: fm.map_equilibria(_SCENES["constant"], _FORCES),
        "folds": lambda: fm.trace_folds(
            _SCENES["constant"], *((name, grid) for name, grid in _FORCES.items())
        ),
    },
    "basins": {
        "basins": lambda: fm.map_basins(_SCENES["constant"], _ANGLES),
        "basins, decaying force": lambda: fm.map_basins(_SCENES["decaying"], _ANGLES),
        "disturbed": _disturb,
    },
}

#: What a process runs.
_PROCESS = "from fastmech.cli.warming import _take_jobs; _take_jobs()"


def warm_up(
    purposes: tuple[str, ...],
    tell: Callable[[str], None] = lambda line: None,
    progress: Callable[[int], object] = lambda finished: None,
    processes: int | None = None,
) -> int:
    """Compile what some purposes need and keep it on disk; how many kernels were not there.

    Args:
        purposes: of ``JOBS``.
        tell: is given a line for every kernel that has been compiled.
        progress: is told how many jobs have been finished since.
        processes: how many at once, as many as there are cores by default.

    Raises:
        RuntimeError: a job failed; what it said last.
    """
    waiting = [(purpose, name) for purpose in purposes for name in JOBS[purpose]][::-1]
    ends = [_Process() for _ in range(min(thread_count(processes), len(waiting)))]

    def take(process: _Process) -> int:
        made = 0
        while waiting:
            try:
                job = waiting.pop()
            except IndexError:  # another took it
                break
            for line in process.run(job):
                made += 1
                tell(line)
            progress(1)
        return made

    try:
        with ThreadPoolExecutor(len(ends)) as pool:
            try:
                return sum(done.result() for done in [pool.submit(take, process) for process in ends])
            except BaseException:
                waiting.clear()
                for process in ends:
                    process.end()
                raise
    finally:
        for process in ends:
            process.end()
            process.close()


class _Process:
    """An interpreter that takes jobs."""

    def __init__(self) -> None:
        path = os.pathsep.join(place for place in sys.path if place)
        self._process = subprocess.Popen(
            [sys.executable, "-W", "ignore", "-c", _PROCESS],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | {"PYTHONPATH": path},
        )

    def run(self, job: tuple[str, str]) -> Iterator[str]:
        """The lines that it tells until the job is finished."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with suppress(BrokenPipeError):
            print(json.dumps(job), file=self._process.stdin, flush=True)
        for line in self._process.stdout:
            told = line.rstrip("\n")
            if not told:
                return
            yield told
        assert self._process.stderr is not None
        said = self._process.stderr.read().strip().splitlines()
        raise RuntimeError(f"{job[1]}: {said[-1] if said else 'its process has ended'}")

    def end(self) -> None:
        """End it at once."""
        self._process.terminate()
        self._process.wait()

    def close(self) -> None:
        """Close what it was told and told by."""
        with suppress(BrokenPipeError):
            self._process.__exit__(None, None, None)


def _take_jobs() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the terminal tells every process; the caller decides
    begun: list[tuple[str, float]] = []

    def tell(name: str | None) -> None:
        if name is not None:
            begun.append((name, time.perf_counter()))
            return
        made, since = begun.pop()
        if jit.compiled[-1:] == [made]:
            print(f"{time.perf_counter() - since:8.1f} s  {made}", flush=True)

    jit.listeners.append(tell)
    for line in sys.stdin:
        purpose, name = json.loads(line)
        JOBS[purpose][name]()
        print(flush=True)
