"""Write fastmech/studies/hardcases/references.toml: final states of hard motions, 19 digits.

    python data/make_hardcases.py

Needs heyoka (7.13) beside NumPy. The equations of motion are derived from positions and energies by heyoka's
own differentiation and integrated by its adaptive Taylor series in 80-bit arithmetic with tolerances 1e-19
and 1e-17; a state is stored with the difference of the two, which must be small. Nothing of fastmech is used.
"""

from __future__ import annotations

import time
from pathlib import Path

import heyoka as hy
import numpy as np

TABLE_1 = {
    "m1": 10.0, "m2": 12.0, "m3": 8.0, "l": 1.25, "c1": 162.5, "c2": 1100 / 3,
    "beta": 121.0, "g": 9.80665, "F0": 100.0, "alpha": 0.7,
}  # fmt: skip
START = [1.0, 0.5, 0.0, 0.0]

#: name -> (changes to Table 1, start, time [s])
MOTIONS: dict[str, tuple[dict[str, float], list[float], float]] = {
    "damping_1e4": ({"beta": 1e4}, START, 2.0),
    "damping_1e6": ({"beta": 1e6}, START, 2.0),
    "fast_rates": ({"alpha": 0.0}, [0.3, 0.5, 100.0, -100.0], 0.5),
    "large_angles": ({}, [1e6, -1e6, 1.0, -2.0], 2.0),
    "light_m2": ({"m2": 1e-5, "c1": 1e-4, "F0": 1e-4}, START, 2.0),
    "heavy_m2": ({"m2": 1e7, "m1": 10.0}, START, 0.6),
    "whip": ({"m2": 1e7, "m1": 10.0}, START, 2.0),
    "no_slider": ({"m3": 0.0, "beta": 0.0}, START, 5.0),
    "short_rods": ({"l": 1e-3}, START, 0.2),
    "long_rods": ({"l": 1e3}, START, 50.0),
    "slow_decay": ({"alpha": 1e-6}, START, 5.0),
    "sudden_decay": ({"alpha": 1e6}, START, 2.0),
    "large_force": ({"F0": 1e6, "alpha": 0.0}, START, 0.2),
    "chaos_reference": ({"F0": 0.0, "beta": 0.0}, [2.5, 2.0, 0.0, 0.0], 20.0),
}

#: A line of starts at rest, theta = 0, that crosses a basin boundary between these values of phi; and the
#: time [s] after which a motion that started 1e-18 rad from it has come to rest.
BOUNDARY_SCENE = {"c1": 294.9, "c2": 92.85, "F0": 85.3, "alpha": 0.0}
BOUNDARY_BETWEEN, BOUNDARY_TIME = (-1.0, -0.975), 60.0

PRECISION = np.longdouble

TARGET = Path(__file__).parents[1] / "fastmech" / "studies" / "hardcases" / "references.toml"


def equations(p: dict[str, float]) -> list[tuple[hy.expression, hy.expression]]:
    phi, theta, v, w, t = *hy.make_vars("phi", "theta", "v", "w"), hy.time
    c = {name: PRECISION(value) for name, value in p.items()}
    l = c["l"]
    x1, y1 = l * hy.cos(phi), l * hy.sin(phi)
    x2, y2 = x1 - l * hy.sin(theta), y1 - l * hy.cos(theta)
    x3 = l * (hy.cos(phi) + hy.sqrt(PRECISION(4) - hy.sin(phi) ** 2))

    def rate(x: hy.expression) -> hy.expression:
        return hy.diff(x, phi) * v + hy.diff(x, theta) * w

    half = PRECISION(0.5)
    T = half * (
        c["m1"] * (rate(x1) ** 2 + rate(y1) ** 2)
        + c["m2"] * (rate(x2) ** 2 + rate(y2) ** 2)
        + c["m3"] * rate(x3) ** 2
    )
    springs = c["c1"] * (x2**2 + y2**2) + c["c2"] * (x1**2 + (y1 - l) ** 2)
    Pi = c["g"] * (c["m1"] * y1 + c["m2"] * y2) + half * springs
    F = c["F0"] * hy.exp(-c["alpha"] * t)
    a11, a12, a22 = (hy.diff(hy.diff(T, a), b) for a, b in ((v, v), (v, w), (w, w)))
    forces = []
    for q, rate_of_q in ((phi, v), (theta, w)):
        momentum = hy.diff(T, rate_of_q)
        force = hy.diff(T, q) - hy.diff(Pi, q) + F * hy.diff(x2, q)
        force -= hy.diff(momentum, phi) * v + hy.diff(momentum, theta) * w
        forces.append(force)
    forces[0] -= c["beta"] * hy.diff(x3, phi) ** 2 * v
    det = a11 * a22 - a12 * a12
    return [
        (phi, v),
        (theta, w),
        (v, (a22 * forces[0] - a12 * forces[1]) / det),
        (w, (a11 * forces[1] - a12 * forces[0]) / det),
    ]


