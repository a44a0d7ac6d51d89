"""Maps of equilibria and fold curves against what a user would do otherwise, in plain SciPy.

The peers get the same equations in NumPy. Multistart: ``scipy.optimize.root`` from 64 random starts at every
point, duplicates removed; what it misses is counted against the certified map. Continuation: a
pseudo-arclength loop with ``scipy.optimize.fsolve`` from one fold point that it is given.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from fastmech.atlas.folds import trace_folds
from fastmech.atlas.map import EquilibriumMap, map_equilibria
from fastmech.ensembles.run import Progress
from fastmech.ensembles.threads import thread_count
from fastmech.equilibria.outcome import Outcome
from fastmech.scene import Scene

Floats = NDArray[np.float64]

SCENE = Scene(c1=294.9, c2=92.85, F0=85.3, alpha=0.0)
F0_RANGE, C1_RANGE = (-400.0, 400.0), (0.0, 400.0)

STARTS = 64

#: Distance in F0 [N] of the scenes beside folds.
NEAR_FOLD = 0.01
REPEATS = 3


@dataclass(frozen=True)
class AtlasRow:
    """What one way of finding equilibria did on the same region of parameters."""

    name: str
    threads: int
    points: int
    rate: float  #: points per second, median of warm calls
    found: int  #: equilibria found
    missed: int  #: equilibria that exist, by the certified map, and were not found
    incomplete: int  #: points at which at least one is missing
    unproved: int  #: points without a proof that all are found


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
    side, sample = (200, 100) if quick else (1000, 2000)
    rows = []
    advance = stage("maps", 2)
    for threads in sorted({1, thread_count(None)}):
        rows.append(certified(side, threads))
        advance(1)
    advance = stage("multistart", 3 * sample)
    rows.append(multistart("in the map's region", region_scenes(sample), advance))
    rows.append(multistart("random scenes", random_scenes(sample), advance))
    rows.append(multistart(f"within {NEAR_FOLD:g} N of a fold", fold_scenes(sample), advance))
    advance = stage("fold curves", 2)
    folds = [traced()]
    advance(1)
    folds.append(plain_continuation())
    advance(1)
    out.mkdir(parents=True, exist_ok=True)
    table = out / "atlas.md"
    table.write_text(markdown(rows, folds), encoding="utf-8")
    return [table]


def grid(side: int) -> dict[str, Floats]:
    """The map's axes."""
    return {"F0": np.linspace(*F0_RANGE, side), "c1": np.linspace(*C1_RANGE, side)}


def certified(side: int, threads: int) -> AtlasRow:
    """The package's map, certificate, stability and sheets included."""
    map_equilibria(SCENE, grid(20), threads=threads)
    seconds = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        atlas = map_equilibria(SCENE, grid(side), threads=threads)
        seconds.append(time.perf_counter() - began)
    unproved = int(np.count_nonzero(atlas.outcome != Outcome.COMPLETE))
    rate = side * side / statistics.median(seconds)
    return AtlasRow(
        "fastmech map_equilibria", threads, side * side, rate, int(atlas.count.sum(dtype=int)), 0, 0, unproved
    )


def gradient(q: Floats, a: float, C: float, b: float, f: float) -> list[float]:
    """Gradient of U as a user would type it."""
    pull = C * np.cos(q[0] + q[1])
    return [a * np.cos(q[0]) + f * np.sin(q[0]) - pull, b * np.sin(q[1]) + f * np.cos(q[1]) - pull]


def hessian(q: Floats, a: float, C: float, b: float, f: float) -> list[list[float]]:
    """Its Jacobian."""
    s = C * np.sin(q[0] + q[1])
    return [
        [f * np.cos(q[0]) - a * np.sin(q[0]) + s, s],
        [s, b * np.cos(q[1]) - f * np.sin(q[1]) + s],
    ]


def loads(s: Scene) -> tuple[float, float, float, float]:
    """a, C, b, f of a scene [J]."""
    return (s.m1 + s.m2) * s.g * s.l - s.c2 * s.l**2, s.c1 * s.l**2, s.m2 * s.g * s.l, s.F0 * s.l


