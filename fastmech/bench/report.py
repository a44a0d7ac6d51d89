"""``fastmech bench``: runs every entrant on every problem and writes table, picture and data."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import replace
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from fastmech.bench import tables
from fastmech.bench.atlas import run_atlas
from fastmech.bench.basins import run_basins
from fastmech.bench.entrant import Entrant
from fastmech.bench.entrants import entrants, missing
from fastmech.bench.fused import METHODS
from fastmech.bench.measure import BUDGET, Row, measure
from fastmech.bench.memory import TRAJECTORIES, footprints
from fastmech.bench.peak import TURNS as PEAK_TURNS
from fastmech.bench.peak import Throughput, throughputs
from fastmech.bench.picture import draw_bench
from fastmech.bench.problem import PROBLEMS, Problem
from fastmech.bench.startup import STARTED, Start, started
from fastmech.bench.stiff import run_stiff
from fastmech.bench.systems import run_systems
from fastmech.bench.terms import TURNS, Cost, costs
from fastmech.bench.threads import run_threads
from fastmech.bench.tolerances import run_tolerances
from fastmech.bench.vectors import run_vectors
from fastmech.ensembles.run import Progress
from fastmech.ensembles.threads import thread_count
from fastmech.results import Dataset, Variable
from fastmech.store.provenance import processor_name, provenance
from fastmech.store.write import check_writable, write_results

#: Starts of ``--quick``, of those that have a reference.
QUICK_STARTS = 8

#: What ``--quick`` gives each entrant [s].
QUICK_BUDGET = 0.05

#: Trajectories a call of the engine and its yardstick with ``--quick``: they take milliseconds, and on fewer
#: not the loops but what stands around a call would be compared.
QUICK_LEAST = 8192

LIBRARIES = ("numba", "scipy", "heyoka", "torch", "jax", "diffrax", "numbalsoda", "CyRK", "pynamicalsys")


#: Studies with a file of their own, by name.
STUDIES: dict[str, Callable[..., list[Path]]] = {
    "atlas": run_atlas,
    "basins": run_basins,
    "stiff": run_stiff,
    "systems": run_systems,
    "threads": run_threads,
    "tolerances": run_tolerances,
    "vectors": run_vectors,
}


def run_bench(
    out: Path,
    *,
    quick: bool = False,
    stage: Callable[[str, int], Progress] = lambda name, total: lambda done: None,
) -> list[Path]:
    """Measure and write ``bench.md``, ``bench.png`` and ``bench.h5`` into the folder ``out``.

    ``quick`` takes few trajectories, every third setting and no libraries beyond SciPy: for trying the
    command, not for quoting.
    """
    data = out / "bench.h5"
    check_writable(data, replace=True)
    began = time.perf_counter()
    problems = [make(QUICK_STARTS) if quick else make() for make in PROBLEMS.values()]
    rows: list[Row] = []
    failures: list[str] = []
    for problem in problems:
        found = [enlarged(entrant) if quick else entrant for entrant in entrants(problem, quick)]
        everyone = [(entrant, n) for entrant in found for n in _threads(entrant)]
        advance = stage(f"{problem.name}: prepare and time", 2 * len(everyone))

        def failed(entrant: Entrant, error: Exception, advance: Progress = advance) -> None:
            failures.append(f"{entrant.family}, {entrant.setting}: {type(error).__name__}: {error}")
            advance(1)

        rows += measure(problem, everyone, advance, failed, QUICK_BUDGET if quick else BUDGET)
    peak, rhs = throughputs(problems[0], stage("right-hand sides", PEAK_TURNS))
    prices = costs(problems[0], stage("terms", TURNS))
    starts = [] if quick else list(started(stage("cold starts", len(STARTED))))
    memory = [] if quick else footprints(stage("memory", len(TRAJECTORIES)))
    table, picture = out / "bench.md", out / "bench.png"
    lines = _preamble(quick, failures)
    for problem in problems:
        lines += tables.problem_section(problem, rows)
    lines += tables.machine_sections(peak, rhs, prices, starts, memory)
    table.write_text("\n".join(lines) + "\n", encoding="utf-8")
    draw_bench(rows, picture)
    write_results(
        data,
        scene_parameters={
            name: Variable((), np.array(value), unit, about)
            for name, (value, unit, about) in problems[0].scene.described().items()
        },
        sections={
            "speed": speed_dataset(rows, problems),
            "rhs": throughput_dataset(peak, rhs),
            "terms": cost_dataset(prices),
        }
        | ({"starts": start_dataset(starts)} if starts else {}),
        attrs={"title": "Speed against error", "wall_time_s": time.perf_counter() - began}
        | provenance(thread_count(None)),
        replace=True,
    )
    others = (study(out, quick=quick, stage=stage) for study in STUDIES.values())
    return [table, picture, data, *(path for paths in others for path in paths)]


def enlarged(entrant: Entrant) -> Entrant:
    """An entrant of ``--quick``, with enough trajectories where its loop is compared with another's."""
    engine = {f"{tables.OWN} {method}" for method in METHODS}
    compared = entrant.family in engine or entrant.family.startswith(tables.FUSED)
    return replace(entrant, least=max(entrant.least, QUICK_LEAST)) if compared else entrant


