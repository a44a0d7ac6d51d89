"""``fastmech bench``: runs every entrant on every problem and writes table, picture and data."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from fastmech.ensembles.threads import thread_count
from fastmech.reports import Stage, no_stage
from fastmech.results import Dataset, Variable
from fastmech.scene import Scene
from fastmech.store.provenance import processor_name
from fastmech.store.write import check_writable
from fastmech.studies.bench.atlas import atlas_study
from fastmech.studies.bench.attractors import attractors_study
from fastmech.studies.bench.basins import basins_study
from fastmech.studies.bench.entrants import LIBRARIES, entrants, installed
from fastmech.studies.bench.machine import rhs_section, terms_section
from fastmech.studies.bench.measure import BUDGET, PROBLEMS, Entrant, Row, measure
from fastmech.studies.bench.processes import memory_section, starts_section, vectors_study
from fastmech.studies.bench.proofs import proofs_study
from fastmech.studies.bench.stiff import stiff_study
from fastmech.studies.bench.systems import systems_study
from fastmech.studies.bench.tables import draw_bench, problem_section
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
    rows, failures, lines = list[Row](), list[str](), list[str]()
    for problem in problems:
        found = [enlarged(entrant) if quick else entrant for entrant in entrants(problem, quick)]
        advance = stage(f"{problem.name}: prepare and time", 2 * len(found))
        mine, broken = measure(problem, found, advance, QUICK_BUDGET if quick else BUDGET)
        failures += [f"- {e.family}, {e.setting}: {type(why).__name__}: {why}" for e, why in broken]
        lines += problem_section(problem, mine)
        rows += mine
    errors = np.full((len(rows), max(len(problem.starts) for problem in problems)), np.nan)
    for line, row in zip(errors, rows, strict=True):
        line[: row.errors.size] = row.errors  # NaN of trajectories that it was not given
    worst = "of the worst component of a final state in rad and rad/s"
    each = {"error": Variable(("row", "trajectory"), errors, "1", f"error, {worst}")}
    sections = {"speed": Dataset(columns("row", rows, "speed") | each)}
    parts = {"rhs": rhs_section(problems[0], stage), "terms": terms_section(problems[0], stage)}
    if not quick:
        parts["starts"] = starts_section(stage)
    for name, (told, dataset) in parts.items():
        lines += told
        sections[name] = dataset
    lines += [] if quick else memory_section(stage)
    table = write_text(out / "bench.md", [*_preamble(quick, failures), *lines])
    draw_bench(rows, picture)
    write_data(data, Scene(alpha=0.0), sections, began, title="Speed against error")
    return [table, picture, data, *(run_study(name, out, quick=quick, stage=stage) for name in STUDIES)]


def enlarged(entrant: Entrant) -> Entrant:
    """An entrant of ``--quick``, with enough trajectories where its loop is compared with another's."""
    compared = entrant.family.removeprefix("fastmech ").removeprefix("hand-fused ") in ("rk4", "dop853")
    return entrant._replace(least=max(entrant.least, QUICK_LEAST)) if compared else entrant


def _preamble(quick: bool, failures: list[str]) -> list[str]:
    """What was measured, how, and on what."""
    versions = [f"{name} {metadata.version(name)}" for name in VERSIONS if find_spec(name) is not None]
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
        *(["Failed:", "", *failures, ""] if failures else []),
    ]