def final(p: dict[str, float], start: list[float], t: float, tolerance: float) -> np.ndarray:
    integrator = hy.taylor_adaptive(
        equations(p),
        [PRECISION(x) for x in start],
        fp_type=PRECISION,
        tol=PRECISION(tolerance),
        compact_mode=True,
    )
    outcome = integrator.propagate_until(PRECISION(t))[0]
    assert outcome == hy.taylor_outcome.time_limit, outcome
    return integrator.state.copy()


def boundary() -> tuple[np.longdouble, list[list[float]]]:
    """The boundary's phi to 80 bits, and the angles in which motions from below and above it end."""
    integrator = hy.taylor_adaptive(
        equations(TABLE_1 | BOUNDARY_SCENE),
        [PRECISION(0)] * 4,
        fp_type=PRECISION,
        tol=PRECISION(1e-19),
        compact_mode=True,
    )

    def end(phi: np.longdouble) -> np.ndarray:
        integrator.time, integrator.state[:] = PRECISION(0), [phi, PRECISION(0), PRECISION(0), PRECISION(0)]
        outcome = integrator.propagate_until(PRECISION(BOUNDARY_TIME))[0]
        assert outcome == hy.taylor_outcome.time_limit, outcome
        return integrator.state[:2].copy()

    low, high = (PRECISION(phi) for phi in BOUNDARY_BETWEEN)
    below, above = end(low), end(high)
    while low < (middle := (low + high) / 2) < high:
        here = end(middle)
        if np.abs(here - below).max() < np.abs(here - above).max():
            low = middle
        else:
            high = middle
    return low, [[float(x) for x in place] for place in (below, above)]


def main() -> None:
    lines = [
        "# Made by make_hardcases.py: final states of hard motions, heyoka in 80-bit arithmetic. SI units.",
        "# `uncertainty` is the difference between tolerances of 1e-19 and 1e-17.",
    ]
    for name, (changes, start, t) in MOTIONS.items():
        began = time.time()
        scene = TABLE_1 | changes
        fine, coarse = (final(scene, start, t, tolerance) for tolerance in (1e-19, 1e-17))
        uncertainty = float(np.abs(fine - coarse).max())
        lines += ["", f"[{name}]", f"start = {start}", f"t = {t}"]
        lines.append("state = [" + ", ".join(f'"{x:.19e}"' for x in fine) + "]")
        lines.append(f"uncertainty = {uncertainty:.1e}")
        lines.append("scene = { " + ", ".join(f"{k} = {v!r}" for k, v in changes.items()) + " }")
        print(f"{name}: {uncertainty:.1e}, {time.time() - began:.1f} s", flush=True)
        TARGET.write_text("\n".join([*lines, ""]), encoding="utf-8")
    phi, ends = boundary()
    lines += ["", "[boundary]", f'phi = "{phi:.20f}"', f"ends = {ends}"]
    lines.append("scene = { " + ", ".join(f"{k} = {v!r}" for k, v in BOUNDARY_SCENE.items()) + " }")
    TARGET.write_text("\n".join([*lines, ""]), encoding="utf-8")


if __name__ == "__main__":
    main()
