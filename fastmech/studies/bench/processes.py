"""What only a process of its own can tell: cold starts, vector widths, memory."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from fastmech.reports import Stage
from fastmech.studies.reporting import section

#: Prepares entrants of rest starts, at most so many trajectories a call: of each the seconds from the first
#: import to its first result, of a later call of 1,024 trajectories on one core (median of five), and the
#: largest error.
ENTRANTS = """
import json, sys, time
began = time.perf_counter()
library, names, most = json.loads(sys.argv[1])
__import__(library)
import numpy as np
from fastmech.studies.bench.entrants import entrants_of
from fastmech.studies.bench.measure import rest_starts
problem = rest_starts()
everyone = {(e.family, e.setting): e for e in entrants_of(library, problem)}
found = []
for name in names:
    entrant = everyone[tuple(name)]
    starts = np.tile(problem.starts, (max(1, min(most, entrant.most) // 1024, entrant.least // 1024), 1))
    solve = entrant.prepare(problem)
    error = float(np.abs(solve(starts)[:1024] - problem.truth).max())
    first, seconds = time.perf_counter() - began, []
    for _ in range(5):
        before = time.process_time()
        solve(starts)
        seconds.append(time.process_time() - before)
    found.append([first, sorted(seconds)[2] * 1024 / len(starts), error])
from fastmech.system_info import vector_bits
print(json.dumps([vector_bits(), found]))
"""

#: Integrates so many trajectories and tells the process's largest memory [bytes], starts included. A few
#: steps are as many as thousands: nothing of a step is kept.
MEMORY = """
import sys
import numpy as np
import fastmech as fm
n = int(sys.argv[1])
starts = np.zeros((n, 4))
starts[:, 0] = np.linspace(0.5, 2.5, n)
run = fm.integrate(fm.Scene(alpha=0.0), starts, 0.1, dt=0.02)
assert run.y.shape == (1, n, 4)
with open("/proc/self/status") as status:  # what getrusage tells may be the parent's
    print(next(1024 * int(line.split()[1]) for line in status if line.startswith("VmHWM")))
"""

#: Cold starts: library, family and setting; each near a largest error of 1e-3.
STARTED = (
    ("fastmech", "fastmech rk4", "dt = 0.05 s"),
    ("fastmech", "fastmech tsit5", "dt = 0.12 s"),
    ("fastmech", "Numba RK4, one at a time", "dt = 0.05 s"),
    ("heyoka", "heyoka batch", "tol = 0.01"),
    ("diffrax", "diffrax Tsit5, constant step", "dt = 0.1 s"),
    ("torch", "torch.compile rk4", "dt = 0.05 s"),
)

#: Vector widths: processor and features that each is compiled for, the entrants, and turns of the processes.
BUILDS = {"AVX2": ("haswell", "+avx2,+fma"), "AVX-512": ("skylake-avx512", "-prefer-256-bit")}
WIDE = (
    ("Numba RK4, one at a time", "dt = 0.02 s"),
    ("fastmech rk4", "dt = 0.02 s"),
    ("fastmech ab6", "dt = 0.0175 s"),
    ("fastmech dop853", "dt = 0.05 s"),
    ("fastmech rk4, float32", "dt = 0.03 s"),
    ("fastmech ab6, float32", "dt = 0.0175 s"),
)
VECTOR_TURNS = 3

#: Trajectories of which memory is measured: few, for what any process takes, and many.
TRAJECTORIES = (1_000, 10_000_000)

CACHES = ("NUMBA_CACHE_DIR", "TORCHINDUCTOR_CACHE_DIR", "JAX_COMPILATION_CACHE_DIR", "TRITON_CACHE_DIR")


def told(script: str, argument: Any, environment: Mapping[str, str] = {}) -> Any:
    """What the last line of a script, run in a process of its own, says.

    Raises:
        subprocess.CalledProcessError: it failed.
    """
    own = {**os.environ, **environment, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    command = [sys.executable, "-c", script, json.dumps(argument)]
    done = subprocess.run(command, env=own, capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def starts_section(stage: Stage) -> list[str]:
    """Two processes for each integrator that is installed, with empty caches of their own."""
    advance, rows = stage("cold starts", len(STARTED)), []
    for library, *name in STARTED:
        if find_spec(library) is not None:
            with tempfile.TemporaryDirectory() as folder:
                caches = dict.fromkeys(CACHES, folder)
                both = [told(ENTRANTS, [library, [name], 1024], caches)[1][0] for _ in range(2)]
            (first, *_), (second, steady, _) = both
            rows.append(f"{', '.join(name)} | {first:.2f} | {second:.2f} | {steady:.4f}")
        advance(1)
    about = (
        "Seconds from the first import to the first result of 1,024 rest starts, in a first process and "
        "in a second one that finds what the first has left on the disk, and of a later call."
    )
    head = "integrator | first process | second process | later call"
    return section("## Cold start and steady state", about, head, rows)


def memory_section(stage: Stage) -> list[str]:
    """One process for each number of trajectories; nothing where the system does not tell (Linux does)."""
    if not Path("/proc/self/status").exists():
        return []
    advance, rows = stage("memory", len(TRAJECTORIES)), []
    for n in TRAJECTORIES:
        rows.append(f"{n:,} | {told(MEMORY, n) / 2**30:.2f}")
        advance(1)
    about = "The most that a process takes which asks for final states, its starts included."
    return section("## Memory", about, "trajectories | GiB", rows)


def vectors_study(quick: bool, stage: Stage) -> list[str]:
    """``vectors.md``: the same work compiled for AVX2 and AVX-512, in both precisions, beside plain Numba.

    Numba compiles for one processor in a process, so each width has processes of its own, which take turns;
    ``quick`` takes one turn.
    """
    turns = 1 if quick else VECTOR_TURNS
    advance = stage("vectors", turns * len(BUILDS))
    found: dict[str, list[tuple[int, Sequence[Any]]]] = {name: [] for name in BUILDS}
    for _ in range(turns):
        for name, (processor, features) in BUILDS.items():
            build = {"NUMBA_CPU_NAME": processor, "NUMBA_CPU_FEATURES": features}
            with suppress(subprocess.CalledProcessError):  # the processor lacks the instructions
                found[name].append(told(ENTRANTS, ["fastmech", WIDE, 1 << 20], build))
            advance(1)
    builds = " and ".join(f"{n} ({b[0]}, `{b[1]}`)" for n, b in BUILDS.items())
    lines = [
        "# Vector widths",
        "",
        "1,024 rest starts to t = 10 s, trajectories per core second, medians of processes in turns; the "
        f"same sources compiled for {builds}.",
        "",
        *(f"{name}: this processor cannot run it." for name, runs in found.items() if not runs),
    ]
    for name, runs in found.items():
        if runs:
            entrants = list(zip(*(own for _, own in runs), strict=True))
            rates = [1024 / statistics.median(steady for _, steady, _ in each) for each in entrants]
            over = {1: f"{rates[1] / rates[0]:.2f}"}  # of rk4, which plain Numba has
            rows = (
                f"{family}, {setting} | {rates[k]:,.0f} | {over.get(k, '')} | {entrants[k][0][2]:.1e}"
                for k, (family, setting) in enumerate(WIDE)
            )
            head = "integrator | rate | over plain Numba | largest error"
            lines += section(f"## {name}: vectors of {runs[0][0]} bit", "", head, rows)
    return lines
