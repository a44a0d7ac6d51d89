"""Extreme damping, parameters, rates, angles and forces: the end of one motion against extended precision."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from fastmech.integrators.methods import ImplicitRungeKutta, find_method
from fastmech.step_limits.warning import step_warning
from fastmech.studies.hardcases.walk import (
    ROUNDED,
    Goal,
    HardCase,
    Row,
    claimed_row,
    counted,
    explicit_calls,
    fixed_row,
    motion,
    status_row,
    walked,
)

ORACLE = "heyoka in 80-bit arithmetic; relative error of the final state"


class _Motion(NamedTuple):
    """How a reference motion is gone through."""

    hard: str
    must: str
    step: float  #: s, of methods without memory
    refused: float  #: s, far too long: what claims nothing is run with it
    claims: tuple[tuple[str, float, float], ...] = ()  #: method, step [s], error that it must keep
    all_refuse: bool = True  #: whether no method may give a number with the step ``refused``
    single: bool = False  #: whether lanes of float32 claim it
    rounded: float = ROUNDED
    stiff: bool = False  #: whether explicit methods whose limit the step exceeds end with a status
    #: Method, step [s], error that it must keep, and how many times fewer calls than RK4's it takes.
    counted: tuple[tuple[str, float, float, float], ...] = ()


#: Error that lanes of float32 claim: fm.integrate's documentation.
SINGLE = 1e-4

_L_STABLE = "the L-stable methods reach 1e-8 at steps far above RK4's limit"
_BEYOND = "methods whose limit the step exceeds end with a status"

_MOTIONS: dict[str, _Motion] = {
    "damping_1e4": _Motion(
        "beta = 1e4 N s/m: one rate of motion is a hundred times the others",
        f"{_L_STABLE}; {_BEYOND}",
        0.005, 0.005, (("radau5", 0.005, 1e-8), ("sdirk4", 0.002, 1e-8), ("gauss6", 0.005, 1e-8)),
        all_refuse=False, stiff=True,
    ),
    "damping_1e6": _Motion(
        "beta = 1e6 N s/m: one rate of motion is ten thousand times the others",
        f"{_L_STABLE}, Radau IIA with a fiftieth of RK4's right-hand sides; {_BEYOND}",
        1 / 60, 1 / 60, all_refuse=False, stiff=True,
        counted=(("radau5", 1 / 60, 1e-8, 50.0), ("sdirk4", 0.005, 1e-8, 0.0)),
    ),
    "fast_rates": _Motion(
        "both bodies turn at 100 rad/s",
        "a step of a few hundredths of a radian keeps ten digits; 5 rad in a step are told by a status",
        5e-4, 0.05, (("dop853", 5e-4, 1e-9), ("abm12", 1e-4, 1e-9), ("gauss6", 5e-4, 1e-9)),
    ),
    "large_angles": _Motion(
        "angles of 1e6 rad, where their last bit is 1e-10 rad",
        "the library's trigonometry takes over; the error stays that of the angles' own rounding",
        0.01, 1.0, (("rk4", 0.002, 1e-13), ("dop853", 0.02, 1e-13), ("radau5", 0.005, 1e-13)), rounded=1e-13,
    ),
    "light_m2": _Motion(
        "m2/m1 = 1e-6: reduced coefficients of a million",
        "no digits are lost to the mass ratio",
        0.01, 1.0, (("dop853", 0.01, 1e-9), ("abm12", 0.002, 1e-9), ("gauss6", 0.01, 1e-8)),
        all_refuse=False, single=True,
    ),
    "heavy_m2": _Motion(
        "m2/m1 = 1e6: the metric is nearly singular where cos(phi+theta) = 0",
        "the determinant without cancellation keeps the digits",
        0.01, 0.3, (("dop853", 0.0015, 1e-9), ("gauss6", 0.01, 1e-9)),
    ),
    "no_slider": _Motion(
        "m3 = 0: nothing but M1 and M2 has inertia",
        "as any other motion",
        0.01, 1.0, (("dop853", 0.01, 1e-9), ("gauss6", 0.01, 1e-9)), all_refuse=False, single=True,
    ),
    "short_rods": _Motion(
        "l = 1e-3 m: gravity makes rates of 100 rad/s",
        "as any other motion at the step that the rates ask for",
        2e-4, 0.1, (("dop853", 2e-4, 1e-8), ("radau5", 1e-4, 1e-8)),
    ),
    "long_rods": _Motion(
        "l = 1e3 m: energies of 1e8 J",
        "as any other motion",
        0.02, 2.0, (("dop853", 0.02, 1e-9), ("abm12", 0.005, 1e-9)), all_refuse=False, single=True,
    ),
    "slow_decay": _Motion(
        "alpha = 1e-6 1/s: the force hardly decays",
        "as any other motion",
        0.02, 2.5, (("dop853", 0.02, 1e-9), ("radau5", 0.01, 1e-8)), all_refuse=False, single=True,
    ),
    "large_force": _Motion(
        "F0 = 1e6 N: accelerations of 1e5 rad/s^2",
        "as any other motion at the step that the rates ask for",
        1e-4, 0.05, (("dop853", 1e-4, 1e-8), ("gauss6", 1e-4, 1e-8)),
    ),
}  # fmt: skip


def _counted_row(goal: Goal, method: str, dt: float, allowed: float, fewer: float) -> Row:
    """A declared claim with every right-hand side counted; too many of them fail the row."""
    row = fixed_row(goal, method, dt, allowed, "L-stable")
    work = counted(goal, method, round(goal.t_end / dt))
    least = explicit_calls(goal, work.path)
    remark = (
        f"{work.calls:,} right-hand sides and {work.jacobians:,} Jacobians; RK4 at its limit {least:,.0f}, "
        f"{least / work.calls:.0f} times as many"
    )
    error = max(row.error, goal.error(work.state)) if least >= fewer * work.calls else np.inf
    return row._replace(error=error, remark=remark)


def _end_of(goal: Goal, m: _Motion, method: str) -> Row:
    """The end by one method to its own claim, or its status at a step beyond its limit."""
    explicit = not isinstance(find_method(method), ImplicitRungeKutta)
    if m.stiff and explicit and step_warning(goal.scene, m.step, method, goal.start) is not None:
        return status_row(goal, method, m.step, "beyond its stability limit")
    return claimed_row(goal, method, m.step, m.refused)


def _run(name: str, quick: bool) -> Sequence[Row]:
    m = _MOTIONS[name]
    goal = motion(name, m.rounded)
    rows = [_counted_row(goal, *claim) for claim in m.counted]
    rows += [fixed_row(goal, *claim, "declared") for claim in m.claims]
    rows += [_end_of(goal, m, method) for method in walked(quick)]
    if m.single:
        why = "what fm.integrate says of float32"
        rows += [fixed_row(goal, method, m.step, SINGLE, why, "float32") for method in ("rk4", "dop853")]
        rows.append(status_row(goal, "radau5", m.step, "float32 is not offered", "float32"))
    if m.all_refuse:
        rows += [status_row(goal, method, m.refused, "a step far too long") for method in walked(quick)]
    return rows


def _whip(quick: bool) -> Sequence[Row]:
    goal = motion("whip")
    return [status_row(goal, method, 1e-3, "1e3 rad/s and more for a moment") for method in walked(quick)]


CASES = (
    *(HardCase(name, m.hard, ORACLE, m.must, partial(_run, name)) for name, m in _MOTIONS.items()),
    HardCase(
        "whip",
        "m2/m1 = 1e6, later: M2 drags M1 through cos(phi+theta) = 0 at more than 1e3 rad/s",
        ORACLE,
        "no fixed step of a useful length gets through, and every method says so",
        _whip,
    ),
)
