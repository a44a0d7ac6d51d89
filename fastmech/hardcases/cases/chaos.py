"""Chaotic conservative motion: how long it can be predicted, and whether it comes back in reverse."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.status import Status
from fastmech.ensembles.system import System
from fastmech.hardcases.case import HardCase, Row, energy, row_of
from fastmech.hardcases.references import motion
from fastmech.scene import Scene
from fastmech.transients.lyapunov import largest_lyapunov

SCENE = Scene(c2=1100 / 3, beta=0.0, F0=0.0)
START = np.array([0.3, 2.5, 3.0, -4.0])

#: Difference of starts, and what counts as lost, of the largest state.
SEED, LOST = 1e-12, 1e-2

REVERSE = 20.0

#: Largest exponent of the Henon-Heiles system at E = 1/8, of the chaotic motion through x = 0, y = -0.25 with
#: y' = 0: Skokos, Bountis, Antonopoulos, Physica D 231 (2007), 30-54. Printed to two digits.
PUBLISHED, LAST_DIGIT = 0.047, 5e-4

#: Motions that start together and average over the chaotic sea, and their length [s].
MEAN_OF, FULL, QUICK = 32, 30_000.0, 3000.0


def _predictability(quick: bool) -> Sequence[Row]:
    found = largest_lyapunov(SCENE, START, 500.0 if quick else 5000.0, 0.01)
    exponent = float(found.largest[0])
    expected = np.log(LOST / SEED) / exponent
    times = np.arange(0.1, 4.0 * expected, 0.1)
    count = 16 if quick else 64
    shifts = SEED * np.random.default_rng(1).normal(size=(count, 4))
    rows = []
    for method, dt in (("dop853", 0.01), ("gauss6", 0.01)):
        run = integrate(SCENE, np.concatenate([[START], START + shifts]), t_eval=times, dt=dt, method=method)
        apart = np.linalg.norm(run.y[:, 1:] - run.y[:, :1], axis=2)
        lost = apart > LOST
        when = np.where(lost.any(axis=0), times[np.argmax(lost, axis=0)], np.inf)
        ratio = float(np.median(when)) / expected
        remark = f"exponent {exponent:.3f} 1/s, lost after {np.median(when):.1f} s, expected {expected:.1f} s"
        rows.append(row_of(run, abs(np.log2(ratio)), 1.0, remark=remark))
    return rows


def _reverse(quick: bool) -> Sequence[Row]:
    back = np.array([1.0, 1.0, -1.0, -1.0])
    rows = []
    for method, dt in (("dop853", 0.005), ("abm12", 0.002), ("gauss6", 0.002)):
        there = integrate(SCENE, START, REVERSE, dt, method)
        again = integrate(SCENE, there.y[-1, 0] * back, REVERSE, dt, method)
        error = float(np.abs(again.y[-1, 0] * back - START).max())
        begin = float(energy(SCENE, START))
        drift = abs(float(energy(SCENE, there.y[-1, 0])) - begin) / abs(begin)
        rows.append(row_of(again, error, 1e-4, drift))
    return rows


def henon_heiles(t: float, x: float, y: float, u: float, v: float) -> tuple[float, float, float, float]:
    """Motion in the potential (x^2 + y^2)/2 + x^2 y - y^3/3 (Henon, Heiles, Astron. J. 69 (1964), 73)."""
    return u, v, -x - 2.0 * x * y, -y - x * x + y * y


def _published(quick: bool) -> Sequence[Row]:
    system, dt = System(henon_heiles, ["x", "y", "u", "v"], {}), 0.1
    y = -0.25 + 1e-5 * np.random.default_rng(1).normal(size=MEAN_OF)
    u = np.sqrt(2.0 / 8.0 - y**2 + 2.0 * y**3 / 3.0)  # so that E = 1/8
    length = QUICK if quick else FULL
    found = largest_lyapunov(system, np.stack([0.0 * y, y, u, 0.0 * y], axis=1), length, dt).largest
    mean, uncertain = float(found.mean()), float(found.std(ddof=1)) / np.sqrt(MEAN_OF)
    steps, status = round(length / dt), Status.OK.name.lower()
    remark = f"{mean:.4f} +- {uncertain:.4f} 1/s, published {PUBLISHED} 1/s"
    error = abs(mean - PUBLISHED)
    return [Row("dop853", dt, steps, error, LAST_DIGIT + 3.0 * uncertain, np.nan, status, True, remark)]


def _reference(quick: bool) -> Sequence[Row]:
    m = motion("chaos")
    rows = []
    for method, dt in (("dop853", 0.01), ("gauss6", 0.005), ("abm12", 0.004)):
        run = integrate(m.scene, m.start, m.t, dt, method)
        rows.append(row_of(run, float(np.abs(run.y[-1, 0] - m.state).max()), 1e-6))
    return rows


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
        "0.047 1/s, Skokos, Bountis, Antonopoulos, Physica D 231 (2007); error: distance from it [1/s]",
        "the mean of 32 chaotic motions agrees within the last digit printed and 3 standard errors",
        _published,
    ),
    HardCase(
        "chaos_reference",
        "20 s of an undamped motion over the whole torus",
        "heyoka in 80-bit arithmetic; largest difference of the final state",
        "high orders keep eight digits",
        _reference,
    ),
)
