"""Attractors of published systems: how long finding and labelling takes, and labels beside other integrators.

Each start with a label is followed by heyoka (where it is installed) and a part of them by SciPy, to 1e-12
or better, until it lies within :data:`NEAR` of an orbit or stays in the cells of a chaotic attractor, at most
ten times as long as it took to arrive.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from fastmech.arrays import Floats
from fastmech.attractors.arrival import owners
from fastmech.attractors.find import Attractor, Attractors, find_attractors
from fastmech.basins.map import map_basins
from fastmech.ensembles.status import Status
from fastmech.ensembles.system import System
from fastmech.kernels.sincos import cos, sin
from fastmech.reports import Stage
from fastmech.samplers import Uniform
from fastmech.studies.bench.entrants import installed
from fastmech.studies.bench.own_systems import inverse_cube, spoken
from fastmech.studies.bench.peers import heyoka_equations
from fastmech.studies.reporting import in_turns, section

#: Starts that are timed and that others follow; those of SciPy; runs of which the median counts.
STARTS, FOLLOWED, BY_SCIPY, RUNS = 10_000, 2_000, 200, 5
QUICK_FOLLOWED, QUICK_BY_SCIPY = 200, 20

#: Points of a map a side.
SIDE, QUICK_SIDE = 1000, 100

#: Distance over the scale at which a motion has arrived at an orbit; so many times as long it may take.
NEAR, LONGER = 1e-6, (1, 2, 4, 10)

#: Looks after which the others are looked at first, at least.
FIRST = 16.0

#: Looks in a row at which a motion lies in a chaotic attractor's cells, nearly all of them.
LOOKS, IN_CELLS = 24, 0.8

#: States beyond so many scales have escaped.
ESCAPED = 300.0


def pendulum(t, x, x_dot):  # type: ignore[no-untyped-def]
    """Driven damped pendulum (bSTAB, Stender and Hoffmann 2022, case 1)."""
    return x_dot, -0.1 * x_dot + 0.5 - sin(x)


def duffing(t, x, x_dot):  # type: ignore[no-untyped-def]
    """Five attractors (bSTAB, case 2)."""
    return x_dot, -0.08 * x_dot - x * x * x + 0.2 * cos(t)


def lorenz(t, x, y, z):  # type: ignore[no-untyped-def]
    """Two chaotic attractors and escape (bSTAB, case 3)."""
    return 0.12 * (y - x), -y - x * z, x * y + 0.6 * z


def magnets(t, x, y, u, v):  # type: ignore[no-untyped-def]
    """Pendulum over three magnets."""
    a, b = -0.25 * x - 0.2 * u, -0.25 * y - 0.2 * v
    for k in range(3):
        p, q = x - math.cos(2.0 * math.pi * k / 3.0), y - math.sin(2.0 * math.pi * k / 3.0)
        pull = inverse_cube(p * p + q * q + 0.09)
        a, b = a - p * pull, b - q * pull
    return u, v, a, b


def thomas(t, x, y, z):  # type: ignore[no-untyped-def]
    """Thomas's cyclical system, b = 0.1665 (documentation of Attractors.jl)."""
    return sin(y) - 0.1665 * x, sin(z) - 0.1665 * y, sin(x) - 0.1665 * z


def lorenz84(t, x, y, z):  # type: ignore[no-untyped-def]
    """Lorenz (1984): a place of rest, a cycle and chaos (documentation of Attractors.jl)."""
    return (
        -y * y - z * z - 0.255 * x + 0.255 * 6.886,
        x * y - y - 4.0 * x * z + 1.347,
        4.0 * x * y + x * z - z,
    )


class StudyCase(NamedTuple):
    """A system and where its starts lie."""

    system: System
    ranges: dict[str, tuple[float, float]]


