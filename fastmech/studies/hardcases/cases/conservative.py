"""No damper, no force, a million steps: what happens to the energy."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from fastmech.arrays import Floats
from fastmech.ensembles.balance import lowest_potential
from fastmech.ensembles.integrate import Trajectories, integrate
from fastmech.scene import Scene
from fastmech.studies.hardcases.walk import (
    DRIVEN,
    HardCase,
    Row,
    admitted_step,
    energy,
    halving_tells,
    row_of,
    walked,
)

SCENE = Scene(c2=1100 / 3, beta=0.0, F0=0.0)

#: The paper's start, and an energetic one.
PAPER_START = (0.966643893412244, 0.4487989505128276, 0.0, 0.0)
ENERGETIC_START = (0.3, 2.5, 3.0, -4.0)

#: Step [s] and steps of the full and the quick version.
DT, STEPS, QUICK_STEPS = 0.01, 1_000_000, 10_000

#: Steps of that length of the runs of all methods.
WALK_STEPS, QUICK_WALK_STEPS = 50_000, 5_000

#: Relative error of the energy that rounding explains.
ROUNDED = 1e-11

OUTPUTS = 200


def energy_history(
    start: Sequence[float], method: str, formulation: str, steps: int, dt: float = DT
) -> tuple[Floats, Floats, Trajectories]:
    """Times [s], relative energy error at each, and the run, of a long conservative motion."""
    times = np.linspace(0.0, steps * dt, OUTPUTS + 1)[1:]
    run = integrate(SCENE, start, t_eval=times, dt=dt, method=method, formulation=formulation)
    begin = energy(SCENE, np.array(start))
    size = float(begin) - lowest_potential(SCENE)
    return times, (energy(SCENE, run.y[:, 0]) - begin) / size, run


def _long(start: Sequence[float], entry: tuple[str, str, float, float], steps: int) -> Row:
    """The row of a method that the case is about: its trend and its drift, both claimed beforehand.

    The error is the trend: slope of a straight line through the energy error times the length of the run,
    without its oscillation.
    """
    method, formulation, allowed, most = entry
    times, error, run = energy_history(start, method, formulation, steps)
    trend = abs(float(np.polyfit(times, error, 1)[0])) * times[-1]
    drift = float(np.abs(error).max())
    kept = trend if drift <= most else np.inf
    return row_of(run, kept, allowed, drift, remark=formulation, why=f"declared; drift to {most:.0e}")


def _walked(start: Sequence[float], method: str, steps: int) -> Row:
    """A shorter run of any method: its largest energy error, claimed to what halving its step tells."""
    dt = admitted_step(SCENE, method, DT, np.array([start]))
    if dt == 0.0:
        _, error, run = energy_history(start, method, "lagrange", steps)
        return row_of(run, float(np.abs(error).max()), np.nan, claimed=False, why=DRIVEN)
    count = round(steps * DT / dt)
    fitted = steps * DT / count
    _, error, run = energy_history(start, method, "lagrange", count, fitted)
    half = energy_history(start, method, "lagrange", 2 * count, 0.5 * fitted)
    estimate = halving_tells(method, error, half[1])
    drift = float(np.abs(error).max())
    why = "twice what halving the step tells"
    return row_of(run, drift, 2.0 * estimate + ROUNDED, drift, remark="lagrange, largest error", why=why)


#: Start, and of the methods that the case is about: formulation, allowed trend and allowed drift.
_STARTS: dict[str, tuple[Sequence[float], tuple[tuple[str, str, float, float], ...]]] = {
    "undamped_paper_start": (
        PAPER_START,
        (
            ("gauss6", "hamilton", 1e-10, 1e-10),
            ("gauss6", "lagrange", 1e-9, 1e-9),
            ("dop853", "lagrange", 1e-8, 1e-8),
            ("rk4", "lagrange", 1e-3, 1e-3),
        ),
    ),
    "undamped_energetic_start": (
        ENERGETIC_START,
        (
            ("gauss6", "hamilton", 1e-10, 1e-6),
            ("gauss6", "lagrange", 1e-8, 1e-6),
            ("dop853", "lagrange", 1e-6, 1e-6),
            ("rk4", "lagrange", 1e-2, 1e-2),
        ),
    ),
}


def _run(name: str, quick: bool) -> Sequence[Row]:
    (start, entries), short = _STARTS[name], QUICK_WALK_STEPS if quick else WALK_STEPS
    rows = [_long(start, entry, QUICK_STEPS if quick else STEPS) for entry in entries]
    return rows + [_walked(start, method, short) for method in walked(quick)]


CASES = tuple(
    HardCase(
        name,
        f"beta = 0 for a million steps from {start}: whatever a step loses adds up",
        "energy is conserved; the error is the trend of E over E - U_min during the whole run; of shorter "
        "runs of all methods, the largest error of E",
        "Gauss 6 on the canonical equations keeps the energy to 1e-10 and shows no trend; the others drift "
        "slowly, by what their order lets them; Euler's method ends with a status",
        partial(_run, name),
    )
    for name, (start, _) in _STARTS.items()
)
