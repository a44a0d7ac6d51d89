"""``tol`` on random scenes: is its error estimate the truth?

The truth comes from an extrapolation method of its own in extended precision, with equations typed
separately (:mod:`fastmech.bench.extended`). Where it is doubtful, because a motion magnifies rounding, the
estimate is not judged.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from fastmech.arrays import Floats
from fastmech.bench.extended import extended_truth, scene_rates
from fastmech.ensembles.integrate import integrate
from fastmech.reports import Stage, table
from fastmech.scene import Scene

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
    def ratio(self) -> float:
        """Estimated over true."""
        return self.estimate / self.true

    @property
    def right(self) -> bool:
        """Whether it is within the factor, both ways."""
        return 1.0 / FACTOR <= self.ratio <= FACTOR

    @property
    def known(self) -> bool:
        """Whether the truth is."""
        return self.doubt <= KNOWN * self.true

    @property
    def missed(self) -> bool:
        """Whether the true error is above the tolerance."""
        return self.true > self.tol

    @property
    def said(self) -> bool:
        """Whether the run says that it has missed the tolerance."""
        return self.estimate > self.tol

    @property
    def verdict(self) -> str:
        """What is to be said about it; empty where all is well."""
        if not self.known:
            return "truth not known"
        words = [] if self.right else ["estimate too small" if self.ratio < 1.0 else "estimate too large"]
        if self.missed:
            words.append("misses `tol` and says so" if self.said else "misses `tol` unsaid")
        return ", ".join(words)


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


def estimates(scenes: int, n: int, advance: Callable[[int], None], seed: int = 7) -> list[Estimate]:
    """Every quantile on every scene."""
    rng, found = np.random.default_rng(seed), []
    for number in range(scenes):
        scene, starts, t_end, tol = random_case(rng, n)
        right, doubts = extended_truth(scene_rates(scene), starts, t_end)
        for quantile in QUANTILES:
            run = integrate(scene, starts, t_end, tol=tol, quantile=quantile, threads=1)
            estimate = float(run.error_estimate or 0.0)
            true, doubt = _true(right, doubts, quantile, run.y[-1])
            found.append(Estimate(number, quantile, tol, run.method, estimate, true, doubt))
        advance(1)
    return found


def _true(right: Floats, doubts: Floats, quantile: float, end: Floats) -> tuple[float, float]:
    """A quantile's true error and its uncertainty, of a run that ends so (n, 4)."""
    rank, errors = math.ceil(quantile * len(end)) - 1, np.abs(end - right).max(axis=1)
    least, true, most = (float(np.sort(e)[rank]) for e in (errors - doubts, errors, errors + doubts))
    return true, max(most - true, true - least)


def report(found: list[Estimate], n: int) -> list[str]:
    """The study as Markdown."""
    unknown = sum(not e.known for e in found)
    lines = [
        "# `tol` on random scenes",
        "",
        f"{len(found) // len(QUANTILES)} random scenes of {n} trajectories each, tolerances from 1e-8 to "
        "1e-3; estimate of the error against the truth (extrapolation of order 18 in extended precision, "
        "each trajectory with its own steps, equations typed separately). Truth is "
        f"known where its uncertainty is at most {KNOWN:.0%} of it; {unknown or 'none'} of {len(found)} "
        f"{'is' if unknown == 1 else 'are'} not known, and not judged.",
        "",
    ]
    rows = []
    for quantile in QUANTILES:
        mine = [e for e in found if e.quantile == quantile]
        known = [e for e in mine if e.known]
        ratios = np.array([e.ratio for e in known] or [math.nan])
        shares = (
            [e.right for e in known],
            [not e.missed for e in known],
            [e.missed and e.said for e in known],
            [e.missed and not e.said for e in known],
        )
        whose = "largest error" if quantile == 1.0 else f"{quantile:.0%} quantile"
        told = " | ".join(f"{sum(which) / max(len(known), 1):.0%}" for which in shares)
        spread = f"{ratios.min():.2g} | {np.median(ratios):.2g} | {ratios.max():.2g}"
        rows.append(f"{whose} | {len(known)} of {len(mine)} | {told} | {spread}")
    lines += table(
        f"whose error | truth known | estimate within a factor {FACTOR:g} | true error within `tol` | "
        "above it, and said so | above it, unsaid | least estimate/truth | median | greatest",
        rows,
    )
    odd = [e for e in found if e.verdict]
    if odd:
        lines += ["Estimates beyond the factor, errors beyond the tolerance, truths that are not known:", ""]
        lines += table(
            "scene | quantile | method | `tol` | estimate | truth | its uncertainty | verdict",
            (
                f"{e.scene} | {e.quantile:g} | {e.method} | {e.tol:.1e} | {e.estimate:.1e} | {e.true:.1e} | "
                f"{e.doubt:.0e} | {e.verdict}"
                for e in odd
            ),
        )
    return lines


def tolerances_study(quick: bool, stage: Stage, scenes: int = SCENES, starts: int = STARTS) -> list[str]:
    """``tolerances.md``."""
    scenes, n = (2, 16) if quick else (scenes, starts)
    return report(estimates(scenes, n, stage("tolerances", scenes)), n)
