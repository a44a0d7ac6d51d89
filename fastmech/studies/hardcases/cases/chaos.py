"""Chaotic conservative motion: how long it can be predicted, and whether it comes back in reverse."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.integrate import solve_ivp

from fastmech.arrays import Floats
from fastmech.ensembles.integrate import Trajectories, integrate
from fastmech.ensembles.status import Status
from fastmech.ensembles.system import System
from fastmech.scene import Scene
from fastmech.studies.hardcases.walk import (
    DRIVEN,
    HardCase,
    Row,
    admitted_step,
    claimed_row,
    energy,
    fixed_row,
    halving_tells,
    motion,
    row_of,
    walked,
)
from fastmech.transients.lyapunov import largest_lyapunov

SCENE = Scene(c2=1100 / 3, beta=0.0, F0=0.0)
START = np.array([0.3, 2.5, 3.0, -4.0])

#: Difference of starts, and what counts as lost, of the largest state.
SEED, LOST = 1e-12, 1e-2

REVERSE = 20.0

#: Step that no method survives [s], error that is worth nothing and steps that are too many [1].
TOO_LONG, WORTHLESS, MOST_STEPS = 1.0, 0.1, 100_000

#: Rounding of 1e-16 at the end of the way back, and of the reference motion, after it grew with the exponent.
ROUNDED, ROUNDED_REFERENCE = 1e-4, 1e-9

#: Largest exponent of the Henon-Heiles system over 1e4 s from x = 0, y = -0.25, p_y = 0, p_x > 0, E = 1/8, as
#: printed by the package pynamicalsys (github.com/mrolims/pynamicalsys, commit 0b83e01ae401, notebook
#: tests/hamiltonian_systems/test_lyapunov.ipynb, outputs 7, 12 and 16): with RK4, with Yoshida's fourth-order
#: and with the Verlet method. The motion is chaotic, so each method has its own, and they scatter as
#: neighbouring motions do. Its documentation says "about 0.05" for y = -0.1. The figure of Skokos, Bountis,
#: Antonopoulos, Physica D 231 (2007), 30-54, usually cited for this start, was not at hand to be read.
PRINTED, PRINTED_LENGTH = (0.03787512, 0.0521435, 0.05969748), 10_000.0

#: Motions that start within 1e-9 of that one, and the time over which SciPy's tangent flow is compared [s].
MEAN_OF, SHORT = 64, 100.0


def _predictability(quick: bool) -> Sequence[Row]:
    found = largest_lyapunov(SCENE, START, 500.0 if quick else 5000.0, 0.01)
    exponent = float(found.largest[0])
    expected = np.log(LOST / SEED) / exponent
    times = np.arange(0.1, 4.0 * expected, 0.1)
    count = 16 if quick else 64
    shifts = SEED * np.random.default_rng(1).normal(size=(count, 4))
    starts = np.concatenate([[START], START + shifts])
    rows = []
    for method in walked(quick):
        dt = admitted_step(SCENE, method, 0.01, starts)
        run = integrate(SCENE, starts, t_eval=times, dt=dt or 0.01, method=method)
        if dt == 0.0:
            rows.append(row_of(run, np.nan, np.nan, claimed=False, why=DRIVEN))
            continue
        apart = np.linalg.norm(run.y[:, 1:] - run.y[:, :1], axis=2)
        lost = apart > LOST
        when = np.where(lost.any(axis=0), times[np.argmax(lost, axis=0)], np.inf)
        ratio = float(np.median(when)) / expected
        remark = f"exponent {exponent:.3f} 1/s, lost after {np.median(when):.1f} s, expected {expected:.1f} s"
        rows.append(row_of(run, abs(np.log2(ratio)), 1.0, remark=remark, why="neighbours part alike"))
    return rows


def _there_and_back(method: str, dt: float) -> tuple[Trajectories, Floats, float]:
    """The way back, the state in which it ends, rates turned again, and the energy error of the way out."""
    back = np.array([1.0, 1.0, -1.0, -1.0])
    there = integrate(SCENE, START, REVERSE, dt, method)
    begin = float(energy(SCENE, START))
    drift = abs(float(energy(SCENE, there.y[-1, 0])) - begin) / abs(begin)
    again = integrate(SCENE, there.y[-1, 0] * back, REVERSE, dt, method)
    return again, again.y[-1, 0] * back, drift


def _reverse(quick: bool) -> Sequence[Row]:
    rows = []
    for method, dt in (("dop853", 0.005), ("abm12", 0.002), ("gauss6", 0.002)):
        again, end, drift = _there_and_back(method, dt)
        rows.append(row_of(again, float(np.abs(end - START).max()), 1e-4, drift, why="declared"))
    return rows + [_returned(method) for method in walked(quick)]


def _returned(method: str) -> Row:
    """Where one method comes back to, claimed to what halving its step tells."""
    dt = admitted_step(SCENE, method, 0.01, np.array([START]))
    while 0.0 < REVERSE <= MOST_STEPS * dt:
        again, end, drift = _there_and_back(method, dt)
        _, finer, _ = _there_and_back(method, 0.5 * dt)
        estimate = halving_tells(method, end, finer)
        if estimate <= 0.5 * WORTHLESS:
            error, claim = float(np.abs(end - START).max()), 2.0 * estimate + ROUNDED
            return row_of(again, error, claim, drift, why="twice what halving the step tells")
        dt *= 0.5
    run = integrate(SCENE, START, REVERSE, TOO_LONG, method)
    why = f"errors grow e^{0.634 * 2 * REVERSE:.0f} times: no claim with {MOST_STEPS:,} steps"
    return row_of(run, np.nan, np.nan, claimed=False, why=why)


def henon_heiles(t: float, x: float, y: float, u: float, v: float) -> tuple[float, float, float, float]:
    """Motion in the potential (x^2 + y^2)/2 + x^2 y - y^3/3 (Henon, Heiles, Astron. J. 69 (1964), 73)."""
    return u, v, -x - 2.0 * x * y, -y - x * x + y * y


def _tangent_growth(start: Floats, length: float) -> float:
    """The same exponent over a short time by SciPy: motion and tangent by DOP853 at 1e-12 [1/s]."""

    def variational(t: float, s: Floats) -> Floats:
        x, y = s[:2]
        J = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [-1 - 2 * y, -2 * x, 0, 0], [-2 * x, 2 * y - 1, 0, 0]])
        return np.concatenate([henon_heiles(t, *s[:4]), J @ s[4:]])

    first = 1.0 / np.sqrt(np.arange(2.0, 6.0))  # the tangent that largest_lyapunov starts with
    begin = np.concatenate([start, first / np.linalg.norm(first)])
    solution = solve_ivp(variational, (0.0, length), begin, "DOP853", rtol=1e-12, atol=1e-12)
    return float(np.log(np.linalg.norm(solution.y[4:, -1]))) / length


def _published(quick: bool) -> Sequence[Row]:
    system, dt, ok = System(henon_heiles, ["x", "y", "u", "v"], {}), 0.1, Status.OK.name.lower()
    count = MEAN_OF // 4 if quick else MEAN_OF
    y = np.append(-0.25, -0.25 + 1e-9 * np.random.default_rng(1).normal(size=count - 1))
    u = np.sqrt(2.0 / 8.0 - y**2 + 2.0 * y**3 / 3.0)  # so that E = 1/8
    starts = np.stack([0.0 * y, y, u, 0.0 * y], axis=1)
    found = largest_lyapunov(system, starts, PRINTED_LENGTH, dt).largest
    mean, spread = float(found.mean()), float(found.std(ddof=1))
    theirs = float(np.mean(PRINTED))
    allowed = 3.0 * spread * np.sqrt(1.0 / count + 1.0 / len(PRINTED))
    remark = (
        f"{mean:.4f} 1/s with a scatter of {spread:.4f} 1/s between motions; printed: "
        + ", ".join(f"{value:.4f}" for value in PRINTED)
        + f", mean {theirs:.4f} 1/s"
    )
    steps = round(PRINTED_LENGTH / dt)
    why = "three standard errors of the difference of two means"
    rows = [Row("dop853", dt, steps, abs(mean - theirs), allowed, np.nan, ok, True, remark, why)]
    short = largest_lyapunov(system, starts[0], SHORT, 0.05).largest[0]
    expected = _tangent_growth(starts[0], SHORT)
    remark = f"{short:.8f} 1/s over {SHORT:g} s, SciPy {expected:.8f} 1/s"
    error = abs(float(short) - expected)
    return [
        *rows,
        Row("dop853", 0.05, round(SHORT / 0.05), error, 1e-6, np.nan, ok, True, remark, "rounding"),
    ]


def _reference(quick: bool) -> Sequence[Row]:
    goal = motion("chaos", ROUNDED_REFERENCE)
    declared = (("dop853", 0.01, 1e-6), ("gauss6", 0.005, 1e-6), ("abm12", 0.004, 1e-6))
    rows = [fixed_row(goal, method, dt, allowed, "declared") for method, dt, allowed in declared]
    return rows + [claimed_row(goal, method, 0.01, TOO_LONG) for method in walked(quick)]


CASES = (
    HardCase(
        "chaos_predictability",
        "chaotic conservative motion: starts 1e-12 apart part exponentially",
        "ln(1e10) over the largest Lyapunov exponent; error: |log2| of the time of parting over that",
        "the time of parting is the Lyapunov exponent's within a factor of 2",
        _predictability,
    ),
    HardCase(
        "chaos_reversed",
        f"{REVERSE:g} s of chaotic motion there and back with reversed rates",
        "the start itself; error: distance from it",
        "the motion returns, but for rounding and truncation that grew on the way",
        _reverse,
    ),
    HardCase(
        "chaos_published",
        "the tangent flow of a system of one's own, Henon-Heiles at E = 1/8, whose Jacobian is differences",
        "three printed values for this start over 1e4 s by pynamicalsys (commit 0b83e01ae401), and SciPy's "
        "tangent flow over 100 s; error: distance from their mean, and from SciPy's [1/s]",
        "the means agree within 3 standard errors of the scatter between motions; SciPy's to 1e-6 1/s",
        _published,
    ),
    HardCase(
        "chaos_reference",
        "20 s of an undamped motion over the whole torus",
        "heyoka in 80-bit arithmetic; largest difference of the final state",
        "high orders keep eight digits, every method as many as it claims",
        _reference,
    ),
)
