"""``tol`` on random scenes: is its error estimate the truth?

The truth comes from an extrapolation method of its own with equations typed separately, see
:mod:`fastmech.bench.extrapolation`; two runs of it tell how far it can be trusted.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fastmech.bench.extrapolation import truth
from fastmech.bench.tables import table
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.run import Progress
from fastmech.scene import Scene

Floats = NDArray[np.float64]

#: Scenes, and trajectories of each: more than the sample of the calibration.
SCENES, STARTS = 40, 512

QUANTILES = (0.5, 0.99, 1.0)

#: An estimate is right within this factor, both ways.
FACTOR = 3.0


@dataclass(frozen=True)
class Estimate:
    """What a run to a tolerance said, and the truth."""

    scene: int
    quantile: float
    tol: float
    method: str
    estimate: float
    true: float
    doubt: float  #: of the truth: the same quantile of its uncertainties
    seconds: float

    @property
    def ratio(self) -> float:
        """Estimated over true."""
        return self.estimate / self.true

    @property
    def right(self) -> bool:
        """Whether it is within the factor, both ways."""
        return 1.0 / FACTOR <= self.ratio <= FACTOR


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
    scene = Scene(
        m1=m1,
        m2=m2,
        m3=m3,
        l=length,
        c1=c1,
        c2=c2,
        beta=rng.choice([0.0, (m1 + m2) * rate * 10 ** rng.uniform(-1.0, 0.5)]),
        F0=0.5 * weight * rng.normal(),
        alpha=rng.choice([0.0, rate * 10 ** rng.uniform(-1.0, 0.3)]),
    )
    rates = rate * rng.normal(size=(n, 2)) * rng.choice([0.0, 1.0])
    starts = np.concatenate([rng.uniform(-np.pi, np.pi, (n, 2)), rates], axis=1)
    return scene, starts, rng.uniform(5.0, 20.0) / rate, 10 ** rng.uniform(-8.0, -3.0)


def estimates(scenes: int, n: int, advance: Callable[[int], None], seed: int = 7) -> list[Estimate]:
    """Every quantile on every scene."""
    rng, found = np.random.default_rng(seed), []
    for number in range(scenes):
        scene, starts, t_end, tol = random_case(rng, n)
        right, doubts = truth(scene, starts, t_end)
        for quantile in QUANTILES:
            began = time.perf_counter()
            run = integrate(scene, starts, t_end, tol=tol, quantile=quantile, threads=1)
            seconds = time.perf_counter() - began
            errors = np.sort(np.abs(run.y[-1] - right).max(axis=1))
            true = float(errors[math.ceil(quantile * n) - 1])
            found.append(
                Estimate(
                    scene=number,
                    quantile=quantile,
                    tol=tol,
                    method=run.method,
                    estimate=float(run.error_estimate or 0.0),
                    true=true,
                    doubt=float(np.sort(doubts)[math.ceil(quantile * n) - 1]),
                    seconds=seconds,
                )
            )
        advance(1)
    return found


def report(found: list[Estimate], n: int) -> list[str]:
    """The study as Markdown."""
    lines = [
        "# `tol` on random scenes",
        "",
        f"{len(found) // len(QUANTILES)} random scenes of {n} trajectories each, tolerances from 1e-8 to "
        "1e-3; estimate of the error against the truth (extrapolation of order 14, each "
        "trajectory with its own steps, equations typed separately). The truth's own uncertainty is at most "
        f"{max(e.doubt / e.true for e in found):.1g} of the error that it judges.",
        "",
    ]
    rows = []
    for quantile in QUANTILES:
        mine = [e for e in found if e.quantile == quantile]
        ratios = np.array([e.ratio for e in mine])
        rows.append(
            [
                "largest error" if quantile == 1.0 else f"{quantile:.0%} quantile",
                f"{np.mean([e.right for e in mine]):.0%}",
                f"{np.mean([e.true <= e.tol for e in mine]):.0%}",
                f"{ratios.min():.2g}",
                f"{np.median(ratios):.2g}",
                f"{ratios.max():.2g}",
            ]
        )
    head = ["whose error", f"estimate within a factor {FACTOR:g}", "true error within `tol`",
            "least estimate/truth", "median", "greatest"]  # fmt: skip
    lines += table(head, rows)
    wrong = [e for e in found if not e.right or e.true > e.tol]
    if wrong:
        lines += ["Estimates beyond the factor, and errors beyond the tolerance:", ""]
        lines += table(
            ["scene", "quantile", "method", "`tol`", "estimate", "truth", "its uncertainty"],
            (
                [
                    str(e.scene),
                    f"{e.quantile:g}",
                    e.method,
                    f"{e.tol:.1e}",
                    f"{e.estimate:.1e}",
                    f"{e.true:.1e}",
                    f"{e.doubt:.0e}",
                ]
                for e in wrong
            ),
        )
    return lines


def run_tolerances(
    out: Path,
    *,
    quick: bool = False,
    stage: Callable[[str, int], Progress] = lambda name, total: lambda done: None,
    scenes: int = SCENES,
) -> list[Path]:
    """Measure and write ``tolerances.md`` into the folder ``out``."""
    scenes, n = (2, 16) if quick else (scenes, STARTS)
    found = estimates(scenes, n, stage("tolerances", scenes))
    out.mkdir(parents=True, exist_ok=True)
    path = out / "tolerances.md"
    path.write_text("\n".join(report(found, n)) + "\n", encoding="utf-8")
    return [path]
