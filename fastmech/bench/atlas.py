"""Maps of equilibria and fold curves against what a user would do otherwise, in plain SciPy.

The peers get the same equations in NumPy. Multistart: ``scipy.optimize.root`` from 64 random starts at every
point, duplicates removed; what it misses is counted against the certified map. Continuation: a
pseudo-arclength loop with ``scipy.optimize.fsolve`` from one fold point that it is given.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from fastmech.atlas.folds import trace_folds
from fastmech.atlas.map import map_equilibria
from fastmech.bench.multistart import (
    C1_RANGE,
    F0_RANGE,
    NEAR_FOLD,
    SCENE,
    STARTS,
    TOLD,
    AtlasRow,
    fold_scenes,
    gradient,
    grid,
    hessian,
    loads,
    multistart,
    random_scenes,
    region_scenes,
)
from fastmech.ensembles.run import Progress
from fastmech.ensembles.threads import thread_count
from fastmech.equilibria.outcome import Outcome
from fastmech.scene import Scene

Floats = NDArray[np.float64]

REPEATS = 3


@dataclass(frozen=True)
class FoldRow:
    """What one way of tracing folds did in the same rectangle."""

    name: str
    seconds: float  #: median of warm calls
    curves: int
    cusps: int  #: located
    points: int
    residual: float  #: largest scaled residual


def run_atlas(
    out: Path,
    *,
    quick: bool = False,
    stage: Callable[[str, int], Progress] = lambda name, total: lambda done: None,
) -> list[Path]:
    """Measure and write ``atlas.md`` into the folder ``out``; ``quick`` is for trying the command."""
    side, sample = (200, 99) if quick else (1000, 1998)
    rows, ratios = side_by_side(side, region_scenes(sample), stage("maps and multistart", sample))
    advance = stage("multistart elsewhere", 2 * sample)
    rows.append(multistart("random scenes", random_scenes(sample), advance))
    rows.append(multistart(f"within {NEAR_FOLD:g} N of a fold", fold_scenes(sample), advance))
    advance = stage("fold curves", 2)
    folds = [traced()]
    advance(1)
    folds.append(plain_continuation())
    advance(1)
    out.mkdir(parents=True, exist_ok=True)
    table = out / "atlas.md"
    table.write_text(markdown(rows, ratios, folds), encoding="utf-8")
    return [table]


def side_by_side(
    side: int, scenes: list[Scene], advance: Progress
) -> tuple[list[AtlasRow], dict[int, tuple[float, float, float]]]:
    """The map with one thread and with all, and multistart, in turns, so that each meets the same machine.

    Returns:
        A row for each, and by the map's threads the least, median and largest ratio of rates over the turns.
    """
    threads = sorted({1, thread_count(None)})
    rates: dict[int, list[float]] = {n: [] for n in threads}
    turns: list[AtlasRow] = []
    for n in threads:
        map_equilibria(SCENE, grid(20), threads=n)
    for turn in range(REPEATS):
        for n in threads:
            began = time.perf_counter()
            atlas = map_equilibria(SCENE, grid(side), threads=n)
            rates[n].append(side * side / (time.perf_counter() - began))
        turns.append(multistart("in the map's region", scenes[turn::REPEATS], advance))
    unproved = int(np.count_nonzero(atlas.outcome != Outcome.COMPLETE))
    found = int(atlas.count.sum(dtype=int))
    rows = [
        AtlasRow(
            "fastmech map_equilibria",
            n,
            side * side,
            statistics.median(rates[n]),
            found,
            (0,) * len(TOLD),
            0,
            unproved,
        )
        for n in threads
    ]
    together = turns[0]
    for row in turns[1:]:
        together = replace(
            together,
            points=together.points + row.points,
            found=together.found + row.found,
            missed=tuple(a + b for a, b in zip(together.missed, row.missed, strict=True)),
            incomplete=together.incomplete + row.incomplete,
            unproved=together.unproved + row.unproved,
        )
    rows.append(replace(together, rate=statistics.median(row.rate for row in turns)))
    ratios = {n: sorted(mine / row.rate for mine, row in zip(rates[n], turns, strict=True)) for n in threads}
    return rows, {n: (each[0], statistics.median(each), each[-1]) for n, each in ratios.items()}


def traced() -> FoldRow:
    """The package's fold curves, seeds and cusps included."""
    axes = grid(201)
    seconds = []
    for _ in range(REPEATS + 1):
        began = time.perf_counter()
        found = trace_folds(SCENE, *axes.items())
        seconds.append(time.perf_counter() - began)
    points = sum(curve.x.size for curve in found.curves)
    residual = max(curve.residual for curve in found.curves)
    return FoldRow(
        "fastmech trace_folds",
        statistics.median(seconds[1:]),
        len(found.curves),
        len(found.cusps),
        points,
        residual,
    )


