"""``fastmech bench --problem``: speed against error of every method on a problem from a file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fastmech.errors import InputError, shown, shown_name
from fastmech.frontier import EXPLICIT, work_precision
from fastmech.plots.style import new_panel, save, style
from fastmech.reports import Stage, no_stage, table
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.request import named_in_file, read_request
from fastmech.studies.reporting import write_text

#: Starts at rest anywhere, of a request's scene, and the end in its vibrations' time scale.
STARTS, UNTIL = 512, 50.0


def problem_named(where: str) -> tuple[Any, Any, float, dict[str, Any]]:
    """Problem, starts, end [s] and keywords for :func:`work_precision` from ``FILE.py:NAME`` or a request.

    ``NAME`` is a function without arguments that returns ``problem, starts, t_end``, or these and a
    dictionary of keywords. A request's scene has starts at rest anywhere.

    Raises:
        InputError: the file cannot be read or run, or the name is no such function.
    """
    if where.endswith(".toml"):
        scene = read_request(where, scan_kinds()).scene
        starts = np.zeros((STARTS, 4))
        starts[:, :2] = np.random.default_rng(1).uniform(-np.pi, np.pi, (STARTS, 2))
        return scene, starts, float(f"{UNTIL / scene._motion({}).frequency:.2g}"), {}
    match named_in_file(where, "--problem"):
        case (problem, starts, t_end):
            return problem, starts, t_end, {}
        case (problem, starts, t_end, dict(keywords)):
            return problem, starts, t_end, keywords
    raise InputError(
        f"{_named(where)}: must be a function that returns problem, starts, t_end, or these and keywords"
    )


def _named(where: str) -> str:
    """File and function, so that a long path does not cut the function's name."""
    file, _, name = where.rpartition(":")
    return f"{shown_name(file)}: {shown_name(name)}"


def run_problem(where: str, out: Path, stage: Stage = no_stage) -> tuple[list[str], list[Path]]:
    """Measure and write ``problem.md`` and ``problem.png`` into the folder ``out``; the table's lines, too.

    Raises what :func:`problem_named` and :func:`work_precision` do.
    """
    problem, starts, t_end, keywords = problem_named(where)
    methods = keywords.get("methods", EXPLICIT)
    if not isinstance(methods, Sequence):
        raise InputError(f"methods = {shown(methods)}: must be a list of names")
    advance = stage("methods", len(methods))
    try:
        found = work_precision(problem, starts, t_end, progress=advance, **keywords)
    except TypeError as error:
        raise InputError(f"{_named(where)}: {error}") from None
    best, head = found.frontier, "method | step [s] | largest error | 99 % error | trajectories [1/s]"
    rows = (
        f"{p.method} | {p.dt:.3g} | {p.largest:.1e} | {p.error_99:.1e} | {p.rate:,.0f} | "
        + "yes" * (p in best)
        for p in sorted(found.points, key=lambda p: -p.largest)
    )
    lines = table(f"{head} | fastest at its error", rows)
    least = min((p.largest for p in found.points), default=np.inf)
    for most in found.errors:  # the calls to copy
        lines.append(f"    {most:.0e}: {found.call(most) if least <= most else 'no method keeps it'}")
    written = write_text(out / "problem.md", [f"# {shown_name(where)}", "", *lines])
    picture = out / "problem.png"
    with style():
        figure, axes = new_panel(9.0, 5.4)
        found.plot(axes)
    save(figure, picture)
    return lines, [written, picture]
