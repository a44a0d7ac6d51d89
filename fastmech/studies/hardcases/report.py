"""``fastmech hardcases``: the gallery's table, result file and pictures, and what failing lanes cost others.

That is the throughput of the trajectories that do not fail over theirs in the same ensemble where nobody
fails: the time without failures over the time with them. It passes 1 where lanes that have failed have left.
"""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fastmech.arrays import Floats
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.run import Progress
from fastmech.ensembles.status import Status
from fastmech.ensembles.system import System
from fastmech.errors import StepWarning
from fastmech.integrators.methods import METHODS
from fastmech.plots.style import save
from fastmech.reports import Stage, no_stage, table
from fastmech.results import Dataset, Variable
from fastmech.scene import Scene
from fastmech.slider.equilibria import Equilibrium, find_equilibria
from fastmech.slider.linearize import jacobian
from fastmech.step_limits.warning import largest_stable_step
from fastmech.store.write import check_writable
from fastmech.studies.hardcases.cases import CASES, PAPER
from fastmech.studies.hardcases.limits import (
    Limits,
    imaginary_limit,
    measured_stable_step,
    real_limit,
    stability_pages,
)
from fastmech.studies.hardcases.walk import CaseRow, HardCase
from fastmech.studies.reporting import columns, in_turns, section, write_data, write_text

#: Methods that are measured, explicit, multistep and implicit ones, with the step [s].
CONTAINED = {"rk4": 0.01, "dop853": 0.02, "ab6": 0.005, "abm8": 0.01, "gauss6": 0.05, "sdirk4": 0.02}

#: Lengths of the runs [s], and those of the quick version.
SPANS, QUICK_SPANS = (5.0, 20.0, 100.0), (2.0,)

#: When trajectories fail: the mechanism's at once, the system's about these shares of the run's length.
WHEN = {"in the first step": 0.0, "after 10 %": 0.1, "after 85 %": 0.85}

#: Trajectories, one in how many fails, and runs of each kind, in turn, after one that does not count.
NUMBER, ONE_IN, REPETITIONS = 4096, 16, 3


def pendulums(
    t: float, phi: float, omega: float, psi: float, rate: float, y: float
) -> tuple[float, float, float, float, float]:
    """Two coupled pendulums, and y' = y^2, which is infinite at t = 1/y(0)."""
    first = -math.sin(phi) - 0.1 * omega
    return omega, first, rate, 0.2 * math.sin(phi) - math.sin(psi) - 0.1 * rate, y * y


def ensembles(when: float, span: float) -> tuple[Scene | System, Floats, Floats]:
    """What is integrated, starts without failures, and the same where every sixteenth fails.

    They fail in the first step, or spread over a tenth around the share ``when`` of ``span`` [s].
    """
    random, failing = np.random.default_rng(1), np.arange(0, NUMBER, ONE_IN)
    if when == 0.0:
        starts = random.uniform([-2, -2, -3, -3], [2, 2, 3, 3], (NUMBER, 4))
        mixed = starts.copy()
        mixed[failing, 2] = 1e200
        return PAPER, starts, mixed
    starts = random.uniform(-2.0, 2.0, (NUMBER, 5))
    starts[:, 4] = -1.0
    mixed = starts.copy()
    mixed[failing, 4] = 1.0 / (when * span * np.linspace(0.95, 1.05, failing.size))
    return System(pendulums, ["phi", "omega", "psi", "rate", "y"], {}), starts, mixed


class Beside(NamedTuple):
    """How trajectories fare beside failing ones."""

    method: str
    when: str  #: when the others fail
    span: float  #: length of the run [s]
    share: float  #: of their throughput that is left
    failed: int  #: trajectories with a status that is not OK
    same: bool  #: whether the rest is the same to the bit

    @property
    def contained(self) -> bool:
        """Whether those that fail, and nobody else, have a status, and the rest is the same to the bit."""
        return self.same and self.failed == NUMBER // ONE_IN


def _beside(method: str, when: str, span: float, repetitions: int) -> Beside:
    what, *both = ensembles(WHEN[when], span)
    run = partial(integrate, what, t_end=span, dt=CONTAINED[method], method=method, threads=1)
    seconds, runs = in_turns({k: partial(run, y0=y) for k, y in enumerate(both)}, repetitions)
    least = np.finfo(np.float64).tiny
    share = np.median([one / max(other, least) for one, other in zip(*seconds.values(), strict=True)])
    healthy = np.flatnonzero(np.arange(NUMBER) % ONE_IN)
    same = np.array_equal(runs[0].y[:, healthy], runs[1].y[:, healthy], equal_nan=True)
    return Beside(method, when, span, float(share), int((runs[1].status != Status.OK).sum()), same=same)


def containment(quick: bool, progress: Progress) -> list[Beside]:
    """Healthy trajectories by method, time of failure and span."""
    found = []
    for method in CONTAINED:
        for when, span in product(WHEN, QUICK_SPANS if quick else SPANS):
            found.append(_beside(method, when, span, 1 if quick else REPETITIONS))
        progress(1)
    return found


def _containment_lines(found: Sequence[Beside]) -> list[str]:
    about = (
        f"{NUMBER // ONE_IN} of {NUMBER} trajectories fail: throughput of the rest over that in the same run "
        "without failures. At least 0.9 is wanted; above 1 those that failed have made room. Processor time "
        "of one thread, median of runs in turn. Failing trajectories have a status and the rest is the same "
        f"to the bit: {'yes' if all(one.contained for one in found) else 'NO'}."
    )
    columns = dict.fromkeys(f"{one.when}, {one.span:g} s" for one in found)
    cells = ([m, *(f"{one.share:.2f}" for one in found if one.method == m)] for m in CONTAINED)
    return section("## Failing neighbours", about, ["method", *columns], cells)


