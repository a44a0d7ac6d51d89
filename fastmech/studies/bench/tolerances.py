"""``tol`` on random scenes: is its error estimate the truth?

Chaotic motions and those that graze a saddle magnify rounding by 1e6 to 1e12: in double nobody knows where
they end. The truth comes from Gragg-Bulirsch-Stoer extrapolation in NumPy's longdouble (80 bits on x86, which
start 2000 times below), with equations typed separately. It shares nothing with the engine: the modified
midpoint rule with 2, 4, 6, ... steps, extrapolated in the square of the step (Hairer, Norsett, Wanner,
*Solving ODEs I*, section II.9), one array operation for all trajectories, each with its own steps. What is
extrapolated is the change within a step: it rounds less than the state. Where two runs differ the estimate is
not judged; so too where longdouble is no more than double (Windows, ARM Macs).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.work_precision import order_statistic
from fastmech.reports import Stage
from fastmech.scene import Scene
from fastmech.slider.coefficients import reduce
from fastmech.studies.bench.own_systems import in_numpy
from fastmech.studies.bench.peers import lagrange
from fastmech.studies.reporting import section

Extended = NDArray[np.longdouble]

#: Times (n,) and states (dim, n) to derivatives (dim, n).
Rates = Callable[[Extended, Extended], Extended]

#: Columns of the extrapolation: its order is twice as many.
COLUMNS = 9

#: Errors a step, relative to 1 and the largest state, in longdouble's rounding, of the two runs.
ROUNDINGS = (10.0, 1000.0)

#: How a step may change from one to the next, the share of the step that the error allows, and the share of
#: the run from which steps are taken whatever their error.
LEAST, MOST, SAFETY, SHORTEST = 0.2, 2.0, 0.8, 1e-5

_plain = in_numpy(lagrange)


def scene_rates(scene: Scene) -> Rates:
    """Derivatives (4, n) of a scene's states (4, n) at their times (n,)."""
    p = np.array(reduce(scene), dtype=np.float64).astype(np.longdouble)

    def rates(t: Extended, y: Extended) -> Extended:
        now = list(p)
        now[5] = p[5] * np.exp(-p[7] * t) if p[5] * p[7] != 0.0 else p[5]
        return np.stack([y[2], y[3], *_plain(*y, now)])

    return rates


def _step(t: Extended, y: Extended, h: Extended, rates: Rates) -> tuple[Extended, Extended]:
    """Changes (dim, n) over steps h (n,) and their errors (n,)."""
    table: list[Extended] = []
    begin, last = rates(t, y), np.zeros_like(y)
    for j in range(COLUMNS):
        n = 2 * (j + 1)
        part = h / n
        before, middle = np.zeros_like(y), part * begin
        for k in range(1, n):
            before, middle = middle, before + 2.0 * part * rates(t + k * part, y + middle)
        table.append(middle)
        for m in range(j - 1, -1, -1):
            last = table[m + 1]
            ratio = np.longdouble(n * n) / (4 * (m + 1) ** 2) - 1
            table[m] = last + (last - table[m]) / ratio
    return table[0], np.abs(table[0] - last).max(axis=0)


def extended(rates: Rates, starts: Floats, t_end: float, roundings: float) -> Extended:
    """Final states (n, dim) from starts (n, dim)."""
    end, tolerance = np.longdouble(t_end), np.longdouble(roundings) * np.finfo(np.longdouble).eps
    y = starts.T.astype(np.longdouble)
    t, h = np.zeros(len(starts), np.longdouble), np.full(len(starts), end / 128)
    final, who = np.empty_like(y), np.arange(len(starts))
    while who.size:
        last = t + h >= end
        h = np.where(last, end - t, h)
        with np.errstate(invalid="ignore", over="ignore"):
            change, error = _step(t, y, h, rates)
            error = error / np.maximum(np.abs(y).max(axis=0), 1)
            wanted = SAFETY * (tolerance / np.maximum(error, np.finfo(np.longdouble).tiny)) ** (
                np.longdouble(1) / (2 * COLUMNS - 1)
            )
        taken = (error <= tolerance) | (h <= SHORTEST * end)
        y = np.where(taken, y + change, y)
        t = np.where(taken, np.where(last, end, t + h), t)
        h = np.maximum(h * np.clip(np.nan_to_num(wanted, nan=LEAST), LEAST, MOST), SHORTEST * end)
        done = t >= end
        final[:, who[done]] = y[:, done]
        who, t, h, y = who[~done], t[~done], h[~done], y[:, ~done]
    return np.ascontiguousarray(final.T)


def extended_truth(rates: Rates, starts: Floats, t_end: float) -> tuple[Floats, Floats]:
    """Final states (n, dim) and their uncertainties (n,): the largest difference of two runs."""
    fine, coarse = (extended(rates, starts, t_end, roundings) for roundings in ROUNDINGS)
    return fine.astype(np.float64), np.abs(fine - coarse).max(axis=1).astype(np.float64)


#: Scenes, and trajectories of each: more than the sample of the calibration.
SCENES, STARTS = 40, 512

QUANTILES = (0.5, 0.99, 1.0)

#: An estimate is right within this factor, both ways.
FACTOR = 3.0

#: The truth is known where its uncertainty is at most this share of it.
KNOWN = 0.1


