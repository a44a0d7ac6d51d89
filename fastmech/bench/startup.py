"""From a cold start to the first result, in a first process and in a second one, and the steady state."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec

#: What each process does: 1,024 trajectories by one integrator, timed from the first import.
SCRIPT = """
import time
began = time.perf_counter()
{imports}
from fastmech.bench.problem import rest_starts
from fastmech.bench import {module}
problem = rest_starts()
entrants = {{(e.family, e.setting): e for e in {module}.entrants(problem)}}
import numpy as np
entrant = entrants[{family!r}, {setting!r}]
starts = np.tile(problem.starts, (max(1, entrant.least // 1024), 1))
solve = entrant.prepare(problem, 1)
solve(starts)
first = time.perf_counter() - began
best = np.inf
for _ in range(3):
    began = time.perf_counter()
    solve(starts)
    best = min(best, time.perf_counter() - began)
print(first, best * 1024 / len(starts))
"""

#: Module of this package, family and setting; each near a largest error of 1e-3.
STARTED = (
    ("package", "fastmech rk4", "dt = 0.05 s"),
    ("package", "fastmech tsit5", "dt = 0.12 s"),
    ("plain", "Numba RK4, one at a time, local numbers", "dt = 0.05 s"),
    ("heyoka_series", "heyoka batch", "tol = 0.01"),
    ("diffrax_solvers", "diffrax Tsit5, constant step", "dt = 0.1 s"),
    ("torch_step", "torch.compile rk4", "dt = 0.05 s"),
)


@dataclass(frozen=True)
class Start:
    """Seconds from the first import to the first result of 1,024 trajectories."""

    name: str
    first_process: float  #: nothing compiled before
    second_process: float  #: with what the first has left on the disk
    steady: float  #: a later call in the same process, the shortest of three


def started(advance: Callable[[int], None]) -> Iterator[Start]:
    """Two processes for each integrator that is installed, with empty caches of their own."""
    for module, family, setting in STARTED:
        library = {"heyoka_series": "heyoka", "diffrax_solvers": "diffrax", "torch_step": "torch"}.get(module)
        if library is None or find_spec(library) is not None:
            script = SCRIPT.format(imports=f"import {library or 'fastmech'}", module=module,
                                   family=family, setting=setting)  # fmt: skip
            with tempfile.TemporaryDirectory() as folder:
                times = [timed(script, folder) for _ in range(2)]
            yield Start(f"{family}, {setting}", times[0][0], times[1][0], times[1][1])
        advance(1)


def timed(script: str, cache: str) -> tuple[float, float]:
    """First result and steady call [s] of a script in a process of its own with this cache folder."""
    caches = ("NUMBA_CACHE_DIR", "TORCHINDUCTOR_CACHE_DIR", "JAX_COMPILATION_CACHE_DIR", "TRITON_CACHE_DIR")
    environment = os.environ | dict.fromkeys(caches, cache)
    environment["PYTHONPATH"] = os.pathsep.join(path for path in sys.path if path)
    done = subprocess.run(
        [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True
    )
    first, steady = done.stdout.split()[-2:]
    return float(first), float(steady)
