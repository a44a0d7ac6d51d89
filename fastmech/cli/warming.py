"""Compiling beforehand what computations need, in several processes.

Each job is a small computation by public functions, so that it compiles what they need and nothing else.
Each has a process, as many at once as there are cores; of a kernel that several need one compiles it and the
others wait (:class:`fastmech.jit.Kernel`). It is a new interpreter, whatever the caller's main module is.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

import fastmech as fm
from fastmech import jit
from fastmech.ensembles.threads import thread_count

_SCENES = {"constant": fm.Scene(alpha=0.0), "decaying": fm.Scene()}
_STARTS = np.array([[1.0, 0.2, 0.0, 0.0], [0.9, -0.3, 0.5, 0.0]])
_ANGLES = {"phi": np.linspace(0.0, 1.0, 3), "theta": np.linspace(0.0, 1.0, 3)}
_FORCES = {"F0": np.linspace(90.0, 110.0, 3), "c1": np.linspace(150.0, 170.0, 3)}


def _integrate(force: str, **how: object) -> None:
    fm.integrate(_SCENES[force], _STARTS, 0.5, **how)  # type: ignore[arg-type]


#: What each purpose runs, the longest first.
JOBS: dict[str, dict[str, Callable[[], object]]] = {
    "integrate": {
        "integrate, tolerance": lambda: _integrate("constant", tol=1e-6),
        "integrate, tolerance, decaying force": lambda: _integrate("decaying", tol=1e-6),
        "integrate, decaying force": lambda: _integrate("decaying", dt=0.01),
        "integrate, constant force": lambda: _integrate("constant", dt=0.01),
    },
    "atlas": {
        "map of equilibria": lambda: fm.map_equilibria(_SCENES["constant"], _FORCES),
        "folds": lambda: fm.trace_folds(_SCENES["constant"], *_FORCES.items()),
    },
    "basins": {
        "basins": lambda: fm.map_basins(_SCENES["constant"], _ANGLES),
        "basins, decaying force": lambda: fm.map_basins(_SCENES["decaying"], _ANGLES),
        "disturbed": lambda: fm.disturb(
            _SCENES["constant"], fm.find_equilibria(_SCENES["constant"])[0], 16, radius=0.1, t_end=0.5
        ),
    },
}

#: Parts of a job: few compile as many kernels. Each is one, and those that remain are done with the job.
PARTS = 10

#: What a process runs.
_PROCESS = "import sys; from fastmech.cli.warming import _run_job; _run_job(*sys.argv[1:])"


def warm_up(
    purposes: tuple[str, ...],
    tell: Callable[[str], object] = lambda line: None,
    progress: Callable[[int], object] = lambda finished: None,
) -> int:
    """Compile what some purposes need and keep it on disk; how many kernels were not there.

    Args:
        purposes: of ``JOBS``.
        tell: is given a line for every kernel that has been compiled.
        progress: is told how many parts have been finished since; a job has ``PARTS``.

    Raises:
        RuntimeError: a job failed; what it said last.
    """
    path = os.pathsep.join(place for place in sys.path if place)
    running: list[subprocess.Popen[str]] = []
    over = threading.Event()

    def run(purpose: str, name: str) -> int:
        with subprocess.Popen(
            [sys.executable, "-W", "ignore", "-c", _PROCESS, purpose, name],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | {"PYTHONPATH": path},
        ) as process:
            running.append(process)
            if over.is_set():
                process.terminate()
            assert process.stdout is not None
            assert process.stderr is not None
            made = 0
            for line in process.stdout:
                made += 1
                tell(line.rstrip("\n"))
                progress(int(made < PARTS))
            said = process.stderr.read().strip().splitlines()
        if process.returncode:
            raise RuntimeError(f"{name}: {said[-1] if said else 'its process has ended'}")
        progress(PARTS - min(made, PARTS - 1))
        return made

    with ThreadPoolExecutor(thread_count(None)) as pool:
        jobs = [pool.submit(run, purpose, name) for purpose in purposes for name in JOBS[purpose]]
        try:
            return sum(job.result() for job in jobs)
        except BaseException:
            over.set()
            pool.shutdown(wait=False, cancel_futures=True)
            for process in running:
                process.terminate()
            raise


def _run_job(purpose: str, name: str) -> None:
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
    JOBS[purpose][name]()
