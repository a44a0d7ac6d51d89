"""Own systems and the mechanism: fixed steps and ``tol`` beside heyoka, at equal errors of all and of 99 %.

Systems, starts and ends are those of :mod:`.own_systems`. The truth is that of :mod:`.tolerances`. heyoka has
the rate of the setting with the error asked for, in hindsight.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
import sympy

from fastmech.arrays import Floats
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.work_precision import order_statistic
from fastmech.frontier import work_precision
from fastmech.integrators.methods import find_method
from fastmech.reports import Stage
from fastmech.scene import Scene
from fastmech.studies.bench.devices import cart, chain, explicit
from fastmech.studies.bench.entrants import installed, prepared
from fastmech.studies.bench.measure import BenchProblem, Entrant, Prepare, Row, measure, rate_at
from fastmech.studies.bench.own_systems import STARTS, SYSTEMS, in_numpy, starts_in
from fastmech.studies.bench.peers import heyoka
from fastmech.studies.bench.tolerances import FACTOR, ROUNDINGS, Rates, extended, scene_rates
from fastmech.studies.reporting import section

#: Errors at which rates are compared.
TARGETS = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)

#: Starts of the small ensembles, of those from which methods are picked, and of `--quick`.
SMALL, PICKED, QUICK = 1024, 2048, 256

#: Fastest methods of the small ensemble that run with everyone, at each error.
METHODS = 2

#: heyoka's tolerances.
HEYOKA = tuple(float(f"1e-{n}") for n in range(1, 15))

LEVELS = {0.99: "99 %", 1.0: "largest"}

#: The mechanism: Table 1 under its constant force for 10 s, with rates at the start up to so much [rad/s].
SCENES = {"Table 1, from rest": 0.0, "Table 1, moving": 3.0}

#: Random mechanisms: how they are made, seed, size of the starts' numbers, end [s].
DEVICES = {"random chain": (chain, 1, 1.0, 2.0), "random cart": (cart, 0, 0.5, 2.0)}


class Measured(NamedTuple):
    """What was measured on one system."""

    name: str
    fixed: dict[int, list[Row]]  #: by number of starts
    tol: dict[tuple[int, float, float], Row]  #: by number of starts, quantile and tolerance
    estimates: dict[tuple[int, float, float], float]
    heyoka: list[Row]
    call: float  #: seconds of heyoka's time on a trajectory in which a batch's call takes no step


def stacked(function: Callable[..., Any]) -> Rates:
    """Derivatives as an array of a function of time and states."""
    return lambda t, y: np.stack(np.broadcast_arrays(*function(t, *y)))


def problem_named(name: str, n: int) -> BenchProblem:
    """A system, the mechanism or a random mechanism with its first n starts and their truth."""
    scene: Any
    if name in SYSTEMS:
        own = SYSTEMS[name]
        scene, rates, starts, t_end = own.system(), stacked(in_numpy(own.rhs)), own.starts(n), own.t_end
    elif name in SCENES:
        scene, rate, t_end = Scene(alpha=0.0), SCENES[name], 10.0
        rates, starts = scene_rates(scene), starts_in([0.5, -1.0, -rate, -rate], [2.5, 1.0, rate, rate], n)
    else:
        made, seed, spread, t_end = DEVICES[name]
        scene = made(np.random.default_rng(seed))
        state, found = explicit(scene)
        rates = stacked(sympy.lambdify([sympy.Symbol("t"), *state], found, "numpy", cse=True))
        starts = starts_in([-spread] * len(state), [spread] * len(state), n)
    truth = extended(rates, starts, t_end, ROUNDINGS[1])
    return BenchProblem(name, name, scene, starts, truth.astype(np.float64), t_end=t_end, pace=1.0)


def candidates(problem: BenchProblem, targets: Sequence[float]) -> Iterator[dict[str, Any]]:
    """Methods with steps by which everyone, or 99 %, has the errors asked for."""
    starts, t_end = problem.starts, problem.t_end
    found = work_precision(problem.scene, starts[:PICKED], t_end, errors=targets)
    for target in targets:
        kept = sorted((p for p in found.points if p.largest <= target), key=lambda p: -p.rate)
        best = {p.method: p.dt for p in reversed(kept)}
        for method in list(dict.fromkeys(p.method for p in kept))[:METHODS]:
            for dtype in ("float64", "float32") if target >= 1e-4 else ("float64",):
                keywords = {"method": method, "dt": best[method], "dtype": dtype}
                errors = np.abs(prepared(keywords)(problem)(starts) - problem.truth).max(axis=1)
                for level in LEVELS:
                    ratio = 0.9 * target / max(order_statistic(errors, level), 1e-300)
                    factor = ratio ** (1.0 / find_method(method).order)
                    yield keywords | {"dt": best[method] * float(np.clip(factor, 0.4, 2.5))}


def to_tolerance(tol: float, quantile: float, estimates: dict[tuple[int, float, float], float]) -> Prepare:
    """A run to a tolerance, which leaves its estimate by number of starts, quantile and tolerance."""

    def solve(problem: BenchProblem, starts: Floats) -> Floats:
        run = integrate(problem.scene, starts, problem.t_end, tol=tol, quantile=quantile, threads=1)
        estimates[len(starts), quantile, tol] = float(run.error_estimate or 0.0)
        return np.asarray(run.y[-1])

    return lambda problem: partial(solve, problem)


def _rows(problem: BenchProblem, everyone: list[Entrant]) -> Iterator[Row]:
    rows, failed = measure(problem, everyone)
    for _, error in failed:
        raise error
    return iter(rows)


def measured(
    problem: BenchProblem, targets: Sequence[float], advance: Callable[[int], None] = lambda done: None
) -> Measured:
    """Everyone on one system, timed in turns."""
    n, found = len(problem.starts), Measured(problem.name, {}, {}, {}, [], call=0.0)
    settings = list(candidates(problem, targets))
    asked = [(quantile, target) for quantile in LEVELS for target in targets]
    peers = [
        Entrant("heyoka", f"{t:g}", partial(heyoka, t), n)
        for t in HEYOKA
        if t >= 1e-3 * min(targets) and "heyoka" in installed()
    ]
    advance(1)
    for size in dict.fromkeys((min(SMALL, n), n)):
        everyone = [
            Entrant(f"fastmech {k['method']}", f"{k['dt']:.4g} s, {k['dtype']}", prepared(k), size)
            for k in settings
        ]
        everyone += [Entrant("tol", "", to_tolerance(t, q, found.estimates), size) for q, t in asked]
        few = problem._replace(starts=problem.starts[:size], truth=problem.truth[:size])
        rows = _rows(few, everyone + peers * (size == n))
        found.fixed[size] = list(islice(rows, len(settings)))
        found.tol.update({(size, *key): next(rows) for key in asked})
        found.heyoka.extend(rows)
        advance(1)
    if not peers:
        return found
    idle = next(_rows(problem._replace(truth=problem.starts, t_end=0.0), [peers[len(peers) // 2]]))
    return found._replace(call=1.0 / idle.rate)


def rate(rows: list[Row], error: float, level: float = 1.0) -> float:
    """Trajectories a second where this share of the errors is at most ``error``; NaN: none is as accurate."""
    of_level = [row._replace(errors=np.array([order_statistic(row.errors, level)])) for row in rows]
    return rate_at(of_level, error) or math.nan


def ratios(found: Measured, target: float) -> dict[str, float]:
    """What is compared at one error, by column."""
    n = max(found.fixed)
    mine, theirs = rate(found.fixed[n], target), rate(found.heyoka, target)
    columns = {
        "fixed over heyoka": mine / theirs,
        "the same, its calls free": mine * (1.0 / theirs - found.call),
    }
    for level, name in LEVELS.items():
        own = found.tol[n, level, target].rate
        columns[f"`tol`, {name}, over heyoka"] = own / rate(found.heyoka, target, level)
    for level, name in LEVELS.items():
        for size in sorted(found.fixed):
            over = rate(found.fixed[size], target, level) / found.tol[size, level, target].rate
            columns[f"time of `tol` over fixed, {name}, {size:,}"] = over
    return columns


def estimate_ratios(found: Measured) -> list[float]:
    """Estimates of ``tol`` over the truth, where both are finite."""
    pairs = [(found.estimates[key], order_statistic(row.errors, key[1])) for key, row in found.tol.items()]
    return [estimate / true for estimate, true in pairs if 0.0 < true < math.inf and estimate < math.inf]


def summary(found: Sequence[Measured], targets: Sequence[float]) -> list[str]:
    """Geometric means over systems, and the worst."""
    each = {target: [ratios(one, target) for one in found] for target in targets}
    lines = []
    for column in each[targets[0]][0]:
        line = [column]
        for target in targets:
            pairs = zip(each[target], found, strict=True)
            known = [(one[column], m.name.split(",")[0]) for one, m in pairs if math.isfinite(one[column])]
            if not known:
                line.append("-")
                continue
            mean = math.exp(sum(math.log(value) for value, _ in known) / len(known))
            worst = (max if column.startswith("time") else min)(known)
            few = f"; {len(known)} of {len(found)}" if len(known) < len(found) else ""
            line.append(f"{mean:.2f} ({worst[1]} {worst[0]:.2f}{few})")
        lines.append(line)
    every = np.array([r for one in found for r in estimate_ratios(one)])
    good = (every >= 1.0 / FACTOR) & (every <= FACTOR)
    about = "Geometric mean over systems, in brackets the worst."
    return [
        *section("", about, ["", *(f"{target:.0e}" for target in targets)], lines),
        f"`tol`'s estimate is within a factor {FACTOR:g} of the truth in {good.sum()} of {good.size} runs "
        f"({every.min():.2g} to {every.max():.2g} times it).",
        "",
    ]


def system_section(found: Measured, targets: Sequence[float]) -> list[str]:
    """One system: best settings, rates, ratios."""
    fixed, lines = found.fixed[max(found.fixed)], []
    for target in targets:
        keeping = [row for row in fixed if row.max_error <= target]
        best = max(keeping, key=lambda row: row.rate, default=None)
        setting = "-" if best is None else f"{best.family.removeprefix('fastmech ')}, {best.setting}"
        rates = (f"{rate(rows, target):,.0f}" for rows in (fixed, found.heyoka))
        lines.append(
            [f"{target:.0e}", setting, *rates, *(f"{r:.2f}" for r in ratios(found, target).values())]
        )
    head = ("error", "fastest fixed steps that keep it", "its rate [1/s]", "heyoka's [1/s]")
    return section(f"## {found.name}", "", [*head, *ratios(found, targets[0])], lines)


def systems_study(quick: bool, stage: Stage) -> list[str]:
    """``systems.md``; ``quick`` takes few starts of one system."""
    n, targets = (QUICK, TARGETS[:2]) if quick else (STARTS, TARGETS)
    systems, others = list(SYSTEMS), [*SCENES, *DEVICES]
    if quick:
        systems, others = systems[1:2], []
    advance, found = stage("systems", 4 * (len(systems) + len(others))), []
    for name in (*systems, *others):
        problem = problem_named(name, n)
        advance(1)
        found.append(measured(problem, targets, advance))
    return report(found[: len(systems)], targets, found[len(systems) :])


def report(found: list[Measured], targets: Sequence[float], scenes: Sequence[Measured] = ()) -> list[str]:
    """The study of own systems, and of ``scenes`` of the mechanism, as Markdown."""
    lines = [
        "# Own systems beside heyoka",
        "",
        f"{max(found[0].fixed):,} starts, one thread, all timed in turns, rates by processor time, compiling "
        "apart. Errors are those of final states against extended precision; rates at equal error are "
        "interpolated in logarithms. heyoka runs in batches with fast-math and has the rate of the tolerance "
        "that gives the error, in hindsight. Each batch is a call from Python; `its calls free` deducts what "
        "a call takes that makes no step. `tol` has its rate at that tolerance, whatever error it keeps.",
        "",
        *([] if found[0].heyoka else ["Not installed: heyoka.", ""]),
    ]
    for head, each in (([], found), (["# Mechanisms beside heyoka", ""], scenes)):
        if each:
            lines += [*head, *summary(each, targets)]
            lines += [line for one in each for line in system_section(one, targets)]
    return lines
