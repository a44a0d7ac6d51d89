"""``fastmech bench``: runs every entrant on every problem and writes table, picture and data."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable
from importlib import metadata
from importlib.util import find_spec
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fastmech.ensembles.threads import thread_count
from fastmech.plots.style import LINES, legend_below, new_figure, save, style
from fastmech.reports import Stage, no_stage
from fastmech.results import Dataset, Variable
from fastmech.scene import Scene
from fastmech.store.provenance import processor_name
from fastmech.store.write import check_writable
from fastmech.studies.bench.atlas import atlas_study
from fastmech.studies.bench.attractors import attractors_study
from fastmech.studies.bench.basins import basins_study
from fastmech.studies.bench.entrants import LIBRARIES, entrants, installed
from fastmech.studies.bench.machine import rhs_section, terms_section, threads_study
from fastmech.studies.bench.measure import (
    BUDGET,
    PROBLEMS,
    TARGETS,
    BenchProblem,
    Entrant,
    Row,
    by_family,
    fastest_at,
    frontier,
    measure,
    rate_at,
)
from fastmech.studies.bench.processes import memory_section, starts_section, vectors_study
from fastmech.studies.bench.stiff import stiff_study
from fastmech.studies.bench.systems import systems_study
from fastmech.studies.bench.tolerances import tolerances_study
from fastmech.studies.reporting import columns, section, write_data, write_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Of ``--quick``: starts that have a reference, what each entrant is given [s], and trajectories a call of
#: the engine and its yardstick: on fewer than those not the loops would be compared but what is around them.
QUICK_STARTS, QUICK_BUDGET, QUICK_LEAST = 8, 0.05, 8192

VERSIONS = ("numba", "scipy", "heyoka", "torch", "jax", "diffrax", "numbalsoda", "pynamicalsys")

#: Studies with a file of their own, by name: from `quick` and a stage to the lines of Markdown.
STUDIES: dict[str, Callable[..., list[str]]] = {
    "atlas": atlas_study,
    "attractors": attractors_study,
    "basins": basins_study,
    "stiff": stiff_study,
    "systems": systems_study,
    "threads": threads_study,
    "tolerances": tolerances_study,
    "vectors": vectors_study,
}

#: Errors [rad, rad/s] that the picture shows: larger ones answer nothing.
LARGEST, SMALLEST = 3e-2, 3e-15

#: Names of methods on the curve keep this ratio of errors between them.
APART = 20.0

#: Families of the package, and of its engine's yardstick at the same method and step.
OWN, FUSED = "fastmech", "hand-fused"

#: Curves: what the family's name begins with, its label, marker; in the order of the colours.
CURVES = (
    (OWN, "fastmech, best method", "o"),
    ("heyoka", "heyoka batch", "s"),
    ("torch", "torch.compile, best step", "D"),
    ("numbalsoda", "numbalsoda", "v"),
    ("diffrax", "diffrax", "P"),
    ("Numba RK4", "plain Numba RK4", "X"),
    ("SciPy", "SciPy, best solver", "*"),
)

#: Seconds that a call takes at least for the loop's own speed to show, not what stands around it.
WORTH_COMPARING = 0.01


def run_study(name: str, out: Path, *, quick: bool = False, stage: Stage = no_stage) -> Path:
    """Measure and write a study's ``NAME.md`` into the folder ``out``."""
    return write_text(out / f"{name}.md", STUDIES[name](quick, stage))


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
    lines += [*rhs_section(problems[0], stage), *terms_section(problems[0], stage)]
    lines += [] if quick else [*starts_section(stage), *memory_section(stage)]
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


def draw_bench(rows: list[Row], path: Path) -> None:
    """The fastest settings of every library on one thread; the package's own methods thin behind."""
    with style():
        figure = new_figure(11.0, 6.2)
        panels = figure.subplots(1, len(PROBLEMS), sharey=True, squeeze=False)[0]
        named: dict[str, Any] = {}
        for axes, (name, make) in zip(panels, PROBLEMS.items(), strict=True):
            problem = make(1)
            _draw(axes, [r for r in rows if SMALLEST < r.max_error < LARGEST and r.problem == name])
            axes.set(xscale="log", yscale="log", xlim=(LARGEST, SMALLEST))
            axes.set_title(f"{problem.description}, to {problem.t_end:g} s")
            axes.set_xlabel("largest error of a final state [rad, rad/s], smaller to the right")
            handles, labels = axes.get_legend_handles_labels()
            named = dict(zip(labels, handles, strict=True)) | named
        panels[0].set_ylabel("trajectories per second of one core")
        legend_below(figure, list(named.values()), 5)
        save(figure, path)


