"""Motions that decay like a power of time because the damping misses a mode, and one that hardly decays."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.integrate import integrate
from fastmech.equilibria.find import find_equilibria
from fastmech.hardcases.case import HardCase, Row, energy, row_of
from fastmech.scene import Scene

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
SIZE, FULL, QUICK = 0.4, 4000.0, 1000.0

#: Outputs of a run, and bins of its last three quarters.
OUTPUTS, BINS = 4000, 10


def decay_power(t: NDArray[np.float64], level: NDArray[np.float64]) -> float:
    """The p of E = C (t + t0)^-p, over the last three quarters of a run.

    E / -E' = (t + t0) / p is a straight line in t whatever the unknown t0; rates come from means over bins,
    which are long against the oscillation.
    """
    late = slice(t.size // 4, None)
    bins, logs = (part.reshape(BINS, -1).mean(axis=1) for part in (t[late], np.log(level[late])))
    middle, rate = 0.5 * (bins[1:] + bins[:-1]), -np.diff(logs) / np.diff(bins)
    return 1.0 / float(np.polyfit(middle, 1.0 / rate, 1)[0])


def _missed(name: str) -> Callable[[bool], Sequence[Row]]:
    changes, (phi, theta), expected, _ = _SETS[name]
    scene = Scene(alpha=0.0).replace(**changes)

    def run(quick: bool) -> Sequence[Row]:
        equilibria = find_equilibria(scene)
        near = min(equilibria, key=lambda e: abs(e.phi - phi) + abs(e.theta - theta))
        times = np.linspace(0.0, QUICK if quick else FULL, OUTPUTS + 1)[1:]
        rows = []
        for method, dt in (("dop853", 0.05), ("gauss6", 0.05)):
            start = [near.phi, near.theta + SIZE, 0.0, 0.0]
            result = integrate(scene, start, t_eval=times, dt=dt, method=method)
            level = energy(scene, result.y[:, 0]) - energy(scene, np.array([near.phi, near.theta, 0.0, 0.0]))
            power = decay_power(times, level)
            rows.append(row_of(result, abs(power - expected), 0.1, remark=f"E ~ t^-{power:.3f}"))
        return rows

    return run


def _circling(quick: bool) -> Sequence[Row]:
    scene = Scene(F0=0.0, c1=94.14384, c2=50.0, alpha=0.0)
    turning = np.sqrt(scene.c1 / scene.m2)
    orbit = float(energy(scene, np.array([-np.pi / 2, 0.0, 0.0, turning])))
    times = np.linspace(0.0, QUICK if quick else FULL, OUTPUTS + 1)[1:]
    rows = []
    for method, dt in (("dop853", 0.05), ("gauss6", 0.05)):
        result = integrate(scene, [-np.pi / 2 + 0.02, 0.3, 0.0, 3.081045], t_eval=times, dt=dt, method=method)
        power = decay_power(times, energy(scene, result.y[:, 0]) - orbit)
        turns = result.y[-1, 0, 1] / (2.0 * np.pi)
        # Never captured: M2 has turned at the orbit's rate all the time.
        still = abs(turns * 2.0 * np.pi / times[-1] / turning - 1.0) < 0.02
        error = abs(power - 1.0) if still else np.inf
        rows.append(row_of(result, error, 0.1, remark=f"E ~ t^-{power:.3f}, {turns:.0f} turns"))
    return rows


CASES = (
    *(
        HardCase(
            name,
            f"the damping misses a mode, {what}: linear theory is silent and the decay algebraic",
            f"the energy falls like t^-{power:g}; error: distance of the fitted power",
            "the amplitude falls slowly, as it should, and neither freezes nor grows",
            _missed(name),
        )
        for name, (_, _, power, what) in _SETS.items()
    ),
    HardCase(
        "endless_circling",
        "M2 can circle M1 for ever, the rod between them unloaded: rest is not the rule here",
        "energy above the circling orbit falls like 1/t; error: distance of the fitted power from 1",
        "nothing is captured: M2 turns at sqrt(c1/m2) to the end",
        _circling,
    ),
)