def region_scenes(n: int) -> list[Scene]:
    """Random points of the map's region."""
    rng = np.random.default_rng(1)
    return [SCENE.replace(F0=rng.uniform(*F0_RANGE), c1=rng.uniform(*C1_RANGE)) for _ in range(n)]


def random_scenes(n: int) -> list[Scene]:
    """Four decades of stiffness, forces of both signs, l 0.2-4 m, masses 0.1-100 kg."""
    rng = np.random.default_rng(2)
    return [
        Scene(
            **{name: 10 ** rng.uniform(-1.0, 2.0) for name in ("m1", "m2", "m3")},
            **{name: 10 ** rng.uniform(0.0, 4.0) for name in ("c1", "c2")},
            l=rng.uniform(0.2, 4.0),
            F0=rng.choice([-1.0, 1.0]) * 10 ** rng.uniform(-1.0, 4.0),
            alpha=0.0,
        )
        for _ in range(n)
    ]


def fold_scenes(n: int) -> list[Scene]:
    """Points of the map's region just beside its fold curves, on either side."""
    rng = np.random.default_rng(4)
    curves = trace_folds(SCENE, *grid(201).items()).curves
    x, y = (np.concatenate([getattr(curve, name) for curve in curves]) for name in ("x", "y"))
    chosen = rng.integers(x.size, size=n)
    sides = rng.choice([-NEAR_FOLD, NEAR_FOLD], n)
    return [
        SCENE.replace(F0=float(x[k] + side), c1=float(y[k])) for k, side in zip(chosen, sides, strict=True)
    ]


def multistart(where: str, scenes: list[Scene], advance: Progress) -> AtlasRow:
    """SciPy from random starts, duplicates removed; what it misses is counted by the certified count."""
    rng = np.random.default_rng(3)
    missed = incomplete = total = 0
    seconds = 0.0
    for scene in scenes:
        args = loads(scene)
        size = sum(abs(x) for x in args)
        began = time.perf_counter()
        found: list[Floats] = []
        for start in rng.uniform(-np.pi, np.pi, (STARTS, 2)):
            solution = optimize.root(gradient, start, args=args, jac=hessian)
            if np.abs(solution.fun).max() < 1e-9 * size and not any(
                np.abs(np.exp(1j * solution.x) - np.exp(1j * other)).max() < 1e-6 for other in found
            ):
                found.append(solution.x)
        seconds += time.perf_counter() - began
        exact = map_equilibria(scene, {"F0": [scene.F0]}, threads=1)
        lacking = int(exact.count[0]) - reached(exact, found)
        missed += lacking
        incomplete += lacking > 0
        total += len(found)
        advance(1)
    name, n = f"scipy.optimize.root, {STARTS} starts, {where}", len(scenes)
    return AtlasRow(name, 1, n, n / seconds, total, missed, incomplete, n)


def reached(exact: EquilibriumMap, found: list[Floats]) -> int:
    """How many certified equilibria of a point are among those found."""
    places = np.stack([exact.phi[0], exact.theta[0]], axis=-1)[: exact.count[0]]
    return sum(
        any(np.abs(np.exp(1j * place) - np.exp(1j * other)).max() < 1e-5 for other in found)
        for place in places
    )


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


def markdown(rows: list[AtlasRow], folds: list[FoldRow]) -> str:
    """The tables."""
    lines = ["# The equilibrium atlas", ""]
    lines += [
        f"Bistable scene, F0 from {F0_RANGE[0]:g} to {F0_RANGE[1]:g} N, c1 from {C1_RANGE[0]:g} to "
        f"{C1_RANGE[1]:g} N/m; medians of warm calls. The map includes proof, stability and sheets.",
        "",
        "| search | threads | points | points/s | equilibria | missed | points incomplete | no proof |",
        "|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for row in rows:
        lines.append(
            f"| {row.name} | {row.threads} | {row.points:,} | {row.rate:,.4g} | {row.found:,} | {row.missed} "
            f"| {row.incomplete} | {row.unproved} |"
        )
    best = max(row.rate for row in rows)
    peer = next(row.rate for row in rows if row.name.startswith("scipy"))
    lines += ["", f"In that region the map does {best / peer:,.0f} times as many points a second.", ""]
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
