"""Basin labels by certificate against integration to rest, by the package's own engine and by SciPy.

Table 1, constant force, starts at rest at random angles. To rest means within 1e-3 rad of the well in the
kinetic-energy norm, by energy. SciPy gets the jitted equations of motion and stops at the same energy.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from fastmech.basins.label import Labels, labels_of
from fastmech.bench.plain import scalar_rhs
from fastmech.disturbance.size import confining_energy, excess_energy
from fastmech.ensembles.run import Progress
from fastmech.ensembles.threads import thread_count
from fastmech.equilibria.find import find_equilibria
from fastmech.jit import FLAGS
from fastmech.mechanism.coefficients import reduce
from fastmech.mechanism.lagrange import unit
from fastmech.mechanism.reduced import metric_11, potential, slider_ratio
from fastmech.scene import Scene

Floats = NDArray[np.float64]

SCENE = Scene(alpha=0.0)
REST, T_END, REPEATS = 1e-3, 300.0, 3

#: Step that pynamicalsys is given [s].
PEER_STEP = 0.02


@dataclass(frozen=True)
class BasinRow:
    """What one way of labelling did."""

    name: str
    threads: int
    starts: int
    rate: float  #: starts per second, median of warm calls
    steps: float  #: steps (SciPy: accepted ones) a start; of the certificate all its computations
    wrong: int  #: labels that differ from the certificate's


def run_basins(
    out: Path,
    *,
    quick: bool = False,
    stage: Callable[[str, int], Progress] = lambda name, total: lambda done: None,
) -> list[Path]:
    """Measure and write ``basins.md`` into the folder ``out``; ``quick`` is for trying the command."""
    many, some, few = (20_000, 1000, 4) if quick else (1_000_000, 10_000, 40)
    starts = random_starts(many)
    advance = stage("basin labels", 4 if thread_count(None) > 1 else 3)
    rows = []
    for threads in sorted({1, thread_count(None)}):
        rows.append(certified(starts, threads))
        advance(1)
    rows.append(settled(starts[:some]))
    advance(1)
    rows.append(lsoda(starts[:few]))
    advance(1)
    if find_spec("pynamicalsys") is not None:
        rows.append(pynamicalsys(starts[:few]))
    out.mkdir(parents=True, exist_ok=True)
    table = out / "basins.md"
    table.write_text(markdown(rows), encoding="utf-8")
    return [table]


def random_starts(n: int) -> Floats:
    """At rest, any angles."""
    starts = np.zeros((n, 4))
    starts[:, :2] = np.random.default_rng(6).uniform(-np.pi, np.pi, (n, 2))
    return starts


def certified(starts: Floats, threads: int) -> BasinRow:
    """The package's labels."""
    labels_of(SCENE, starts[:1000], T_END, threads=threads)
    seconds = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        found = labels_of(SCENE, starts, T_END, threads=threads)
        seconds.append(time.perf_counter() - began)
    rate = len(starts) / statistics.median(seconds)
    return BasinRow("capture certificate", threads, len(starts), rate, found.steps / len(starts), 0)


def settled(starts: Floats) -> BasinRow:
    """The same engine, each start followed once, with the certificate's finer step, until it rests."""
    plain = labels_of(SCENE, starts, T_END, threads=1)
    began = time.perf_counter()
    found = labels_of(SCENE, starts, T_END, settle_radius=REST, threads=1)
    seconds = time.perf_counter() - began
    began = time.perf_counter()
    labels_of(SCENE, starts, T_END, threads=1)
    seconds -= time.perf_counter() - began
    steps = (found.steps - plain.steps) / len(starts)
    return BasinRow(f"until within {REST:g} of rest", 1, len(starts), len(starts) / seconds, steps, 0)


def _energy_above(y: Floats, p: Floats, bottom: float) -> float:
    """T + U over m2 l^2 of one state above ``bottom`` [1/s^2], an event for SciPy."""
    s1, c1, s2, c2 = np.sin(y[0]), np.cos(y[0]), np.sin(y[1]), np.cos(y[1])
    s12 = s1 * c2 + c1 * s2
    k, _ = slider_ratio(s1, c1)
    kinetic = 0.5 * (metric_11(p[0], p[1], k) * y[2] ** 2 + y[3] ** 2) + s12 * y[2] * y[3]
    return kinetic + potential(s1, c1, s2, c2, s12, p[2], p[3], p[4], p[5]) - bottom


