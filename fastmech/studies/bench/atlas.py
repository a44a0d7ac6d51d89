"""Maps of equilibria against what a user would do otherwise: ``scipy.optimize.root`` from 64 random starts.

Multistart gets the same equations in NumPy at every point, duplicates removed; what it misses is counted
against the certified map.
"""

from __future__ import annotations

import statistics
import time

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from fastmech.arrays import Floats
from fastmech.ensembles.run import Progress
from fastmech.ensembles.threads import thread_count
from fastmech.outcome import Outcome
from fastmech.reports import Stage
from fastmech.scene import Scene
from fastmech.slider.atlas.folds import trace_folds
from fastmech.slider.atlas.map import map_equilibria
from fastmech.studies.reporting import in_turns, section

SCENE = Scene(c1=294.9, c2=92.85, F0=85.3, alpha=0.0)
F0_RANGE, C1_RANGE = (-400.0, 400.0), (0.0, 400.0)

REPEATS, STARTS = 3, 64

#: Numbers of starts after which what is still missing is counted.
TOLD = (8, 16, 32, 64)


def atlas_study(quick: bool, stage: Stage) -> list[str]:
    """``atlas.md``; ``quick`` is for trying the command."""
    side, sample = (200, 99) if quick else (1000, 1998)
    lines = side_by_side(side, region_scenes(sample), stage("maps and multistart", sample))
    axes = grid(201).items()
    advance = stage("fold curves", REPEATS + 1)
    taken, sets = in_turns({"": lambda: trace_folds(SCENE, *axes)}, REPEATS, advance, time.perf_counter)
    seconds, found = statistics.median(taken[""]), sets[""]
    return [
        *lines,
        f"`trace_folds` takes {seconds:.2f} s for the region's {len(found.curves)} curves and "
        f"{len(found.cusps)} cusps, {sum(curve.x.size for curve in found.curves)} points; largest residual "
        f"{max(curve.residual for curve in found.curves):.0e}.",
    ]


def side_by_side(side: int, scenes: list[Scene], advance: Progress) -> list[str]:
    """The map with one thread and with all, and multistart, in turns, so that each meets the same machine."""
    threads = sorted({1, thread_count(None)})
    for n in threads:
        map_equilibria(SCENE, grid(20), threads=n)
    rates: dict[int, list[float]] = {n: [] for n in threads}
    theirs, found, lacking = list[float](), 0, list[NDArray[np.int64]]()
    for turn in range(REPEATS):
        for n in threads:
            began = time.perf_counter()
            atlas = map_equilibria(SCENE, grid(side), threads=n)
            rates[n].append(side * side / (time.perf_counter() - began))
        seconds, count, missing = multistart(scenes[turn::REPEATS], advance)
        theirs.append(len(missing) / seconds)
        found, lacking = found + count, [*lacking, missing]
    missed = np.concatenate(lacking)
    unproved = int(np.count_nonzero(atlas.outcome != Outcome.COMPLETE))
    rows = [
        f"fastmech map_equilibria | {n} | {side * side:,} | {statistics.median(own):,.4g} | "
        f"{int(atlas.count.sum(dtype=int)):,} | 0 | 0 | {unproved}"
        for n, own in rates.items()
    ]
    n, sums = len(scenes), ", ".join(map(str, missed.sum(axis=0)))
    rows.append(
        f"scipy.optimize.root, {STARTS} starts | 1 | {n:,} | {statistics.median(theirs):,.4g} | {found:,} | "
        f"{sums if missed.any() else 0} | {np.count_nonzero(missed[:, -1])} | {n}"
    )
    about = (
        f"Bistable scene, F0 from {F0_RANGE[0]:g} to {F0_RANGE[1]:g} N, c1 from {C1_RANGE[0]:g} to "
        f"{C1_RANGE[1]:g} N/m; medians of warm calls in turns. The map includes proof, stability and sheets. "
        f"Missed: equilibria of the certified map that multistart has not found after "
        f"{', '.join(map(str, TOLD))} starts; its rate and the other columns are for {STARTS}."
    )
    head = "search | threads | points | points/s | equilibria | missed | points incomplete | no proof"
    lines = section("# The equilibrium atlas", about, head, rows)
    for n, own in rates.items():
        ratios = sorted(a / b for a, b in zip(own, theirs, strict=True))
        lines += [
            f"In that region the map with {n} thread{'s' * (n > 1)} does {statistics.median(ratios):,.0f} "
            f"times as many points a second as multistart with one ({ratios[0]:,.0f} to {ratios[-1]:,.0f} "
            f"over {REPEATS} turns); a million take {1e6 / statistics.median(own):.1f} s.",
            "",
        ]
    return lines


def grid(side: int) -> dict[str, Floats]:
    """The map's axes."""
    return {"F0": np.linspace(*F0_RANGE, side), "c1": np.linspace(*C1_RANGE, side)}


def gradient(q: Floats, a: float, C: float, b: float, f: float) -> list[float]:
    """Gradient of U as a user would type it."""
    pull = C * np.cos(q[0] + q[1])
    return [a * np.cos(q[0]) + f * np.sin(q[0]) - pull, b * np.sin(q[1]) + f * np.cos(q[1]) - pull]


def hessian(q: Floats, a: float, C: float, b: float, f: float) -> list[list[float]]:
    """Its Jacobian."""
    s = C * np.sin(q[0] + q[1])
    first, second = f * np.cos(q[0]) - a * np.sin(q[0]) + s, b * np.cos(q[1]) - f * np.sin(q[1]) + s
    return [[first, s], [s, second]]


def region_scenes(n: int) -> list[Scene]:
    """Random points of the map's region."""
    rng = np.random.default_rng(1)
    return [SCENE.replace(F0=rng.uniform(*F0_RANGE), c1=rng.uniform(*C1_RANGE)) for _ in range(n)]


def multistart(scenes: list[Scene], advance: Progress) -> tuple[float, int, NDArray[np.int64]]:
    """SciPy from random starts, duplicates removed; what it misses is counted by the certified count.

    Returns:
        Seconds, equilibria found, and those of the certified map that are lacking, (scenes, len(TOLD)).
    """
    rng = np.random.default_rng(3)
    seconds, count, lacking = 0.0, 0, []
    for s in scenes:
        a, C, b, f = (s.m1 + s.m2) * s.g * s.l - s.c2 * s.l**2, s.c1 * s.l**2, s.m2 * s.g * s.l, s.F0 * s.l
        began = time.perf_counter()
        found: list[tuple[int, Floats]] = []
        for n, start in enumerate(rng.uniform(-np.pi, np.pi, (STARTS, 2)), start=1):
            solution = optimize.root(gradient, start, args=(a, C, b, f), jac=hessian)
            known = any(_same(solution.x, other, 1e-6) for _, other in found)
            if np.abs(solution.fun).max() < 1e-9 * sum(map(abs, (a, C, b, f))) and not known:
                found.append((n, solution.x))
        seconds += time.perf_counter() - began
        exact = map_equilibria(s, {"F0": [s.F0]}, threads=1)
        places = np.stack([exact.phi[0], exact.theta[0]], axis=-1)[: exact.count[0]]
        first = [min((n for n, x in found if _same(place, x, 1e-5)), default=np.inf) for place in places]
        count += len(found)
        lacking.append([sum(n > most for n in first) for most in TOLD])
        advance(1)
    return seconds, count, np.array(lacking)


def _same(one: Floats, other: Floats, within: float) -> bool:
    return bool(np.abs(np.exp(1j * one) - np.exp(1j * other)).max() < within)
