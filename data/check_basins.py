"""Checks basin labels against integration to rest, by integrators that share nothing with the labels' steps.

    python data/check_basins.py random 20000    three scenes, order 10 with a tiny step, SciPy on some of them
    python data/check_basins.py scipy 64        a 64 x 64 map, every label by SciPy's DOP853 at 1e-12

A motion has come to rest in a copy of a well when it ends within ``NEAR`` rad and rad/s of it; one that does
not is counted as not at rest, and says nothing. The potential plays no part in that.
"""

from __future__ import annotations

import sys
import time

import numba
import numpy as np
from scipy.integrate import solve_ivp

import fastmech as fm
from fastmech.basins.label import Labels
from fastmech.slider.coefficients import reduce
from fastmech.studies.bench.peers import scalar_rhs

CONSTANT = fm.Scene(alpha=0.0)
BISTABLE = fm.Scene(F0=85.3, c1=294.9, c2=92.85, alpha=0.0)
DECAYING = fm.Scene()

#: Scene, end of the labels' run [s], end of the reference's [s], its step [s], largest rates [rad/s].
CASES = {
    "Table 1": (CONSTANT, 60.0, 80.0, 0.01, 8.0),
    "bistable": (BISTABLE, 400.0, 800.0, 0.01, 3.0),
    "decaying force": (DECAYING, 60.0, 80.0, 0.01, 8.0),
}
NEAR = 0.5
SCIPY_SAMPLE = 40


@numba.njit
def _rhs(t, y, p):
    now = p.copy()
    now[5] = p[5] * np.exp(-p[7] * t)
    return scalar_rhs(t, y, now)


def at_rest(scene: fm.Scene, states: np.ndarray) -> np.ndarray:
    """(well, turns of phi, turns of theta) near which each state is, -1 in the first column: near none."""
    place = np.full((len(states), 3), -1)
    for index, e in enumerate(fm.find_equilibria(scene)):
        if e.kind != "minimum":
            continue
        away = states - np.array([e.phi, e.theta, 0.0, 0.0])
        turns = np.round(away[:, :2] / (2.0 * np.pi))
        away[:, :2] -= 2.0 * np.pi * turns
        near = np.abs(away).max(axis=1) < NEAR
        place[near] = np.column_stack([np.full(len(states), index), turns])[near]
    return place


def by_scipy(scene: fm.Scene, start: np.ndarray, t_end: float) -> np.ndarray:
    """Final state by SciPy's DOP853 at 1e-12."""
    p = np.array(reduce(scene))
    return solve_ivp(_rhs, (0.0, t_end), start, method="DOP853", args=(p,), rtol=1e-12, atol=1e-12).y[:, -1]


def compare(name: str, found: Labels, place: np.ndarray) -> int:
    """Print how labels and places of rest compare; the number of wrong labels."""
    labels = np.column_stack([found.well, found.turns])
    captured, rests = found.well >= 0, place[:, 0] >= 0
    wrong = captured & rests & (labels != place).any(axis=1)
    print(
        f"{name}: {len(labels)} starts, {found.counts}; captured and at rest {np.sum(captured & rests)}, "
        f"captured, not at rest yet {np.sum(captured & ~rests)}, wrong labels {wrong.sum()}",
        flush=True,
    )
    return int(wrong.sum())


def random_starts(n: int) -> int:
    """Starts at random angles, half at rest and half with rates, over all cases."""
    wrong = 0
    for number, (name, (scene, t_end, t_rest, step, fastest)) in enumerate(CASES.items()):
        rng = np.random.default_rng([number, 1])
        starts = np.zeros((n // len(CASES) + 1, 4))
        starts[:, :2] = rng.uniform(-np.pi, np.pi, (len(starts), 2))
        half = len(starts) // 2
        starts[half:, 2:] = rng.uniform(-fastest, fastest, (len(starts) - half, 2))
        found = fm.label_starts(scene, starts, t_end)
        began = time.perf_counter()
        final = fm.integrate(scene, starts, t_rest, dt=step, method="hairer10").y[-1]
        finer = fm.integrate(scene, starts[:500], t_rest, dt=step / 2, method="hairer10").y[-1]
        apart = np.abs(finer - final[:500]).max(axis=1)
        print(
            f"{name}: reference {time.perf_counter() - began:.0f} s; half the step moves 500 final states by "
            f"{np.median(apart):.0e} (median), {apart.max():.0e} (most)"
        )
        wrong += compare(name, found, at_rest(scene, final))
        sample = rng.choice(len(starts), SCIPY_SAMPLE, replace=False)
        states = np.array([by_scipy(scene, starts[i], min(t_rest, 200.0)) for i in sample])
        part = fm.label_starts(scene, starts[sample], min(t_rest, 200.0))
        wrong += compare(f"{name}, SciPy", part, at_rest(scene, states))
    return wrong


def scipy_map(side: int) -> int:
    """A map of Table 1 with constant force, rest starts, every label by SciPy, many starts in one system."""
    angles = -np.pi + (np.arange(side) + 0.5) * 2.0 * np.pi / side
    starts = np.zeros((side * side, 4))
    starts[:, :2] = np.stack(np.meshgrid(angles, angles, indexing="ij"), axis=-1).reshape(-1, 2)
    found = fm.label_starts(CONSTANT, starts)
    p = np.array(reduce(CONSTANT))

    def together(t: float, y: np.ndarray) -> np.ndarray:
        return scalar_rhs.py_func(t, y.reshape(4, -1), p).ravel()

    states = []
    for part in np.array_split(starts, max(1, len(starts) // 1024)):
        run = solve_ivp(together, (0.0, 40.0), part.T.ravel(), "DOP853", rtol=1e-12, atol=1e-12)
        states.append(run.y[:, -1].reshape(4, -1).T)
    return compare(f"Table 1, {side} x {side}, SciPy", found, at_rest(CONSTANT, np.concatenate(states)))


if __name__ == "__main__":
    check = {"random": random_starts, "scipy": scipy_map}[sys.argv[1]]
    sys.exit(check(int(sys.argv[2])) > 0)
