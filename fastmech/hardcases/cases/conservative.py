"""No damper, no force, a million steps: what happens to the energy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.balance import lowest_potential
from fastmech.ensembles.integrate import integrate
from fastmech.hardcases.case import HardCase, Row, energy, row_of
from fastmech.scene import Scene

SCENE = Scene(c2=1100 / 3, beta=0.0, F0=0.0)

#: The paper's start, and an energetic one.
PAPER_START = (0.966643893412244, 0.4487989505128276, 0.0, 0.0)
ENERGETIC_START = (0.3, 2.5, 3.0, -4.0)

#: Step [s] and steps of the full and the quick version.
DT, STEPS, QUICK_STEPS = 0.01, 1_000_000, 10_000

OUTPUTS = 200


def energy_history(
    start: Sequence[float], method: str, formulation: str, steps: int, dt: float = DT
) -> tuple[NDArray[np.float64], NDArray[np.float64], Row]:
    """Times [s], relative energy error at each, and the row of a long conservative run.

    The row's error is the trend: slope of a straight line through the energy error times the length of the
    run, without its oscillation.
    """
    times = np.linspace(0.0, steps * dt, OUTPUTS + 1)[1:]
    run = integrate(SCENE, start, t_eval=times, dt=dt, method=method, formulation=formulation)
    begin = energy(SCENE, np.array(start))
    size = float(begin) - lowest_potential(SCENE)
    error = (energy(SCENE, run.y[:, 0]) - begin) / size
    trend = abs(float(np.polyfit(times, error, 1)[0])) * times[-1]
    drift = float(np.abs(error).max())
    return times, error, row_of(run, trend, np.inf, drift, remark=formulation)


def _case(name: str, start: Sequence[float], entries: Sequence[tuple[str, str, float, float]]) -> HardCase:
    """``entries``: method, formulation, allowed trend, allowed drift."""

    def run(quick: bool) -> Sequence[Row]:
        rows = []
        for method, formulation, allowed, most in entries:
            row = energy_history(start, method, formulation, QUICK_STEPS if quick else STEPS)[2]
            error = row.error if row.drift <= most else np.inf
            rows.append(Row(**{**vars(row), "error": error, "allowed": allowed}))
        return rows

    return HardCase(
        name,
        f"beta = 0 for a million steps from {start}: whatever a step loses adds up",
        "energy is conserved; the error is the trend of E over E - U_min during the whole run",
        "Gauss 6 on the canonical equations keeps the energy to 1e-10 and shows no trend; the others drift "
        "slowly, by what their order lets them",
        run,
    )


CASES = (
    _case(
        "undamped_paper_start",
        PAPER_START,
        [
            ("gauss6", "hamilton", 1e-10, 1e-10),
            ("gauss6", "lagrange", 1e-9, 1e-9),
            ("dop853", "lagrange", 1e-8, 1e-8),
            ("rk4", "lagrange", 1e-2, 1e-2),
        ],
    ),
    _case(
        "undamped_energetic_start",
        ENERGETIC_START,
        [
            ("gauss6", "hamilton", 1e-10, 1e-6),
            ("gauss6", "lagrange", 1e-8, 1e-6),
            ("dop853", "lagrange", 1e-6, 1e-6),
            ("rk4", "lagrange", 1.0, 1.0),
        ],
    ),
)
