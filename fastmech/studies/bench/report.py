"""``fastmech bench``: runs every entrant on every problem and writes table, picture and data."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from importlib import metadata
from pathlib import Path

import numpy as np

from fastmech.ensembles.run import Progress
from fastmech.ensembles.threads import thread_count
from fastmech.reports import Stage, no_stage
from fastmech.results import Dataset, Variable
from fastmech.scene import Scene
from fastmech.store.provenance import processor_name
from fastmech.store.write import check_writable
from fastmech.studies.bench import tables
from fastmech.studies.bench.atlas import atlas_study
from fastmech.studies.bench.attractors import attractors_study
from fastmech.studies.bench.basins import basins_study
from fastmech.studies.bench.entrants import LIBRARIES, entrants, installed
from fastmech.studies.bench.machine import costs, throughputs
from fastmech.studies.bench.measure import BUDGET, PROBLEMS, BenchProblem, Entrant, Row, measure
from fastmech.studies.bench.processes import footprints, started, vectors_study
from fastmech.studies.bench.proofs import proofs_study
from fastmech.studies.bench.stiff import stiff_study
from fastmech.studies.bench.systems import systems_study
from fastmech.studies.bench.tables import draw_bench
from fastmech.studies.bench.threads import threads_study
from fastmech.studies.bench.tolerances import tolerances_study
from fastmech.studies.reporting import columns, write_data, write_text

#: Of ``--quick``: starts that have a reference, what each entrant is given [s], and trajectories a call of
#: the engine and its yardstick: on fewer than those not the loops would be compared but what is around them.
QUICK_STARTS, QUICK_BUDGET, QUICK_LEAST = 8, 0.05, 8192

VERSIONS = ("numba", "scipy", "heyoka", "torch", "jax", "diffrax", "numbalsoda", "CyRK", "pynamicalsys")

#: Studies with a file of their own, by name: from `quick` and a stage to the lines of Markdown.
STUDIES: dict[str, Callable[..., list[str]]] = {
    "atlas": atlas_study,
    "attractors": attractors_study,
    "basins": basins_study,
    "proofs": proofs_study,
    "stiff": stiff_study,
    "systems": systems_study,
    "threads": threads_study,
    "tolerances": tolerances_study,
    "vectors": vectors_study,
}


def run_study(name: str, out: Path, *, quick: bool = False, stage: Stage = no_stage, **chosen: int) -> Path:
    """Measure and write a study's ``NAME.md`` into the folder ``out``; ``chosen`` are its own settings."""
    return write_text(out / f"{name}.md", STUDIES[name](quick, stage, **chosen))


def run_bench(out: Path, *, quick: bool = False, stage: Stage = no_stage) -> list[Path]:
    """Measure and write ``bench.md``, ``bench.png`` and ``bench.h5`` into the folder ``out``.

    ``quick`` takes few trajectories, every third setting and no libraries beyond SciPy: for trying the
    command, not for quoting.
    """
    data, picture = out / "bench.h5", out / "bench.png"
    check_writable(data, replace=True)
    began = time.perf_counter()
    problems = [make(QUICK_STARTS) if quick else make() for make in PROBLEMS.values()]
    rows: list[Row] = []
    failures: list[str] = []
    for problem in problems:
        found = [enlarged(entrant) if quick else entrant for entrant in entrants(problem, quick)]
        advance = stage(f"{problem.name}: prepare and time", 2 * len(found))

        def failed(entrant: Entrant, error: Exception, advance: Progress = advance) -> None:
            failures.append(f"{entrant.family}, {entrant.setting}: {type(error).__name__}: {error}")
            advance(1)

        rows += measure(problem, found, advance, failed, QUICK_BUDGET if quick else BUDGET)
    peak, rhs = throughputs(problems[0], stage)
    prices = costs(problems[0], stage)
    starts = [] if quick else list(started(stage))
    memory = [] if quick else footprints(stage)
    lines = _preamble(quick, failures)
    for problem in problems:
        lines += tables.problem_section(problem, rows)
    lines += tables.machine_sections(peak, rhs, prices, starts, memory)
    table = write_text(out / "bench.md", lines)
    draw_bench(rows, picture)
    fused = Variable((), np.array(peak), "1/s", "fused multiply-adds of doubles of one core, measured")
    sections = {
        "speed": speed_dataset(rows, problems),
        "rhs": Dataset({"peak": fused} | columns("place", rhs, "rhs")),
        "terms": Dataset(columns("kind", prices, "terms")),
    }
    if starts:
        sections["starts"] = Dataset(columns("entrant", starts, "starts"))
    write_data(data, Scene(alpha=0.0), sections, began, title="Speed against error")
    return [table, picture, data, *(run_study(name, out, quick=quick, stage=stage) for name in STUDIES)]


def enlarged(entrant: Entrant) -> Entrant:
    """An entrant of ``--quick``, with enough trajectories where its loop is compared with another's."""
    compared = entrant.family.removeprefix("fastmech ").removeprefix("hand-fused ") in ("rk4", "dop853")
    return entrant._replace(least=max(entrant.least, QUICK_LEAST)) if compared else entrant


def _preamble(quick: bool, failures: list[str]) -> list[str]:
    """What was measured, how, and on what."""
    versions = []
    for library in VERSIONS:
        try:
            versions.append(f"{library} {metadata.version(library)}")
        except metadata.PackageNotFoundError:
            continue
    load = f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "unknown"
    missing = [name for name in LIBRARIES if name not in installed()]
    return [
        "# Speed against error",
        "",
        *(["**A quick run: few trajectories, few settings. Not for quoting.**", ""] if quick else []),
        f"{processor_name()}, {thread_count(None)} cores, load {load} at the end. {', '.join(versions)}.",
        "",
        "Everyone solves the same problems: Table 1 with its force constant. Errors are the largest and the "
        "median over trajectories of the largest component of a final state's error, against a reference of "
        "24 digits (`data/make_bench_reference.py`). All are prepared and warmed up first and then timed in "
        "turns; rates are medians per second of processor time, on a quiet machine wall time.",
        "",
        *([f"Not installed: {', '.join(missing)}.", ""] if missing else []),
        *(["Failed:", "", *(f"- {failure}" for failure in failures), ""] if failures else []),
    ]


def speed_dataset(rows: list[Row], problems: list[BenchProblem]) -> Dataset:
    """Every row with the error of each of its trajectories, NaN where it was not given one."""
    errors = np.full((len(rows), max(len(problem.starts) for problem in problems)), np.nan)
    for line, row in zip(errors, rows, strict=True):
        line[: row.errors.size] = row.errors
    worst = "of the worst component of a final state in rad and rad/s"
    each = {"error": Variable(("row", "trajectory"), errors, "1", f"error, {worst}")}
    return Dataset(columns("row", rows, "speed") | each)
