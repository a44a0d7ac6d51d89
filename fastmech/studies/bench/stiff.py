"""The heavily damped ensemble: implicit methods on lanes beside SciPy's stiff integrators, at equal error."""

from __future__ import annotations

import statistics
import time
from functools import partial

import numpy as np

from fastmech.reports import Stage
from fastmech.scene import Scene
from fastmech.studies.bench import peers
from fastmech.studies.bench.entrants import prepared
from fastmech.studies.bench.measure import rest_starts
from fastmech.studies.reporting import in_turns, section

BETAS, T_END = (1e4, 1e6), 2.0

#: Steps a second of each method of the package, and tolerances of SciPy's.
STEPS = (("radau5", 60), ("radau5", 120), ("radau5", 240), ("sdirk4", 120), ("sdirk4", 240))
TOLERANCES = (("Radau", 1e-6), ("Radau", 1e-8), ("LSODA", 1e-8), ("LSODA", 1e-10))

REPEATS = 3

#: Largest ratio of errors at which two are called equal.
EQUAL = 1.5


def stiff_study(quick: bool, stage: Stage) -> list[str]:
    """``stiff.md``: one thread, medians of warm calls.

    The reference is ``gauss6`` at a hundredth of the step, which shares no coefficient with the entrants;
    the gallery of hard cases compares the same methods with extended precision.
    """
    n, few = (128, 4) if quick else (2048, 16)
    lines = ["# Heavy damping", "", f"Rest starts, t = {T_END:g} s, one thread.", ""]
    for beta in BETAS:
        problem = rest_starts(n)._replace(scene=Scene(alpha=0.0, beta=beta), t_end=T_END)
        first = problem.starts[:few]
        truth = prepared({"method": "gauss6", "dt": 1 / 6400})(problem)(first)
        ours, theirs = {}, {}
        for method, k in STEPS:
            solve = prepared({"method": method, "dt": 1 / k})(problem)
            ours[f"fastmech {method}, dt = 1/{k} s"] = partial(solve, problem.starts)
        for method, tol in TOLERANCES:
            solve = peers.scipy(method, tol, problem, atol=0.01 * tol)
            theirs[f"SciPy {method}, rtol = {tol:g}"] = partial(solve, first)
        works = ours | theirs
        advance = stage(f"stiff, beta = {beta:g}", len(works) * (REPEATS + 1))
        seconds, final = in_turns(works, REPEATS, advance, time.perf_counter)
        rates = {name: len(final[name]) / statistics.median(each) for name, each in seconds.items()}
        errors = {name: float(np.abs(end[:few] - truth).max()) for name, end in final.items()}
        rows = (f"{name} | {rates[name]:,.0f} | {errors[name]:.0e}" for name in works)
        lines += section(f"## beta = {beta:g} N s/m", "", "integrator | trajectories/s | max error", rows)
        for name in theirs:
            equal = [(rates[other], other) for other in ours if errors[other] <= EQUAL * errors[name]]
            if equal:
                best, other = max(equal)
                lines.append(f"- {other}: {best / rates[name]:,.0f} times {name}")
        lines.append("")
    return lines
