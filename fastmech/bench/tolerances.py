"""``tol`` on random scenes: is its error estimate the truth?

The truth comes from SciPy's DOP853 at 1e-13 with equations typed separately.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from fastmech.bench.plain import accelerations
from fastmech.bench.tables import table
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.run import Progress
from fastmech.jit import FLAGS
from fastmech.mechanism.coefficients import reduce
from fastmech.scene import Scene

Floats = NDArray[np.float64]

#: Scenes, and trajectories of each: more than the sample of the calibration.
SCENES, STARTS = 40, 512

QUANTILES = (0.5, 0.99, 1.0)

#: An estimate is right within this factor, both ways.
FACTOR = 3.0

TRUTH = 1e-13


@dataclass(frozen=True)
class Estimate:
    """What a run to a tolerance said, and the truth."""

    scene: int
    quantile: float
    tol: float
    method: str
    estimate: float
    true: float
    seconds: float

    @property
    def ratio(self) -> float:
        """Estimated over true."""
        return self.estimate / self.true

    @property
    def right(self) -> bool:
        """Whether it is within the factor, both ways."""
        return 1.0 / FACTOR <= self.ratio <= FACTOR


@njit(nogil=True, **FLAGS)  # type: ignore[untyped-decorator]
def _rates(t: float, flat: Floats, p: Floats) -> Floats:
    """Derivatives of all trajectories at once."""
    now = p.copy()
    now[5] *= np.exp(-p[7] * t)
    out = np.empty_like(flat)
    for i in range(flat.size // 4):
        j = 4 * i
        out[j], out[j + 1] = flat[j + 2], flat[j + 3]
        out[j + 2], out[j + 3] = accelerations(flat[j], flat[j + 1], flat[j + 2], flat[j + 3], now)
    return out


def truth(scene: Scene, starts: Floats, t_end: float) -> Floats:
    """Final states (n, 4)."""
    found: Any = solve_ivp(
        _rates,
        (0.0, t_end),
        starts.ravel(),
        "DOP853",
        args=(np.array(reduce(scene)),),
        rtol=TRUTH,
        atol=TRUTH,
    )
    return np.asarray(found.y[:, -1]).reshape(starts.shape)


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
        right = truth(scene, starts, t_end)
        for quantile in QUANTILES:
            began = time.perf_counter()
            run = integrate(scene, starts, t_end, tol=tol, quantile=quantile, threads=1)
            seconds = time.perf_counter() - began
            errors = np.sort(np.abs(run.y[-1] - right).max(axis=1))
            true = float(errors[math.ceil(quantile * n) - 1])
            found.append(
                Estimate(number, quantile, tol, run.method, float(run.error_estimate or 0.0), true, seconds)
            )
        advance(1)
    return found


def report(found: list[Estimate], n: int) -> list[str]:
    """The study as Markdown."""
    lines = [
        "# `tol` on random scenes",
        "",
        f"{len(found) // len(QUANTILES)} random scenes of {n} trajectories each, tolerances from 1e-8 to "
        "1e-3; estimate of the error against the truth (SciPy DOP853 at 1e-13, equations typed separately).",
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
            ["scene", "quantile", "method", "`tol`", "estimate", "truth"],
            (
                [
                    str(e.scene),
                    f"{e.quantile:g}",
                    e.method,
                    f"{e.tol:.1e}",
                    f"{e.estimate:.1e}",
                    f"{e.true:.1e}",
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