_REST = math.asin(0.5)
CASES = {
    "driven pendulum": StudyCase(
        System(pendulum, ["x", "x_dot"], {}, angles=["x"]),
        {"x": (_REST - math.pi, _REST + math.pi), "x_dot": (-10.0, 10.0)},
    ),
    "Duffing": StudyCase(
        System(duffing, ["x", "x_dot"], {}, period=2.0 * math.pi), {"x": (-1.0, 1.0), "x_dot": (-0.5, 1.0)}
    ),
    "Lorenz, r = 0": StudyCase(System(lorenz, ["x", "y", "z"], {}), {"x": (-10.0, 10.0), "y": (-20.0, 20.0)}),
    "three magnets": StudyCase(
        System(magnets, ["x", "y", "u", "v"], {}), {"x": (-2.0, 2.0), "y": (-2.0, 2.0)}
    ),
    "Thomas": StudyCase(System(thomas, ["x", "y", "z"], {}), dict.fromkeys("xyz", (-4.0, 4.0))),
    "Lorenz 84": StudyCase(
        System(lorenz84, ["x", "y", "z"], {}), {"x": (-1.0, 3.0), "y": (-2.0, 3.0), "z": (-2.0, 2.5)}
    ),
}

#: States of a start at rising times.
Path = Callable[[Floats, Floats], Floats]


def attractors_study(quick: bool, stage: Stage) -> list[str]:
    """``attractors.md``: times on one core, shares, and labels beside heyoka and SciPy."""
    peers: list[tuple[str, Callable[[System], Path], int]] = [
        ("SciPy", by_scipy, QUICK_BY_SCIPY if quick else BY_SCIPY)
    ]
    if "heyoka" in installed():
        peers.insert(0, ("heyoka", by_heyoka, QUICK_FOLLOWED if quick else FOLLOWED))
    advance, rows = stage("systems", len(CASES) + 1), []
    for name, (system, ranges) in CASES.items():
        find = partial(find_attractors, system, ranges, STARTS, threads=1)
        seconds, results = in_turns({name: find}, 1 if quick else RUNS)
        found, counted = results[name], results[name].counts
        kinds = ", ".join(f"{one.kind} {one.found / STARTS:.4f}" for one in found)
        row = [name, kinds, f"{counted['escaped'] / STARTS:.4f}", f"{counted['unsure'] / STARTS:.4f}"]
        row.append(f"{np.median(seconds[name]):.2f}")
        row += [beside(system, found, ranges, path(system), number) for _, path, number in peers]
        rows.append(row)
        advance(1)
    side = QUICK_SIDE if quick else SIDE
    system, ranges = CASES["Duffing"]
    axes = {key: np.linspace(low, high, side) for key, (low, high) in ranges.items()}
    began = time.perf_counter()
    map_basins(system, axes)
    whole = time.perf_counter() - began
    advance(1)
    about = (
        f"Shares of {STARTS:,} starts; processor seconds of one core for finding and labelling, median, the "
        "first call left out. Beside others: wrong labels of those compared."
    )
    names = [name for name, _, _ in peers]
    head = ["system", "attractors and shares", "escaped", "unsure", "seconds", *names]
    told = f"A map of Duffing's basins with {side:,} x {side:,} points, all processors: {whole:.1f} s."
    return [*section("# Attractors", about, head, rows), "", told]


def beside(
    system: System, found: Attractors, ranges: dict[str, tuple[float, float]], path: Path, number: int
) -> str:
    """Wrong labels of so many starts, of those that have one: ``wrong of compared``."""
    starts = Uniform(ranges).draw(number, tuple(system.state), 1)
    ends = found.label_starts(starts)
    wrong = compared = 0
    for start, label, status, arrived in zip(starts, ends.label, ends.status, ends.time, strict=True):
        if status not in (Status.CAPTURED, Status.ESCAPED):
            continue
        length = max(arrived, FIRST * found.looks) if np.isfinite(arrived) else FIRST * found.looks
        reached = _end(found, path, start, max(1, round(length / found.looks)))
        if reached is not None:
            compared, wrong = compared + 1, wrong + (reached != label)
    return f"{wrong} of {compared:,}"


