"""Motions that decay like a power of time because the damping misses a mode, and one that hardly decays."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from fastmech.arrays import Floats
from fastmech.basins.label import label_starts
from fastmech.ensembles.integrate import Trajectories, integrate
from fastmech.ensembles.status import Status
from fastmech.equilibria.find import find_equilibria
from fastmech.integrators.methods import find_method
from fastmech.scene import Scene
from fastmech.stability.linearize import jacobian
from fastmech.step_limits.amplification import amplification
from fastmech.step_limits.warning import beyond_stability, step_limit
from fastmech.studies.hardcases.walk import (
    WITHIN,
    HardCase,
    Row,
    energy,
    labellers,
    labels_row,
    row_of,
    walked,
)

#: name -> (changes to Table 1, equilibrium [rad], power p of the decay E ~ t^-p, what vanishes).
_SETS: dict[str, tuple[dict[str, float], tuple[float, float], float, str]] = {
    "missed_dead_centre": (
        {"F0": 166.722372, "c1": 162.5, "c2": 17.35486052}, (0.0, 0.3), 1.0, "sin phi = 0",
    ),
    "missed_straight": (
        {"F0": 89.2075641978, "c1": 96.0, "c2": 50.0327795757}, (-0.3, 0.3), 1.0, "sin(phi+theta) = 0",
    ),
    "missed_unloaded": (
        {"F0": 60.0, "c1": 120.0, "c2": 78.4532}, (-2.21414614, -1.58635572), 1.0, "the rod M1M2 is unloaded",
    ),
    "missed_unloaded_below": (
        {"F0": 40.0, "c1": 52.5104064692, "c2": 31.79704}, (-np.pi / 2, -0.65530742), 1.0,
        "the rod M1M2 is unloaded, M1 hangs straight down",
    ),
    "missed_symmetric": (
        {"F0": 0.0, "c1": 47.07192, "c2": 44.59704}, (-np.pi / 2, 0.0), 0.5,
        "everything, at the symmetric position",
    ),
}  # fmt: skip

#: Size of the disturbance [rad] and length of the runs [s].
SIZE, FULL, QUICK = 0.4, 4000.0, 500.0

#: Longest step of methods, one that no method without a claim survives, and steps that are too many [s].
DT, TOO_LONG, MOST_STEPS = 0.05, 0.5, 2_000_000
QUICK_MOST_STEPS = 200_000

#: Exponent by which a method itself may change the energy of an undamped mode, and error of the power.
KEPT, ALLOWED = 0.05, 0.1

#: How long labels are looked for [s].
LABELLED = 60.0

#: Outputs of a run, and bins of its last three quarters.
OUTPUTS, BINS = 4000, 10


def decay_power(t: Floats, level: Floats) -> float:
    """The p of E = C (t + t0)^-p, over the last three quarters of a run.

    E / -E' = (t + t0) / p is a straight line in t whatever the unknown t0; rates come from means over bins,
    which are long against the oscillation.
    """
    late = slice(t.size // 4, None)
    bins, logs = (part.reshape(BINS, -1).mean(axis=1) for part in (t[late], np.log(level[late])))
    middle, rate = 0.5 * (bins[1:] + bins[:-1]), -np.diff(logs) / np.diff(bins)
    return 1.0 / float(np.polyfit(middle, 1.0 / rate, 1)[0])


def _kept_step(method: str, scene: Scene, frequency: float, length: float, most: int) -> float:
    """Longest step [s] with which a method itself damps or drives an undamped mode by no more than KEPT.

    Over the whole run, as the exponent of its energy: 2 ln|R(i omega h)| / h times the length. 0: more than
    ``most`` steps.
    """
    formula = find_method(method)
    dt = DT
    while length <= most * dt:
        own = abs(np.log(amplification(formula, 1j * frequency * dt))) / dt
        if 2.0 * float(own) * length <= KEPT:
            if beyond_stability(scene, dt, method):
                dt = WITHIN * step_limit(scene, method)
            return dt if length <= most * dt else 0.0
        dt *= 0.5
    return 0.0


def _missed(name: str, quick: bool) -> Sequence[Row]:
    changes, (phi, theta), expected, _ = _SETS[name]
    scene = Scene(alpha=0.0).replace(**changes)
    near = min(find_equilibria(scene), key=lambda e: abs(e.phi - phi) + abs(e.theta - theta))
    values = np.linalg.eigvals(jacobian(scene, near))
    frequency = float(np.abs(values[np.argmin(np.abs(values.real))].imag))
    at = np.array([near.phi, near.theta, 0.0, 0.0])
    return [_decay(scene, at, frequency, expected, method, quick) for method in walked(quick)]


def _decay(scene: Scene, at: Floats, frequency: float, expected: float, method: str, quick: bool) -> Row:
    length, most = (QUICK, QUICK_MOST_STEPS) if quick else (FULL, MOST_STEPS)
    dt = _kept_step(method, scene, frequency, length, most)
    if dt == 0.0 and not quick:  # the shorter run asks for less
        length = QUICK
        dt = _kept_step(method, scene, frequency, length, most)
    times, start = np.linspace(0.0, length, OUTPUTS + 1)[1:], at + np.array([0.0, SIZE, 0.0, 0.0])
    if dt == 0.0:
        result = integrate(scene, start, length, TOO_LONG, method)
        return row_of(result, np.nan, np.nan, claimed=False, why="drives the mode that nothing damps")
    result = integrate(scene, start, t_eval=times, dt=dt, method=method)
    power = decay_power(times, energy(scene, result.y[:, 0]) - energy(scene, at))
    why = "its own damping of the mode is far less"
    return row_of(result, abs(power - expected), ALLOWED, remark=f"E ~ t^-{power:.3f}", why=why)


_CIRCLING = Scene(F0=0.0, c1=94.14384, c2=50.0, alpha=0.0)
_CIRCLING_START = [-np.pi / 2 + 0.02, 0.3, 0.0, 3.081045]


def _circled(method: str, dt: float, length: float) -> tuple[Trajectories, float, float]:
    """A run, the power of the decay of the energy above the orbit, and the turns that M2 has made."""
    scene = _CIRCLING
    orbit = float(energy(scene, np.array([-np.pi / 2, 0.0, 0.0, np.sqrt(scene.c1 / scene.m2)])))
    times = np.linspace(0.0, length, OUTPUTS + 1)[1:]
    run = integrate(scene, _CIRCLING_START, t_eval=times, dt=dt, method=method)
    level = energy(scene, run.y[:, 0]) - orbit
    power = decay_power(times, level) if (level > 0.0).all() else np.nan
    return run, power, float(run.y[-1, 0, 1]) / (2.0 * np.pi)


def _circling(quick: bool) -> Sequence[Row]:
    length = QUICK if quick else FULL
    most = QUICK_MOST_STEPS if quick else MOST_STEPS
    turning = float(np.sqrt(_CIRCLING.c1 / _CIRCLING.m2))
    rows = []
    for method in walked(quick):
        dt = _kept_step(method, _CIRCLING, turning, length, most)
        found = None
        while dt > 0.0 and 2.0 * length <= most * dt:
            run, power, turns = found or _circled(method, dt, length)
            found = _circled(method, 0.5 * dt, length)
            if abs(power - found[1]) <= 0.5 * ALLOWED:
                break
            dt *= 0.5
        else:
            run = integrate(_CIRCLING, _CIRCLING_START, length, TOO_LONG, method)
            why = f"drives the turning, or half the step tells otherwise, to {most:,} steps"
            rows.append(row_of(run, np.nan, np.nan, claimed=False, why=why))
            continue
        # M2 has turned at the orbit's rate all the time.
        still = abs(turns * 2.0 * np.pi / length / turning - 1.0) < 0.02
        error = abs(power - 1.0) if still else np.inf
        remark, why = f"E ~ t^-{power:.3f}, {turns:.0f} turns", "half the step tells the same"
        rows.append(row_of(run, error, ALLOWED, remark=remark, why=why))
    return [*rows, *(_undecided(method) for method in labellers(quick))]


def _undecided(method: str) -> Row:
    """The label of the circling motion: there is none."""
    found = label_starts(_CIRCLING, _CIRCLING_START, LABELLED, method=method)
    return labels_row(method, found, int((found.status == Status.CAPTURED).sum()))


CASES = (
    *(
        HardCase(
            name,
            f"the damping misses a mode, {what}: linear theory is silent and the decay algebraic",
            f"the energy falls like t^-{power:g}; error: distance of the fitted power",
            "the amplitude falls slowly, as it should, and neither freezes nor grows",
            partial(_missed, name),
        )
        for name, (_, _, power, what) in _SETS.items()
    ),
    HardCase(
        "endless_circling",
        "M2 can circle M1 for ever, the rod between them unloaded: rest is not the rule here",
        "energy above the circling orbit falls like 1/t; error: distance of the fitted power from 1; of "
        "fm.label_starts, the labels given, for there is none",
        "nothing is captured, the label is undecided: M2 turns at sqrt(c1/m2) to the end",
        _circling,
    ),
)
