"""Attractors of published systems: how long finding and labelling takes, and labels beside other integrators.

Each start with a label is followed by heyoka (where it is installed) and a part of them by SciPy, to 1e-12
or better, ten times as long as it took to arrive: from there it must have the same label.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.integrate import solve_ivp

from fastmech.arrays import Floats
from fastmech.attractors.find import Attractors, find_attractors
from fastmech.basins.map import map_basins
from fastmech.ensembles.status import Status
from fastmech.ensembles.system import System
from fastmech.kernels.sincos import cos, sin
from fastmech.reports import Stage
from fastmech.samplers import Uniform
from fastmech.studies.bench.entrants import installed
from fastmech.studies.bench.own_systems import in_numpy, inverse_cube
from fastmech.studies.bench.peers import heyoka_equations
from fastmech.studies.reporting import in_turns, section

#: Starts that are timed and that others follow; those of SciPy; runs of which the median counts.
STARTS, FOLLOWED, BY_SCIPY, RUNS = 10_000, 2_000, 200, 5
QUICK_FOLLOWED, QUICK_BY_SCIPY = 200, 20

#: Points of a map a side.
SIDE, QUICK_SIDE = 1000, 100

#: Others follow a motion for so many times its time of arrival, and that of so many looks at least.
LONGER, FIRST = 10.0, 16.0

#: States beyond this have escaped.
FAR = 1e4


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


_REST = math.asin(0.5)

#: Systems, and where their starts lie.
CASES: dict[str, tuple[System, dict[str, tuple[float, float]]]] = {
    "driven pendulum": (
        System(pendulum, ["x", "x_dot"], {}, angles=["x"]),
        {"x": (_REST - math.pi, _REST + math.pi), "x_dot": (-10.0, 10.0)},
    ),
    "Duffing": (
        System(duffing, ["x", "x_dot"], {}, period=2.0 * math.pi),
        {"x": (-1.0, 1.0), "x_dot": (-0.5, 1.0)},
    ),
    "Lorenz, r = 0": (System(lorenz, ["x", "y", "z"], {}), {"x": (-10.0, 10.0), "y": (-20.0, 20.0)}),
    "three magnets": (System(magnets, ["x", "y", "u", "v"], {}), {"x": (-2.0, 2.0), "y": (-2.0, 2.0)}),
    "Thomas": (System(thomas, ["x", "y", "z"], {}), dict.fromkeys("xyz", (-4.0, 4.0))),
    "Lorenz 84": (
        System(lorenz84, ["x", "y", "z"], {}),
        {"x": (-1.0, 3.0), "y": (-2.0, 3.0), "z": (-2.0, 2.5)},
    ),
}

#: From a start to the state at a time; not finite: it has escaped.
Follow = Callable[[Floats, float], Floats]


def attractors_study(quick: bool, stage: Stage) -> list[str]:
    """``attractors.md``: times on one core, shares, and labels beside heyoka and SciPy."""
    peers: dict[str, tuple[Callable[[System], Follow], int]] = {}
    if "heyoka" in installed():
        peers["heyoka"] = by_heyoka, QUICK_FOLLOWED if quick else FOLLOWED
    peers["SciPy"] = by_scipy, QUICK_BY_SCIPY if quick else BY_SCIPY
    advance, rows = stage("systems", len(CASES) + 1), []
    for name, (system, ranges) in CASES.items():
        find = partial(find_attractors, system, ranges, STARTS, threads=1)
        seconds, results = in_turns({name: find}, 1 if quick else RUNS)
        found, counted = results[name], results[name].counts
        kinds = ", ".join(f"{one.kind} {one.found / STARTS:.4f}" for one in found)
        row = [name, kinds, f"{counted['escaped'] / STARTS:.4f}", f"{counted['unsure'] / STARTS:.4f}"]
        row.append(f"{np.median(seconds[name]):.2f}")
        for follow, number in peers.values():
            starts = Uniform(ranges).draw(number, tuple(system.state), 1)
            row.append(beside(found, starts, follow(system)))
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
    head = ["system", "attractors and shares", "escaped", "unsure", "seconds", *peers]
    told = f"A map of Duffing's basins with {side:,} x {side:,} points, all processors: {whole:.1f} s."
    return [*section("# Attractors", about, head, rows), "", told]


def beside(found: Attractors, starts: Floats, follow: Follow) -> str:
    """Wrong labels of the starts (n, dim) that have one: ``wrong of compared``."""
    ends, labelled = found.label_starts(starts), (Status.CAPTURED, Status.ESCAPED)
    known = np.isin(ends.status, labelled)
    looks = np.maximum(np.nan_to_num(np.round(ends.time / found.looks), posinf=0.0), FIRST)
    times = LONGER * found.looks * looks
    states = np.array([follow(start, t) for start, t in zip(starts[known], times[known], strict=True)])
    label, compared = np.full(len(states), -1), np.ones(len(states), dtype=bool)
    here = np.isfinite(states).all(axis=1)
    again = found.label_starts(states[here])
    label[here], compared[here] = again.label, np.isin(again.status, labelled)
    wrong = compared & (label != ends.label[known])
    return f"{wrong.sum()} of {compared.sum():,}"


def by_scipy(system: System) -> Follow:
    """DOP853 to 1e-12."""
    rhs = in_numpy(system.rhs)

    def far(t: float, y: Floats) -> float:
        return float(FAR - np.abs(y).max())

    far.terminal = True  # type: ignore[attr-defined]

    def follow(start: Floats, t_end: float) -> Floats:
        with np.errstate(all="ignore"):
            run = solve_ivp(
                lambda t, y: np.array(rhs(t, *y)), (0.0, t_end), start, "DOP853",
                events=far, rtol=1e-12, atol=1e-13,
            )  # fmt: skip
        return np.asarray(run.y[:, -1]) if run.status == 0 else np.full(start.size, np.nan)

    return follow


def by_heyoka(system: System) -> Follow:
    """Taylor series to 1e-13."""
    import heyoka as hy

    flow = hy.taylor_adaptive(heyoka_equations(system), [0.0] * len(system.state), tol=1e-13)

    def follow(start: Floats, t_end: float) -> Floats:
        flow.time, flow.state[:] = 0.0, start
        arrived = flow.propagate_until(t_end, max_steps=2_000_000)[0] == hy.taylor_outcome.time_limit
        near = arrived and np.abs(flow.state).max() < FAR
        return np.array(flow.state) if near else np.full(start.size, np.nan)

    return follow