def _end(found: Attractors, path: Path, start: Floats, looks: int) -> int | None:
    """The attractor at which a motion ends, -1: it escapes, None: it is near none."""
    flow = found.search.flow
    times = found.looks * looks * np.array(LONGER, dtype=np.float64)
    times = np.concatenate([times, times[-1] + found.looks * np.arange(1.0, LOOKS + 1.0)])
    states = path(start, times)
    for state in states[: len(LONGER)]:
        if not np.isfinite(state).all() or (np.abs(state / flow.scale)[~flow.angles] > ESCAPED).any():
            return -1
        for k, one in enumerate(found):
            if one.multipliers is not None and _distance(found, one, state) < NEAR:
                return k
    cells = found.search.cells(1.0)
    if cells is None:
        return None
    cloud = owners(flow, cells, states[len(LONGER) :])
    for k, one in enumerate(found):
        index = int(np.flatnonzero(found.rank[:-1] == k)[0]) - len(found.search.orbits)
        if one.multipliers is None and np.mean(cloud == index) > IN_CELLS:
            return k
    return None


def _distance(found: Attractors, one: Attractor, state: Floats) -> float:
    """Over the scale, from an orbit's places, or from a cycle."""
    flow = found.search.flow
    if one.period is None or one.forcing_periods is not None:
        return float(flow.distance(one.points, state).min())
    along = np.unwrap(np.append(one.points, one.points[:1], axis=0), axis=0) * flow.angles
    along += np.append(one.points, one.points[:1], axis=0) * ~flow.angles
    turns = np.round((along[-1] - along[0]) / (2.0 * np.pi)) * 2.0 * np.pi * flow.angles
    share = np.linspace(0.0, 1.0, len(along))
    spline = CubicSpline(share, along - np.outer(share, turns), bc_type="periodic")
    fine = np.linspace(0.0, 1.0, 64 * len(along))
    e = flow.away(state, spline(fine) + np.outer(fine, turns)) / flow.scale
    j = int(np.argmin((e**2).sum(axis=1)))
    ahead = e[(j + 1) % len(e)] - e[j - 1]
    return float(np.linalg.norm(e[j] - ahead * (e[j] @ ahead) / (ahead @ ahead)))


def by_scipy(system: System) -> Path:
    """DOP853 to 1e-12."""
    rhs = spoken(system.rhs, sin=np.sin, cos=np.cos, inverse_cube=lambda s: s**-1.5)

    def path(start: Floats, times: Floats) -> Floats:
        span, exact = (0.0, times[-1]), {"rtol": 1e-12, "atol": 1e-13}
        with np.errstate(all="ignore"):
            run = solve_ivp(
                lambda t, y: np.array(rhs(t, *y)), span, start, "DOP853", times, events=_far, **exact
            )
        states = np.full((times.size, start.size), np.nan)
        reached = np.array(run.y).reshape(start.size, -1).T  # empty where it escapes before the first
        states[: len(reached)] = reached
        return states

    return path


def _far(t: float, y: Floats) -> float:
    return float(1e4 - np.abs(y).max())


_far.terminal = True  # type: ignore[attr-defined]


def by_heyoka(system: System) -> Path:
    """Taylor series to 1e-13."""
    import heyoka as hy

    flow = hy.taylor_adaptive(heyoka_equations(system), [0.0] * len(system.state), tol=1e-13)

    def path(start: Floats, times: Floats) -> Floats:
        states = np.full((times.size, start.size), np.nan)
        flow.time, flow.state[:] = 0.0, start
        for k, t in enumerate(times.tolist()):
            outcome = flow.propagate_until(t, max_steps=200_000)[0]
            if outcome != hy.taylor_outcome.time_limit or np.abs(flow.state).max() > 1e4:
                break
            states[k] = flow.state
        return states

    return path