energy_above = njit(**FLAGS)(_energy_above)


def lsoda(starts: Floats) -> BasinRow:
    """SciPy's LSODA, one start after the other, until the energy says that it rests."""
    well = find_equilibria(SCENE)[0]
    enough = confining_energy(SCENE, well, REST) / unit(SCENE)
    p = np.array(reduce(SCENE))

    bottom = energy_above(starts[0], p, 0.0)
    bottom -= float(excess_energy(SCENE, well, starts[:1])[0]) / unit(SCENE)

    def rests(t: float, y: Floats, p: Floats) -> float:
        return float(energy_above(y, p, bottom)) - enough

    rests.terminal = True  # type: ignore[attr-defined]
    scalar_rhs(0.0, starts[0], p)
    labels = labels_of(SCENE, starts, T_END)
    began = time.perf_counter()
    ends, steps = [], 0
    for start in starts:
        run = solve_ivp(
            scalar_rhs, (0.0, T_END), start, "LSODA", args=(p,), events=rests, rtol=1e-6, atol=1e-8
        )
        ends.append(run.y[:2, -1])
        steps += run.t.size - 1
    seconds = time.perf_counter() - began
    turns = np.round((np.array(ends) - [well.phi, well.theta]) / (2.0 * np.pi))
    wrong = _differ(labels, turns)
    return BasinRow(
        "SciPy LSODA to rest, rtol 1e-6", 1, len(starts), len(starts) / seconds, steps / len(starts), wrong
    )


def pynamicalsys(starts: Floats) -> BasinRow:
    """pynamicalsys' RK4 with a step of 0.02 s, one start after the other, for as long as the slowest takes.

    It cannot stop when a start has come to rest.
    """
    from pynamicalsys import ContinuousDynamicalSystem

    labels = labels_of(SCENE, starts, T_END, settle_radius=REST)
    assert labels.settle_time is not None
    t_end, p = float(np.nanmax(labels.settle_time)), np.array(reduce(SCENE))
    system = ContinuousDynamicalSystem(
        equations_of_motion=scalar_rhs, system_dimension=4, parameters=p, number_of_parameters=p.size
    )
    system.integrator("rk4", time_step=PEER_STEP)
    system.evolve_system(starts[0], PEER_STEP)
    began = time.perf_counter()
    ends = np.array([system.evolve_system(start, t_end) for start in starts])
    seconds = time.perf_counter() - began
    well = find_equilibria(SCENE)[0]
    turns = np.round((ends[:, :2] - [well.phi, well.theta]) / (2.0 * np.pi))
    return BasinRow(
        f"pynamicalsys RK4 to {t_end:.0f} s, dt = {PEER_STEP:g} s",
        1,
        len(starts),
        len(starts) / seconds,
        t_end / PEER_STEP,
        _differ(labels, turns),
    )


def _differ(labels: Labels, turns: Floats) -> int:
    return int(np.count_nonzero((labels.turns != turns).any(axis=1)))


def markdown(rows: list[BasinRow]) -> str:
    """The table and the two ratios."""
    lines = [
        "# Basin labels",
        "",
        "Table 1, constant force, random starts at rest; medians of warm calls.",
        "",
        "| labelled by | threads | starts | starts/s | steps a start | labels that differ |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for row in rows:
        lines.append(
            f"| {row.name} | {row.threads} | {row.starts:,} | {row.rate:,.4g} | {row.steps:,.4g} "
            f"| {row.wrong} |"
        )
    first = rows[0]
    others = [row for row in rows if row.name.startswith("pynamicalsys")]
    also = "".join(f" and {first.rate / row.rate:,.0f} times as many as pynamicalsys" for row in others)
    rest = next(row for row in rows if row.name.startswith("until"))
    peer = next(row for row in rows if row.name.startswith("SciPy"))
    lines += [
        "",
        f"The certificate takes 1/{rest.steps / first.steps:.0f} of the steps to rest, both of its "
        f"computations counted, and labels {first.rate / peer.rate:,.0f} times as many starts a second "
        f"on one core as SciPy{also}.",
        "",
    ]
    return "\n".join(lines)