def _draw(axes: Axes, rows: list[Row]) -> None:
    def plot(line: list[Row], **look: Any) -> None:
        axes.plot([row.max_error for row in line], [row.rate for row in line], **look)

    for each in by_family(own(rows)).values():
        mine = sorted(each, key=lambda row: row.max_error)
        plot(mine, color="0.75", linewidth=0.8, label="fastmech, each method")
    for (prefix, label, marker), color in zip(CURVES, LINES, strict=True):
        best = frontier(row for row in rows if row.family.startswith(prefix))
        if best:
            width = 2.4 if prefix == OWN else 1.4
            plot(best, marker=marker, color=color, linewidth=width, label=label)
    # Names above the package's curve, where the settings of a method begin that lie together on it.
    last, named = 0.0, ""
    for name, those in groupby(frontier(own(rows)), key=lambda row: row.family.split()[1].rstrip(",")):
        row = list(those)[-1]
        if name != named and row.max_error > last * APART:
            last, named = row.max_error, name
            axes.annotate(name, (last, row.rate), (2, 7), textcoords="offset points", color=LINES[0], size=9)


def own(rows: Iterable[Row]) -> list[Row]:
    """Rows of the package."""
    return [row for row in rows if row.family.startswith(OWN)]


def equal_error(rows: list[Row]) -> list[str]:
    """The package's rate at each error, and how many times the rate of each peer that is."""
    mine = own(rows)
    peers = by_family(row for row in rows if not row.family.startswith((OWN, FUSED)))
    known = [fastest_at(mine, error) for error in TARGETS]
    told = ["-" if x is None else f"{x[1]:,.0f} ({x[0].removeprefix(OWN).strip()})" for x in known]
    lines = [["fastmech, best method", *told]]
    for family, theirs in peers.items():
        count = min(len(row.errors) for row in theirs)
        here, there = ([row._replace(errors=row.errors[:count]) for row in each] for each in (mine, theirs))
        line = [family + (f" (first {count})" if count < len(mine[0].errors) else "")]
        for error in TARGETS:
            rate, best = rate_at(there, error), fastest_at(here, error)
            line.append("-" if rate is None or best is None else f"{best[1] / rate:.2f} x ({rate:,.0f})")
        lines.append(line)
    about = (
        "Trajectories per core second at equal largest error, one thread; for the others fastmech's rate "
        "over theirs, and theirs in brackets. A peer that was given fewer trajectories is compared on those. "
        "`-`: no setting is as accurate."
    )
    return section("", about, ["largest error", *(f"{error:.0e}" for error in TARGETS)], lines)


def same_step(rows: list[Row]) -> list[str]:
    """The engine against the hand-fused loop and against plain Numba, same method and step."""
    found = {(row.family, row.setting): row for row in rows}
    lines, left_out = [], 0
    for (family, setting), row in found.items():
        method = "rk4" if family.startswith("Numba RK4") else family.removeprefix(FUSED).strip()
        engine = found.get((f"{OWN} {method}", setting))
        if engine is None:
            continue
        if family.startswith(FUSED) and min(row.processor, engine.processor) < WORTH_COMPARING:
            left_out += 1
        else:
            ratio = f"{row.rate:,.0f} | {engine.rate:,.0f} | {engine.rate / row.rate:.2f}"
            lines.append(f"{family}, {setting} | {ratio}")
    about = (
        "The same method and step, one thread, trajectories per core second. The hand-fused loop is the "
        "engine's yardstick: this mechanism and this method alone, in the same blocks."
    )
    compared = section("", about, "against | its rate | fastmech | ratio", lines)
    told = f"Left out: {left_out} whose calls are shorter than {WORTH_COMPARING:g} s."
    return [*compared, told, ""] if left_out else compared


def problem_section(problem: BenchProblem, rows: list[Row]) -> list[str]:
    """All that was measured on one problem."""
    title = f"## {problem.name}: {problem.description}, to t = {problem.t_end:g} s"
    head = (
        "integrator | setting | n | 1/s a core | 1/s wall | largest error | median error | "
        "compared | first call [s]"
    )
    everything = (
        f"{r.family} | {r.setting} | {r.trajectories} | {r.rate:,.0f} | {r.trajectories / r.wall:,.0f} | "
        f"{r.max_error:.1e} | {r.median_error:.1e} | {len(r.errors)} | {r.first_call:.2f}"
        for r in rows
    )
    compared = [*equal_error(rows), *same_step(rows)]
    return [title, "", *compared, *section("", "Every setting:", head, everything)]
