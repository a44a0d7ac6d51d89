"""Maps of equilibria against what a user would do otherwise: ``scipy.optimize.root`` from 64 random starts.

Multistart gets the same equations in NumPy at every point, duplicates removed; what it misses is counted
against the certified map.
"""

from __future__ import annotations

import statistics
import time
from typing import NamedTuple

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


class AtlasRow(NamedTuple):
    """What one way of finding equilibria did on the same region of parameters."""

    name: str
    threads: int
    points: int
    rate: float  #: points per second, median of warm calls
    found: int  #: equilibria found
    missed: tuple[int, ...]  #: after each of ``TOLD`` starts, equilibria of the certified map not found yet
    incomplete: int  #: points at which at least one is missing
    unproved: int  #: points without a proof that all are found


class GridSearch(NamedTuple):
    """Multistart at n points."""

    seconds: Floats  #: (n,)
    found: NDArray[np.int64]  #: (n,), equilibria
    lacking: NDArray[np.int64]  #: (n, len(TOLD)), of those of the certified map


def atlas_study(quick: bool, stage: Stage) -> list[str]:
    """``atlas.md``; ``quick`` is for trying the command."""
    side, sample = (200, 99) if quick else (1000, 1998)
    rows, ratios = side_by_side(side, region_scenes(sample), stage("maps and multistart", sample))
    return [*markdown(rows, ratios), traced(stage)]


def side_by_side(
    side: int, scenes: list[Scene], advance: Progress
) -> tuple[list[AtlasRow], dict[int, tuple[float, float, float]]]:
    """The map with one thread and with all, and multistart, in turns, so that each meets the same machine.

    Returns:
        A row for each, and by the map's threads the least, median and largest ratio of rates over the turns.
    """
    threads = sorted({1, thread_count(None)})
    turns: list[GridSearch] = []
    for n in threads:
        map_equilibria(SCENE, grid(20), threads=n)
    rates: dict[int, list[float]] = {n: [] for n in threads}
    for turn in range(REPEATS):
        for n in threads:
            began = time.perf_counter()
            atlas = map_equilibria(SCENE, grid(side), threads=n)
            rates[n].append(side * side / (time.perf_counter() - began))
        turns.append(multistart(scenes[turn::REPEATS], advance))
    theirs = [turn.seconds.size / turn.seconds.sum() for turn in turns]
    unproved = int(np.count_nonzero(atlas.outcome != Outcome.COMPLETE))
    told = int(atlas.count.sum(dtype=int)), (0,) * len(TOLD), 0, unproved
    rows = [
        AtlasRow("fastmech map_equilibria", n, side * side, statistics.median(own), *told)
        for n, own in rates.items()
    ]
    together = row_of(GridSearch(*(np.concatenate(x) for x in zip(*turns, strict=True))))
    rows.append(together._replace(rate=statistics.median(theirs)))
    ratios = {n: sorted(a / b for a, b in zip(own, theirs, strict=True)) for n, own in rates.items()}
    return rows, {n: (each[0], statistics.median(each), each[-1]) for n, each in ratios.items()}


def traced(stage: Stage) -> str:
    """How long the fold curves of the region take, seeds and cusps included."""
    axes = grid(201).items()
    advance = stage("fold curves", REPEATS + 1)
    taken, sets = in_turns({"": lambda: trace_folds(SCENE, *axes)}, REPEATS, advance, time.perf_counter)
    seconds, found = taken[""], sets[""]
    return (
        f"`trace_folds` takes {statistics.median(seconds):.2f} s for the region's {len(found.curves)} curves "
        f"and {len(found.cusps)} cusps, {sum(curve.x.size for curve in found.curves)} points; largest "
        f"residual {max(curve.residual for curve in found.curves):.0e}."
    )


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


def loads(s: Scene) -> tuple[float, float, float, float]:
    """a, C, b, f of a scene [J]."""
    return (s.m1 + s.m2) * s.g * s.l - s.c2 * s.l**2, s.c1 * s.l**2, s.m2 * s.g * s.l, s.F0 * s.l


def region_scenes(n: int) -> list[Scene]:
    """Random points of the map's region."""
    rng = np.random.default_rng(1)
    return [SCENE.replace(F0=rng.uniform(*F0_RANGE), c1=rng.uniform(*C1_RANGE)) for _ in range(n)]


def multistart(scenes: list[Scene], advance: Progress) -> GridSearch:
    """SciPy from random starts, duplicates removed; what it misses is counted by the certified count."""
    rng = np.random.default_rng(3)
    seconds, count, lacking = [], [], []
    for scene in scenes:
        args = loads(scene)
        size = sum(abs(x) for x in args)
        began = time.perf_counter()
        found: list[tuple[int, Floats]] = []
        for n, start in enumerate(rng.uniform(-np.pi, np.pi, (STARTS, 2)), start=1):
            solution = optimize.root(gradient, start, args=args, jac=hessian)
            known = any(_same(solution.x, other, 1e-6) for _, other in found)
            if np.abs(solution.fun).max() < 1e-9 * size and not known:
                found.append((n, solution.x))
        seconds.append(time.perf_counter() - began)
        exact = map_equilibria(scene, {"F0": [scene.F0]}, threads=1)
        places = np.stack([exact.phi[0], exact.theta[0]], axis=-1)[: exact.count[0]]
        first = [min((n for n, x in found if _same(place, x, 1e-5)), default=np.inf) for place in places]
        count.append(len(found))
        lacking.append([sum(n > most for n in first) for most in TOLD])
        advance(1)
    return GridSearch(np.array(seconds), np.array(count), np.array(lacking))


def _same(one: Floats, other: Floats, within: float) -> bool:
    return bool(np.abs(np.exp(1j * one) - np.exp(1j * other)).max() < within)


def row_of(search: GridSearch) -> AtlasRow:
    """Multistart's row."""
    name, n = f"scipy.optimize.root, {STARTS} starts", search.seconds.size
    missed = tuple(search.lacking.sum(axis=0).tolist())
    incomplete = int(np.count_nonzero(search.lacking[:, -1]))
    return AtlasRow(name, 1, n, n / search.seconds.sum(), int(search.found.sum()), missed, incomplete, n)


def markdown(rows: list[AtlasRow], ratios: dict[int, tuple[float, float, float]]) -> list[str]:
    """The table and the ratios."""
    cells = (
        f"{r.name} | {r.threads} | {r.points:,} | {r.rate:,.4g} | {r.found:,} | "
        f"{', '.join(map(str, r.missed)) if any(r.missed) else 0} | {r.incomplete} | {r.unproved}"
        for r in rows
    )
    about = (
        f"Bistable scene, F0 from {F0_RANGE[0]:g} to {F0_RANGE[1]:g} N, c1 from {C1_RANGE[0]:g} to "
        f"{C1_RANGE[1]:g} N/m; medians of warm calls in turns. The map includes proof, stability and sheets. "
        f"Missed: equilibria of the certified map that multistart has not found after "
        f"{', '.join(map(str, TOLD))} starts; its rate and the other columns are for {STARTS}."
    )
    head = "search | threads | points | points/s | equilibria | missed | points incomplete | no proof"
    lines = section("# The equilibrium atlas", about, head, cells)
    for row, (low, middle, high) in zip(rows, ratios.values(), strict=False):
        by = f"{row.threads} thread{'s' * (row.threads > 1)}"
        lines += [
            f"In that region the map with {by} does {middle:,.0f} times as many points a second as "
            f"multistart with one ({low:,.0f} to {high:,.0f} over {REPEATS} turns); a million take "
            f"{1e6 / row.rate:.1f} s.",
            "",
        ]
    return lines
