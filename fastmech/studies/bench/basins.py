"""Basin labels by certificate against integration to rest, by the package's own engine and by SciPy.

Table 1, constant force, starts at rest at random angles. To rest means within 1e-3 rad of the well in the
kinetic-energy norm, by energy. SciPy gets the jitted equations of motion and stops at the same energy.
"""

from __future__ import annotations

import statistics
import time
from functools import partial

import numpy as np
from numba import njit
from scipy.integrate import solve_ivp

from fastmech.arrays import Floats
from fastmech.basins.label import label_starts
from fastmech.disturbance.motion import confining_energy, excess_energy
from fastmech.ensembles.threads import thread_count
from fastmech.jit import FLAGS
from fastmech.reports import Stage
from fastmech.scene import Scene
from fastmech.slider.capture.observe import bounding_energy
from fastmech.slider.coefficients import reduce
from fastmech.slider.equilibria import find_equilibria
from fastmech.slider.lagrange import unit
from fastmech.studies.bench.peers import scalar_rhs
from fastmech.studies.reporting import in_turns, section

SCENE = Scene(alpha=0.0)
REST, T_END, REPEATS = 1e-3, 300.0, 3


def basins_study(quick: bool, stage: Stage) -> list[str]:
    """``basins.md``; ``quick`` is for trying the command."""
    many, some, few = (20_000, 1000, 4) if quick else (1_000_000, 10_000, 40)
    starts, threads = np.zeros((many, 4)), sorted({1, thread_count(None)})
    starts[:, :2] = np.random.default_rng(6).uniform(-np.pi, np.pi, (many, 2))
    advance, rows = stage("basin labels", 2 + len(threads)), []

    def add(name: str, n: int, count: int, rate: float, steps: float, wrong: int = 0) -> None:
        rows.append(f"{name} | {n} | {count:,} | {rate:,.4g} | {steps:,.4g} | {wrong}")
        advance(1)

    certified = [(n, *_timed(starts, REPEATS, n)) for n in threads]
    for n, seconds, steps in certified:
        add("capture certificate", n, many, many / seconds, steps)
    # The same engine, each start followed once, with the certificate's finer step, until it rests.
    (label, first), (rest, last) = (_timed(starts[:some], 1, 1, radius) for radius in (None, REST))
    add(f"until within {REST:g} of rest", 1, some, some / (rest - label), last - first)
    rate, steps, wrong = lsoda(starts[:few])
    add("SciPy LSODA to rest, rtol 1e-6", 1, few, rate, steps, wrong=wrong)
    about = "Table 1, constant force, random starts at rest; medians of warm calls."
    head = "labelled by | threads | starts | starts/s | steps a start | labels that differ"
    _, seconds, own = certified[0]
    return [
        *section("# Basin labels", about, head, rows),
        f"The certificate takes 1/{(last - first) / own:.0f} of the steps to rest, both of its "
        f"computations counted, and labels {many / seconds / rate:,.0f} times as many starts a second "
        f"on one core as SciPy.",
    ]


def _timed(starts: Floats, turns: int, threads: int, radius: float | None = None) -> tuple[float, float]:
    """Seconds of labelling, median of warm calls, and its steps a start."""
    label = partial(label_starts, SCENE, starts, T_END, settle_radius=radius, threads=threads)
    seconds, labels = in_turns({"": label}, turns, clock=time.perf_counter)
    return statistics.median(seconds[""]), labels[""].steps / len(starts)


@njit(**FLAGS)  # type: ignore[untyped-decorator]
def energy_above(y: Floats, p: Floats, bottom: float) -> float:
    """T + U over m2 l^2 of one state (4, 1) above ``bottom`` [1/s^2], an event for SciPy."""
    return bounding_energy((p[0], p[1], p[2], p[3], p[4], p[5]), None, y, 0) - bottom


def lsoda(starts: Floats) -> tuple[float, float, int]:
    """SciPy's LSODA, one start after the other, until the energy says that it rests.

    Returns:
        Starts per second, accepted steps a start, labels that differ from the certificate's.
    """
    well, p = find_equilibria(SCENE)[0], np.array(reduce(SCENE))
    enough = confining_energy(SCENE, well, REST) / unit(SCENE)
    bottom = energy_above(starts[0][:, None], p, 0.0)
    bottom -= float(excess_energy(SCENE, well, starts[:1])[0]) / unit(SCENE)

    def rests(t: float, y: Floats, p: Floats) -> float:
        return float(energy_above(y[:, None], p, bottom)) - enough

    rests.terminal = True  # type: ignore[attr-defined]
    scalar_rhs(0.0, starts[0], p)
    labels = label_starts(SCENE, starts, T_END)
    began = time.perf_counter()
    options = {"args": (p,), "events": rests, "rtol": 1e-6, "atol": 1e-8}
    runs = [solve_ivp(scalar_rhs, (0.0, T_END), start, "LSODA", **options) for start in starts]
    rate = len(starts) / (time.perf_counter() - began)
    ends = np.array([run.y[:2, -1] for run in runs])
    turns = np.round((ends - [well.phi, well.theta]) / (2.0 * np.pi))
    wrong = int(np.count_nonzero((labels.turns != turns).any(axis=1)))
    return rate, sum(run.t.size - 1 for run in runs) / len(starts), wrong