def plain_continuation() -> FoldRow:
    """Pseudo-arclength in plain SciPy: one curve, from a fold that it is told, the same step."""
    given = trace_folds(SCENE, *grid(201).items()).curves[0]
    middle = given.x.size // 2
    width, height = np.ptp(F0_RANGE), np.ptp(C1_RANGE)
    scale = np.array([1.0, 1.0, width, height])
    start = np.array([given.phi[middle], given.theta[middle], given.x[middle], given.y[middle]]) / scale

    def equations(z: Floats) -> Floats:
        phi, theta, F0, c1 = z * scale
        args = loads(SCENE.replace(F0=float(F0), c1=float(max(c1, 0.0))))
        size = sum(abs(x) for x in args)
        (h11, h12), (_, h22) = hessian(np.array([phi, theta]), *args)
        return np.array([*gradient(np.array([phi, theta]), *args), (h11 * h22 - h12 * h12) / size]) / size

    def march(direction: float) -> list[Floats]:
        z, points = start, [start]
        tangent = direction * np.linalg.svd(optimize.approx_fprime(z, equations))[2][-1]
        for _ in range(4000):
            ahead, current = z + 0.02 * tangent, tangent

            def bordered(x: Floats, ahead: Floats = ahead, current: Floats = current) -> Floats:
                return np.append(equations(x), current @ (x - ahead))

            solution, _, flag, _ = optimize.fsolve(bordered, ahead, full_output=True, xtol=1e-13)
            F0, c1 = (solution * scale)[2:]
            if flag != 1 or not (F0_RANGE[0] <= F0 <= F0_RANGE[1] and C1_RANGE[0] <= c1 <= C1_RANGE[1]):
                break
            tangent = (solution - z) / np.linalg.norm(solution - z)
            z = solution
            points.append(z)
        return points

    began = time.perf_counter()
    points = march(1.0) + march(-1.0)
    seconds = time.perf_counter() - began
    residual = max(float(np.abs(equations(z)).max()) for z in points)
    return FoldRow("pseudo-arclength, SciPy fsolve", seconds, 1, 0, len(points), residual)


def markdown(
    rows: list[AtlasRow], ratios: dict[int, tuple[float, float, float]], folds: list[FoldRow]
) -> str:
    """The tables."""
    starts = ", ".join(map(str, TOLD))
    lines = ["# The equilibrium atlas", ""]
    lines += [
        f"Bistable scene, F0 from {F0_RANGE[0]:g} to {F0_RANGE[1]:g} N, c1 from {C1_RANGE[0]:g} to "
        f"{C1_RANGE[1]:g} N/m; medians of warm calls in turns. The map includes proof, stability and sheets. "
        f"Missed: equilibria of the certified map that multistart has not found after {starts} starts; its "
        f"rate and the other columns are for {STARTS}.",
        "",
        "| search | threads | points | points/s | equilibria | missed | points incomplete | no proof |",
        "|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for row in rows:
        missed = ", ".join(map(str, row.missed)) if any(row.missed) else "0"
        lines.append(
            f"| {row.name} | {row.threads} | {row.points:,} | {row.rate:,.4g} | {row.found:,} | {missed} "
            f"| {row.incomplete} | {row.unproved} |"
        )
    lines.append("")
    for row in (row for row in rows if row.name.startswith("fastmech")):
        low, middle, high = ratios[row.threads]
        by = f"{row.threads} thread{'s' * (row.threads > 1)}"
        lines += [
            f"In that region the map with {by} does {middle:,.0f} times as many points a second as "
            f"multistart with one ({low:,.0f} to {high:,.0f} over {REPEATS} turns); a million take "
            f"{1e6 / row.rate:.1f} s.",
            "",
        ]
    lines += [
        "| fold curves | s | curves | cusps | points | largest residual |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for fold in folds:
        lines.append(
            f"| {fold.name} | {fold.seconds:.2f} | {fold.curves} | {fold.cusps} | {fold.points} "
            f"| {fold.residual:.0e} |"
        )
    return "\n".join([*lines, ""])