#: A case and its rows.
CaseResult = tuple[HardCase, Sequence[CaseRow]]


def gallery_dataset(results: Sequence[CaseResult]) -> Dataset:
    """One row a case and method."""
    rows = [row for _, rows in results for row in rows]
    names = np.array([case.name for case, rows in results for _ in rows], object)
    case = {"case": Variable(("row",), names, "1", "case")}
    return Dataset(case | columns("row", rows, "gallery"), {"failures": sum(not row.passed for row in rows)})


def failed(results: Sequence[CaseResult]) -> list[str]:
    """Names of the cases of which a row did not what it must."""
    return [case.name for case, rows in results if not all(row.passed for row in rows)]


def verdict(results: Sequence[CaseResult]) -> str:
    """One line: how many cases passed, and which did not."""
    wrong, rows = failed(results), [row for _, rows in results for row in rows]
    if wrong:
        return f"{len(wrong)} of {len(results)} cases failed: {', '.join(wrong)}"
    claims = sum(row.claimed for row in rows)
    told = f"{claims} claims hold, {len(rows) - claims} end with a status" if len(rows) > 1 else "1 row"
    return f"all {len(results)} cases passed ({told})"


_INTRODUCTION = (
    "A method claims a case to an error, at a step that the package lets pass without a warning; the oracle "
    "says whether the claim holds. Where the claim is its own, it comes from the method alone: twice what "
    "halving the step tells. A method that claims nothing must end with a status, not with a number."
)


def gallery_lines(results: Sequence[CaseResult]) -> list[str]:
    """Every case with its table."""
    head = "method | step [s] | steps | error | claimed to | drift | status | verdict | why | remark"
    lines = ["# Hard cases", "", f"{verdict(results).capitalize()}.", "", _INTRODUCTION, ""]
    wrong = failed(results)
    for case, rows in results:
        lines += [f"## {case.name}: {'FAILED' if case.name in wrong else 'passed'}", ""]
        lines += [f"Hard: {case.hard}.  ", f"Oracle: {case.oracle}.  ", f"Must: {case.must}.", ""]
        lines += table(head, map(_cells, rows), (0, 6, 7, 8, 9))
    return lines


def _cells(row: CaseRow) -> list[object]:
    step = "" if np.isnan(row.dt) else f"{row.dt:.3g}"
    numbers = ("" if np.isnan(value) else f"{value:.1e}" for value in (row.error, row.allowed, row.drift))
    error, allowed, drift = numbers
    told = error, allowed or "not claimed", drift, row.status, row.verdict, row.why, row.remark
    return [row.method, step, f"{row.steps:,}", *told]


DATA = "hardcases.h5"


class Report(NamedTuple):
    """What was written, and how the gallery ended."""

    paths: list[Path]
    verdict: str
    passed: bool


def write_hardcases(out: Path, *, quick: bool = False, stage: Stage = no_stage) -> Report:
    """Run the gallery and write ``hardcases.md``, ``hardcases.h5`` and pictures into the folder ``out``.

    Raises:
        InputError: the folder cannot be written.
    """
    began = time.perf_counter()
    check_writable(out / DATA, replace=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", StepWarning)  # steps that are too long are what some cases are about
        results, advance = list[CaseResult](), stage("hard cases", len(CASES))
        for case in CASES.values():
            results.append((case, case.run(quick)))
            advance(1)
        minimum = next(e for e in find_equilibria(PAPER) if e.morse_index == 0)
        limits = _limits(minimum, stage("step limits", len(METHODS)))
        beside = containment(quick, stage("failing neighbours", len(CONTAINED)))
        values = np.linalg.eigvals(jacobian(PAPER, minimum)).astype(np.complex128)
        pictures = stability_pages(limits, values[values.real <= 0.0])  # those that decay scale a region
    told, passed = verdict(results), not failed(results)
    if not all(one.contained for one in beside):
        told, passed = f"{told}; failing trajectories are not contained", False
    lines = [*gallery_lines(results), *_limits_lines(limits), *_containment_lines(beside)]
    sections = {
        "gallery": gallery_dataset(results),
        "step_limits": Dataset(columns("method", limits, "step_limits")),
        "containment": Dataset(columns("row", beside, "containment")),
    }
    text = write_text(out / "hardcases.md", lines)
    store = write_data(out / DATA, PAPER, sections, began, title="Hard cases", verdict=told)
    for name, figure in pictures.items():
        save(figure, out / f"{name}.png")
    return Report([text, store, *(out / f"{name}.png" for name in pictures)], told, passed)


def _limits(minimum: Equilibrium, advance: Progress) -> list[Limits]:
    """Axis limits of every method, and at the scene's minimum the step predicted and measured."""
    rows = []
    for name, method in METHODS.items():
        steps = largest_stable_step(PAPER, minimum, name), measured_stable_step(PAPER, minimum, name)
        rows.append(Limits(name, real_limit(method), imaginary_limit(method), *steps))
        advance(1)
    return rows


def _limits_lines(limits: Sequence[Limits]) -> list[str]:
    head = "method | real axis | imaginary axis | predicted step [s] | measured step [s] | difference"
    rows = (
        f"{name} | {real:.4f} | {imaginary:.4f} | {predicted:.5f} | {measured:.5f} | "
        + (f"{measured / predicted - 1:+.1e}" if np.isfinite(predicted) else "")
        for name, real, imaginary, predicted, measured in limits
    )
    about = "At the minimum of Table 1 under the constant force."
    return section("## Step limits", about, head, rows)