def _threads(entrant: Entrant) -> list[int]:
    every = thread_count(None)
    return [1, every] if entrant.threaded and every > 1 else [1]


def _preamble(quick: bool, failures: list[str]) -> list[str]:
    """What was measured, how, and on what."""
    lines = ["# Speed against error", ""]
    if quick:
        lines += ["**A quick run: few trajectories, few settings. Not for quoting.**", ""]
    versions = []
    for library in LIBRARIES:
        try:
            versions.append(f"{library} {metadata.version(library)}")
        except metadata.PackageNotFoundError:
            continue
    load = f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "unknown"
    lines += [
        f"{processor_name()}, {thread_count(None)} cores, load {load} at the end. {', '.join(versions)}.",
        "",
        "Everyone solves the same problems: Table 1 with its force constant. Errors are the largest and the "
        "median over trajectories of the largest component of a final state's error, against a reference of "
        "24 digits (`data/make_bench_reference.py`). All are prepared and warmed up first and then timed in "
        "turns; rates on one thread are medians per second of processor time, on a quiet machine wall time.",
        "",
    ]
    if missing():
        lines += [f"Not installed: {', '.join(missing())}.", ""]
    if failures:
        lines += ["Failed:", "", *(f"- {failure}" for failure in failures), ""]
    return lines


def _strings(values: list[str]) -> np.ndarray[Any, Any]:
    return np.array(values, dtype=object)


def speed_dataset(rows: list[Row], problems: list[Problem]) -> Dataset:
    """Every row with the error of each of its trajectories, NaN where it was not given one."""
    errors = np.full((len(rows), max(len(problem.starts) for problem in problems)), np.nan)
    for line, row in zip(errors, rows, strict=True):
        line[: row.errors.size] = row.errors
    worst = "of the worst component of a final state in rad and rad/s"
    columns = {
        "problem": (_strings([r.problem for r in rows]), "1", "problem"),
        "family": (_strings([r.family for r in rows]), "1", "integrator"),
        "setting": (_strings([r.setting for r in rows]), "1", "step or tolerance"),
        "threads": (np.array([r.threads for r in rows]), "1", "threads"),
        "trajectories": (np.array([r.trajectories for r in rows]), "1", "trajectories in a timed call"),
        "wall": (np.array([r.wall for r in rows]), "s", "wall time of a call, median"),
        "processor": (np.array([r.processor for r in rows]), "s", "processor time of a call, median"),
        "first_call": (np.array([r.first_call for r in rows]), "s", "preparing and the first call"),
        "max_error": (np.array([r.max_error() for r in rows]), "1", f"largest error, {worst}"),
        "median_error": (np.array([r.median_error for r in rows]), "1", f"median error, {worst}"),
    }
    variables = {name: Variable(("row",), *column) for name, column in columns.items()}
    return Dataset(variables | {"error": Variable(("row", "trajectory"), errors, "1", f"error, {worst}")})


def throughput_dataset(peak: float, found: list[Throughput]) -> Dataset:
    """Right-hand sides per second, and the peak."""
    return Dataset(
        {
            "peak": Variable(
                (), np.array(peak), "1/s", "fused multiply-adds of doubles of one core, measured"
            ),
            "place": Variable(("place",), _strings([t.name for t in found]), "1", "where they are evaluated"),
            "rhs": Variable(("place",), np.array([t.rhs for t in found]), "1/s", "right-hand sides"),
        }
    )


def cost_dataset(found: list[Cost]) -> Dataset:
    """Rates by kind of scene."""
    return Dataset(
        {
            "kind": Variable(("kind",), _strings([c.name for c in found]), "1", "terms of the scene"),
            "rate": Variable(("kind",), np.array([c.rate for c in found]), "1/s", "trajectories"),
        }
    )


def start_dataset(found: list[Start]) -> Dataset:
    """Cold starts."""
    return Dataset(
        {
            "entrant": Variable(("entrant",), _strings([s.name for s in found]), "1", "integrator"),
            "first": Variable(
                ("entrant",), np.array([s.first_process for s in found]), "s", "to the first result"
            ),
            "second": Variable(
                ("entrant",), np.array([s.second_process for s in found]), "s", "the same in a second process"
            ),
            "steady": Variable(("entrant",), np.array([s.steady for s in found]), "s", "a later call"),
        }
    )