class Estimate(NamedTuple):
    """What a run to a tolerance said, and the truth."""

    scene: int
    quantile: float
    tol: float
    method: str
    estimate: float
    true: float
    doubt: float  #: of the truth

    @property
    def right(self) -> bool:
        """Whether it is within the factor of the truth, both ways."""
        return 1.0 / FACTOR <= self.estimate / self.true <= FACTOR

    @property
    def known(self) -> bool:
        """Whether the truth is."""
        return self.doubt <= KNOWN * self.true

    @property
    def miss(self) -> str:
        """Whether the true error is above the tolerance, and the run says so; empty: it is not."""
        said = "misses `tol` and says so" if self.estimate > self.tol else "misses `tol` unsaid"
        return said if self.true > self.tol else ""

    @property
    def verdict(self) -> str:
        """What is to be said about it; empty where all is well."""
        words = "" if self.right else f"estimate too {'small' if self.estimate < self.true else 'large'}"
        return ", ".join(filter(None, (words, self.miss))) if self.known else "truth not known"


def random_case(rng: np.random.Generator, n: int) -> tuple[Scene, Floats, float, float]:
    """A scene, its starts, how long [s], and a tolerance.

    Masses, springs, damper and force differ by factors of 10 to 100 from case to case; a third slider, a
    damper and a decay may be missing; half of the cases start from rest, the others with rates like those
    of the vibrations.
    """
    m1, m2 = 10 ** rng.uniform(-0.5, 1.5, 2)
    m3, length = rng.choice([0.0, 10 ** rng.uniform(-0.5, 1.5)]), 10 ** rng.uniform(-0.5, 0.5)
    weight, rate = (m1 + m2) * 9.8, math.sqrt(9.8 / length)
    c1, c2 = weight / length * 10 ** rng.uniform(-1.0, 1.0, 2)
    beta = rng.choice([0.0, (m1 + m2) * rate * 10 ** rng.uniform(-1.0, 0.5)])
    force = 0.5 * weight * rng.normal()
    alpha = rng.choice([0.0, rate * 10 ** rng.uniform(-1.0, 0.3)])
    scene = Scene(m1=m1, m2=m2, m3=m3, l=length, c1=c1, c2=c2, beta=beta, F0=force, alpha=alpha)
    rates = rate * rng.normal(size=(n, 2)) * rng.choice([0.0, 1.0])
    starts = np.concatenate([rng.uniform(-np.pi, np.pi, (n, 2)), rates], axis=1)
    return scene, starts, rng.uniform(5.0, 20.0) / rate, 10 ** rng.uniform(-8.0, -3.0)


def estimates(scenes: int, n: int, advance: Callable[[int], None]) -> list[Estimate]:
    """Every quantile on every scene."""
    rng, found = np.random.default_rng(7), []
    for number in range(scenes):
        scene, starts, t_end, tol = random_case(rng, n)
        right, doubts = extended_truth(scene_rates(scene), starts, t_end)
        for quantile in QUANTILES:
            run = integrate(scene, starts, t_end, tol=tol, quantile=quantile, threads=1)
            errors = np.abs(run.y[-1] - right).max(axis=1)
            least, true, most = (order_statistic(errors + d, quantile) for d in (-doubts, 0.0, doubts))
            told, doubt = float(run.error_estimate or 0.0), max(most - true, true - least)
            found.append(Estimate(number, quantile, tol, run.method, told, true=true, doubt=doubt))
        advance(1)
    return found


def report(found: list[Estimate], n: int) -> list[str]:
    """The study as Markdown."""
    unknown, rows = sum(not e.known for e in found), []
    for quantile in QUANTILES:
        mine = [e for e in found if e.quantile == quantile]
        known = [e for e in mine if e.known]
        ratios = np.array([e.estimate / e.true for e in known] or [math.nan])
        told = [(e.right, not e.miss, "says so" in e.miss, "unsaid" in e.miss) for e in known]
        whose = "largest error" if quantile == 1.0 else f"{quantile:.0%} quantile"
        spread = (f"{ratio:.2g}" for ratio in (ratios.min(), np.median(ratios), ratios.max()))
        shares = (
            f"{share:.0%}"
            for share in np.sum(told or [(False, False, False, False)], axis=0) / max(len(known), 1)
        )
        rows.append([whose, f"{len(known)} of {len(mine)}", *shares, *spread])
    about = (
        f"{len(found) // len(QUANTILES)} random scenes of {n} trajectories each, tolerances from 1e-8 to "
        "1e-3; estimate of the error against the truth (extrapolation of order 18 in extended precision, "
        "each trajectory with its own steps, equations typed separately). Truth is "
        f"known where its uncertainty is at most {KNOWN:.0%} of it; {unknown or 'none'} of {len(found)} "
        f"{'is' if unknown == 1 else 'are'} not known, and not judged."
    )
    head = (
        f"whose error | truth known | estimate within a factor {FACTOR:g} | true error within `tol` | "
        "above it, and said so | above it, unsaid | least estimate/truth | median | greatest"
    )
    lines = section("# `tol` on random scenes", about, head, rows)
    odd = [
        f"{e.scene} | {e.quantile:g} | {e.method} | {e.tol:.1e} | {e.estimate:.1e} | {e.true:.1e} | "
        f"{e.doubt:.0e} | {e.verdict}"
        for e in found
        if e.verdict
    ]
    listed = "scene | quantile | method | `tol` | estimate | truth | its uncertainty | verdict"
    about = "Estimates beyond the factor, errors beyond the tolerance, truths that are not known:"
    return lines + (section("", about, listed, odd) if odd else [])


def tolerances_study(quick: bool, stage: Stage) -> list[str]:
    """``tolerances.md``."""
    scenes, n = (2, 16) if quick else (SCENES, STARTS)
    return report(estimates(scenes, n, stage("tolerances", scenes)), n)
