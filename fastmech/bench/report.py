"""``fastmech bench``: runs every entrant on every problem and writes table, picture and data."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path

import numpy as np

from fastmech.bench.atlas import run_atlas
from fastmech.bench.entrants import entrants, jitted_rhs
from fastmech.bench.measure import Row, measure
from fastmech.bench.picture import draw_bench
from fastmech.bench.problem import PROBLEMS, reference
from fastmech.bench.stiff import run_stiff
from fastmech.ensembles.run import Progress
from fastmech.ensembles.threads import thread_count
from fastmech.results import Dataset, Variable
from fastmech.scene import Scene
from fastmech.store.provenance import provenance
from fastmech.store.write import check_writable, write_results

_UNITS = {"rate": "1/s", "max_error": "rad or rad/s", "median_error": "rad or rad/s", "first_call": "s"}


def run_bench(
    out: Path,
    *,
    quick: bool = False,
    stage: Callable[[str, int], Progress] = lambda name, total: lambda done: None,
) -> list[Path]:
    """Measure and write ``bench.md``, ``bench.png`` and ``bench.h5`` into the folder ``out``.

    ``quick`` takes a sixteenth of the trajectories: for trying the command, not for quoting.
    """
    data = out / "bench.h5"
    check_writable(data, replace=True)
    began = time.perf_counter()
    n, compared = (512, 16) if quick else (8192, 256)
    everyone = list(entrants())
    rows: list[Row] = []
    floors: dict[str, float] = {}
    for make in PROBLEMS.values():
        problem = make(n)
        advance = stage(f"reference, {problem.name}", 1)
        truth = reference(problem, compared, jitted_rhs, 1e-13)
        floors[problem.name] = float(np.abs(reference(problem, compared, jitted_rhs, 1e-12) - truth).max())
        advance(1)
        advance = stage(f"entrants, {problem.name}", len(everyone))
        for entrant in everyone:
            for threads in {1, thread_count(None)} if entrant.threaded else {1}:
                rows.append(measure(problem, entrant, truth, threads))
            advance(1)
    atlas = run_atlas(out, quick=quick, stage=stage)
    stiff = run_stiff(out, quick=quick, stage=stage)
    table, picture = out / "bench.md", out / "bench.png"
    table.write_text(markdown(rows, floors), encoding="utf-8")
    draw_bench(rows, picture)
    columns = {
        field.name: Variable(
            ("row",),
            np.array([getattr(row, field.name) for row in rows]),
            _UNITS.get(field.name, "1"),
            field.name,
        )
        for field in fields(Row)
    }
    scene = Scene(alpha=0.0)
    write_results(
        data,
        scene_parameters={
            name: Variable((), np.array(value), unit, about)
            for name, (value, unit, about) in scene.described().items()
        },
        sections={"bench": Dataset(columns)},
        attrs={"title": "Speed against error", "wall_time_s": time.perf_counter() - began}
        | provenance(thread_count(None)),
        replace=True,
    )
    return [table, picture, data, *atlas, *stiff]


def markdown(rows: list[Row], floors: dict[str, float]) -> str:
    """A table for each problem: rate, errors, and the ratio to the plain RK4 with the same step."""
    lines = ["# Speed against error", ""]
    lines += [
        "Rates are medians of three warm calls. Errors are the largest and the median over the same "
        f"{rows[0].compared} trajectories for every integrator, against SciPy's DOP853 at rtol 1e-13.",
        "",
    ]
    for name, make in PROBLEMS.items():
        problem = make(1)
        lines += [f"## {name}: {problem.description}, t = {problem.t_end:g} s", ""]
        lines += [f"The reference moves by {floors[name]:.0e} when its tolerance is ten times larger.", ""]
        lines += [
            "| integrator | setting | threads | trajectories/s | max error | median error | first call [s] |"
        ]
        lines += ["|---|---|---:|---:|---:|---:|---:|"]
        for row in (r for r in rows if r.problem == name):
            lines.append(
                f"| {row.family} | {row.setting} | {row.threads} | {row.rate:,.0f} | {row.max_error:.0e} "
                f"| {row.median_error:.0e} | {row.first_call:.2f} |"
            )
        lines += ["", "Ratios at the same method and step (RK4, one thread):", ""]
        lines += [f"- {setting}: {ratio:.1f} times" for setting, ratio in ratios(rows, name)] + [""]
    return "\n".join(lines)


def ratios(rows: list[Row], problem: str) -> list[tuple[str, float]]:
    """Rate of the package's RK4 over that of plain numba's, at every common step, one thread."""
    found = {(r.family, r.setting): r.rate for r in rows if r.problem == problem and r.threads == 1}
    return [
        (setting, rate / found["numba RK4, one at a time", setting])
        for (family, setting), rate in found.items()
        if family == "fastmech rk4" and ("numba RK4, one at a time", setting) in found
    ]
