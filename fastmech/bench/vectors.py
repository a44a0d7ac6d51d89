"""Vector widths: the same work compiled for AVX2 and for AVX-512, float64 and float32, beside plain Numba.

Numba compiles for one processor in a process, so each width has processes of its own, which take turns.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from fastmech.bench.tables import table
from fastmech.ensembles.run import Progress

#: What each width is compiled for: processor and features.
BUILDS = {"AVX2": ("haswell", "+avx2,+fma"), "AVX-512": ("skylake-avx512", "-prefer-256-bit")}

#: Rows: module of this package, family, setting.
ENTRANTS = (
    ("plain", "Numba RK4, one at a time, small arrays", "dt = 0.02 s"),
    ("plain", "Numba RK4, one at a time, local numbers", "dt = 0.02 s"),
    ("package", "fastmech rk4", "dt = 0.02 s"),
    ("package", "fastmech ab6", "dt = 0.0175 s"),
    ("package", "fastmech dop853", "dt = 0.05 s"),
    ("package", "fastmech rk4, float32", "dt = 0.03 s"),
    ("package", "fastmech ab6, float32", "dt = 0.0175 s"),
)

TURNS = 3

SCRIPT = """
import json, sys, time
import numpy as np
from fastmech.bench import package, plain
from fastmech.bench.problem import rest_starts
from fastmech.system_info import vector_bits
problem = rest_starts()
modules = {"package": package, "plain": plain}
everyone = {(m, e.family, e.setting): e for m in modules for e in modules[m].entrants(problem)}
rates, errors = [], []
for name in json.loads(sys.argv[1]):
    entrant = everyone[tuple(name)]
    starts = np.tile(problem.starts, (max(1, entrant.most // 1024), 1))
    solve = entrant.prepare(problem, 1)
    errors.append(float(np.abs(solve(starts)[:1024] - problem.truth).max()))
    seconds = []
    for _ in range(5):
        began = time.process_time()
        solve(starts)
        seconds.append(time.process_time() - began)
    rates.append(len(starts) / sorted(seconds)[2])
print(json.dumps([vector_bits(), rates, errors]))
"""


def run_vectors(
    out: Path,
    *,
    quick: bool = False,
    stage: Callable[[str, int], Progress] = lambda name, total: lambda done: None,
) -> list[Path]:
    """Measure and write ``vectors.md`` into the folder ``out``; ``quick`` takes one turn."""
    turns = 1 if quick else TURNS
    advance = stage("vectors", turns * len(BUILDS))
    rates: dict[str, list[list[float]]] = {name: [] for name in BUILDS}
    bits, errors, failures = {}, {}, []
    for _ in range(turns):
        for name, build in BUILDS.items():
            try:
                bits[name], found, errors[name] = measured(*build)
                rates[name].append(found)
            except subprocess.CalledProcessError:
                failures.append(name)
            advance(1)
    lines = [
        "# Vector widths",
        "",
        "1,024 rest starts to t = 10 s, trajectories per core second, medians of processes in turns; the "
        "same sources compiled for "
        + " and ".join(f"{n} ({b[0]}, `{b[1]}`)" for n, b in BUILDS.items())
        + ".",
        "",
        *(f"{name}: this processor cannot run it." for name in dict.fromkeys(failures)),
    ]
    known = {name: [statistics.median(c) for c in zip(*r, strict=True)] for name, r in rates.items() if r}
    slow = [i for i, (module, *_) in enumerate(ENTRANTS) if module == "plain"]
    for name, medians in known.items():
        lines += [
            f"## {name}: vectors of {bits[name]} bit",
            "",
            *table(
                ["integrator", "rate", "over plain Numba, small arrays", "local numbers", "largest error"],
                (
                    [f"{family}, {setting}", f"{rate:,.0f}"]
                    + [f"{rate / medians[i]:.2f}" if family == "fastmech rk4" else "" for i in slow]
                    + [f"{error:.1e}"]
                    for (_, family, setting), rate, error in zip(ENTRANTS, medians, errors[name], strict=True)
                ),
            ),
        ]
    out.mkdir(parents=True, exist_ok=True)
    path = out / "vectors.md"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return [path]


def measured(processor: str, features: str) -> tuple[int, list[float], list[float]]:
    """Width of the vectors [bit], rates [1/s] and largest errors in a process compiled for this processor.

    Raises:
        subprocess.CalledProcessError: the process failed, as where the processor lacks the instructions.
    """
    environment = os.environ | {"NUMBA_CPU_NAME": processor, "NUMBA_CPU_FEATURES": features}
    environment["PYTHONPATH"] = os.pathsep.join(path for path in sys.path if path)
    command = [sys.executable, "-c", SCRIPT, json.dumps(ENTRANTS)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    bits, rates, errors = json.loads(done.stdout.splitlines()[-1])
    return bits, rates, errors
