"""The heavily damped ensemble: implicit methods on lanes beside SciPy's stiff integrators, at equal error."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from fastmech.bench.plain import scalar_rhs
from fastmech.bench.problem import rest_starts
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.run import Progress
from fastmech.mechanism.coefficients import reduce
from fastmech.scene import Scene

Floats = NDArray[np.float64]

BETAS, T_END = (1e4, 1e6), 2.0

#: Steps a second of each method of the package, and tolerances of SciPy's.
STEPS = {"radau5": (60, 120, 240), "sdirk4": (120, 240)}
TOLERANCES = {"Radau": (1e-6, 1e-8), "LSODA": (1e-8, 1e-10)}

REPEATS = 3

#: Largest ratio of errors at which two are called equal.
EQUAL = 1.5


def run_stiff(
    out: Path,
    *,
    quick: bool = False,
    stage: Callable[[str, int], Progress] = lambda name, total: lambda done: None,
) -> list[Path]:
    """Measure and write ``stiff.md`` into the folder ``out``: one thread, medians of warm calls.

    The reference is ``gauss6`` at a hundredth of the step, which shares no coefficient with the entrants;
    the gallery of hard cases compares the same methods with extended precision.
    """
    n, few = (128, 4) if quick else (2048, 16)
    starts = rest_starts(n).starts
    lines = ["# Heavy damping", "", f"Rest starts, t = {T_END:g} s, one thread.", ""]
    advance = stage("stiff", len(BETAS))
    for beta in BETAS:
        scene = Scene(alpha=0.0, beta=beta)
        truth = integrate(scene, starts[:few], T_END, 1 / 6400, "gauss6", threads=1).y[-1]
        ours = [
            (f"fastmech {m}, dt = 1/{k} s", *_timed(_package(scene, m, 1 / k), starts, truth))
            for m, ks in STEPS.items()
            for k in ks
        ]
        theirs = [
            (f"SciPy {m}, rtol = {tol:g}", *_timed(_scipy(scene, m, tol), starts[:few], truth))
            for m, tols in TOLERANCES.items()
            for tol in tols
        ]
        lines += [
            f"## beta = {beta:g} N s/m",
            "",
            "| integrator | trajectories/s | max error |",
            "|---|---:|---:|",
        ]
        lines += [f"| {name} | {rate:,.0f} | {error:.0e} |" for name, rate, error in ours + theirs]
        lines.append("")
        for name, rate, error in theirs:
            equal = [(r, other) for other, r, e in ours if e <= EQUAL * error]
            if equal:
                best, other = max(equal)
                lines.append(f"- {other}: {best / rate:,.0f} times {name}")
        lines.append("")
        advance(1)
    out.mkdir(parents=True, exist_ok=True)
    table = out / "stiff.md"
    table.write_text("\n".join(lines), encoding="utf-8")
    return [table]


def _timed(run: Callable[[Floats], Floats], starts: Floats, truth: Floats) -> tuple[float, float]:
    run(starts[:2])
    seconds = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        final = run(starts)
        seconds.append(time.perf_counter() - began)
    return len(starts) / statistics.median(seconds), float(np.abs(final[: len(truth)] - truth).max())


def _package(scene: Scene, method: str, dt: float) -> Callable[[Floats], Floats]:
    return lambda starts: integrate(scene, starts, T_END, dt, method, threads=1).y[-1]


def _scipy(scene: Scene, method: str, tolerance: float) -> Callable[[Floats], Floats]:
    p = np.array(reduce(scene))

    def run(starts: Floats) -> Floats:
        options = {"method": method, "args": (p,), "rtol": tolerance, "atol": tolerance * 1e-2}
        return np.array([solve_ivp(scalar_rhs, (0.0, T_END), y0, **options).y[:, -1] for y0 in starts])

    return run
