"""Heavy damping: one rate of motion a hundred, or ten thousand, times the others."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from fastmech.ensembles.integrate import integrate
from fastmech.hardcases.case import HardCase, Row, row_of
from fastmech.hardcases.cases.references import ORACLE, goal_of
from fastmech.hardcases.counts import counted, explicit_calls
from fastmech.hardcases.walk import Goal, claimed_row, fixed_row, status_row, walked
from fastmech.integrators.method import ImplicitRungeKutta
from fastmech.integrators.methods import find_method
from fastmech.step_limits.warning import step_warning

#: name -> (what is hard, step of the walk [s], (method, steps) that must keep 1e-8).
_CASES: dict[str, tuple[str, float, tuple[tuple[str, int], ...]]] = {
    "damping_1e4": (
        "beta = 1e4 N s/m: one rate of motion is a hundred times the others",
        0.005,
        (("radau5", 400), ("sdirk4", 1000), ("gauss6", 400)),
    ),
    "damping_1e6": (
        "beta = 1e6 N s/m: one rate of motion is ten thousand times the others",
        1 / 60,
        (("radau5", 120), ("sdirk4", 400)),
    ),
}

#: Error that the order asks for, and how many times fewer right-hand sides than RK4 it must take.
ACCURACY, FEWER = 1e-8, 50.0


def _counted_row(goal: Goal, method: str, steps: int, fewer: float) -> Row:
    """Declared accuracy with every right-hand side counted; too many of them fail the row."""
    run = integrate(goal.scene, goal.start, goal.t_end, goal.t_end / steps, method)
    work = counted(goal, method, steps)
    least = explicit_calls(goal, work.path)
    enough = least >= fewer * work.calls
    remark = (
        f"{work.calls:,} right-hand sides and {work.jacobians:,} Jacobians; RK4 at its limit {least:,.0f}, "
        f"{least / work.calls:.0f} times as many"
    )
    error = max(goal.error(run.y[-1, 0]), goal.error(work.state))
    return row_of(run, error if enough else float("inf"), ACCURACY, remark=remark, why="L-stable")


def _runner(name: str) -> Callable[[bool], Sequence[Row]]:
    def run(quick: bool) -> Sequence[Row]:
        _, dt, claims = _CASES[name]
        goal = goal_of(name)
        rows = []
        for method, steps in claims:
            if name == "damping_1e6":
                rows.append(_counted_row(goal, method, steps, FEWER if method == "radau5" else 0.0))
            else:
                rows.append(fixed_row(goal, method, goal.t_end / steps, ACCURACY, "declared"))
        for method in walked(quick):
            implicit = isinstance(find_method(method), ImplicitRungeKutta)
            if implicit or step_warning(goal.scene, dt, method, goal.start) is None:
                rows.append(claimed_row(goal, method, dt, dt))
            else:
                rows.append(status_row(goal, method, dt, "beyond its stability limit"))
        return rows

    return run


CASES = tuple(
    HardCase(
        name,
        hard,
        ORACLE,
        "the L-stable methods reach 1e-8 at steps far above RK4's limit"
        + (", Radau IIA with a fiftieth of RK4's right-hand sides" if name == "damping_1e6" else "")
        + "; methods whose limit the step exceeds end with a status",
        _runner(name),
    )
    for name, (hard, _, _) in _CASES.items()
)
