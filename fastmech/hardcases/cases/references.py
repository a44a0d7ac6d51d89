"""Extreme parameters, rates, angles and forces: the end of one motion against extended precision."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from fastmech.hardcases.case import HardCase, Row, final_row
from fastmech.hardcases.references import motion

ORACLE = "heyoka in 80-bit arithmetic; relative error of the final state"

#: name -> (what is hard, what must happen, claimed: (method, dt, allowed), refused: (method, dt)).
_MOTIONS: dict[str, tuple[str, str, list[tuple[str, float, float]], list[tuple[str, float]]]] = {
    "damping_1e4": (
        "beta = 1e4 N s/m: one rate of motion is a hundred times the others",
        "the L-stable methods reach 1e-8 at steps far above RK4's limit",
        [("radau5", 0.005, 1e-8), ("sdirk4", 0.002, 1e-8), ("gauss6", 0.005, 1e-8)],
        [("rk4", 0.02)],
    ),
    "damping_1e6": (
        "beta = 1e6 N s/m: one rate of motion is ten thousand times the others",
        "the L-stable methods reach 1e-8 with a fiftieth of the right-hand sides of RK4 at its limit",
        [("radau5", 1 / 60, 1e-8), ("sdirk4", 0.005, 1e-8)],
        [("rk4", 0.01), ("dop853", 0.01)],
    ),
    "fast_rates": (
        "both bodies turn at 100 rad/s",
        "a step of a few hundredths of a radian keeps ten digits",
        [("dop853", 5e-4, 1e-9), ("abm12", 1e-4, 1e-9), ("gauss6", 5e-4, 1e-9)],
        [("rk4", 0.05)],
    ),
    "large_angles": (
        "angles of 1e6 rad, where their last bit is 1e-10 rad",
        "the library's trigonometry takes over; the error stays that of the angles' own rounding",
        [("rk4", 0.002, 1e-13), ("dop853", 0.02, 1e-13), ("radau5", 0.005, 1e-13)],
        [],
    ),
    "light_m2": (
        "m2/m1 = 1e-6: reduced coefficients of a million",
        "no digits are lost to the mass ratio",
        [("dop853", 0.01, 1e-9), ("abm12", 0.002, 1e-9), ("gauss6", 0.01, 1e-8)],
        [],
    ),
    "heavy_m2": (
        "m2/m1 = 1e6: the metric is nearly singular where cos(phi+theta) = 0",
        "the determinant without cancellation keeps the digits",
        [("dop853", 0.01, 1e-9), ("gauss6", 0.01, 1e-9)],
        [],
    ),
    "whip": (
        "m2/m1 = 1e6, later: M2 drags M1 through cos(phi+theta) = 0 at more than 1e3 rad/s",
        "no fixed step of a useful length gets through, and every method says so",
        [],
        [("dop853", 1e-3), ("gauss6", 1e-3), ("rk4", 1e-3), ("radau5", 1e-3)],
    ),
    "no_slider": (
        "m3 = 0: nothing but M1 and M2 has inertia",
        "as any other motion",
        [("dop853", 0.01, 1e-9), ("gauss6", 0.01, 1e-9)],
        [],
    ),
    "short_rods": (
        "l = 1e-3 m: gravity makes rates of 100 rad/s",
        "as any other motion at the step that the rates ask for",
        [("dop853", 2e-4, 1e-8), ("radau5", 1e-4, 1e-8)],
        [("rk4", 0.1)],
    ),
    "long_rods": (
        "l = 1e3 m: energies of 1e8 J",
        "as any other motion",
        [("dop853", 0.02, 1e-9), ("abm12", 0.005, 1e-9)],
        [],
    ),
    "slow_decay": (
        "alpha = 1e-6 1/s: the force hardly decays",
        "as any other motion",
        [("dop853", 0.02, 1e-9), ("radau5", 0.01, 1e-8)],
        [],
    ),
    "large_force": (
        "F0 = 1e6 N: accelerations of 1e5 rad/s^2",
        "as any other motion at the step that the rates ask for",
        [("dop853", 1e-4, 1e-8), ("gauss6", 1e-4, 1e-8)],
        [("rk4", 0.05)],
    ),
}


def _runner(name: str) -> Callable[[bool], Sequence[Row]]:
    def run(quick: bool) -> Sequence[Row]:
        scene, start, t, state = motion(name)
        _, _, claimed, refused = _MOTIONS[name]
        rows = [final_row(scene, start, t, state, method, dt, allowed) for method, dt, allowed in claimed]
        rows += [final_row(scene, start, t, state, method, dt, 0.0, claimed=False) for method, dt in refused]
        return rows

    return run


CASES = tuple(
    HardCase(name, hard, ORACLE, must, _runner(name)) for name, (hard, must, _, _) in _MOTIONS.items()
)
