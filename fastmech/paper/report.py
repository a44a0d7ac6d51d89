"""``fastmech paper``: tables, figures, data and the report, written into one folder."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from fastmech.ensembles.threads import thread_count
from fastmech.errors import InputError
from fastmech.paper.checks import Check, all_checks, parameters_used
from fastmech.paper.compare import Row, load_printed
from fastmech.paper.compute import METHOD, PAPER_SCENE, STEP, compute
from fastmech.paper.datasets import all_datasets
from fastmech.paper.figures import figure_pictures, table_pictures
from fastmech.paper.misprints import Misprint, candidates
from fastmech.paper.rows import all_rows
from fastmech.paper.text import TITLE, report_text, to_html
from fastmech.plots.style import png
from fastmech.reports import Stage, no_stage
from fastmech.results import scene_parameters
from fastmech.store.provenance import provenance
from fastmech.store.write import check_writable, write_results

DATA = "paper.h5"


@dataclass(frozen=True)
class PaperReport:
    """What was written, and what it says."""

    paths: tuple[Path, ...]  #: all files, the HTML report first
    rows: tuple[Row, ...]  #: every printed number and verdict
    misprints: tuple[Misprint, ...]  #: those that the evidence confirms
    checks: tuple[Check, ...]

    @property
    def n_rows(self) -> int:
        """Number of printed numbers and verdicts that were compared."""
        return len(self.rows)

    @property
    def as_expected(self) -> bool:
        """Whether every difference is a proved misprint and every check is passed."""
        explained = all(row.verdict.good or row.see for row in self.rows)
        return explained and all(check.passed for check in self.checks)


def write_paper(out: Path, *, threads: int | None = None, stage: Stage = no_stage) -> PaperReport:
    """Compute the paper's tables and figures and set them against what it prints.

    Writes into the folder ``out`` (made if missing, files of an earlier report replaced): ``report.html``
    (which needs no other file), ``report.md``, a PNG for every table and figure, and their data in
    ``paper.h5``.

    Args:
        out: folder of the report.
        threads: threads to use, all processors by default.
        stage: makes a bar; it is told of every picture.

    Raises:
        InputError: the folder cannot be written.
    """
    began = time.perf_counter()
    check_writable(out / DATA, replace=True)
    printed = load_printed()
    computed = compute(printed, threads=threads)
    suspects = candidates(printed, computed)
    misprints = tuple(item for item in suspects if item.confirmed)
    rows = all_rows(printed, computed, {item.key for item in misprints})
    checks = all_checks(computed)
    datasets = all_datasets(computed, rows)
    tables, figures = table_pictures(rows), figure_pictures(computed, datasets)
    advance = stage("tables and figures", len(tables) + len(figures))
    pictures: dict[str, bytes] = {}
    for picture in (*tables, *figures):
        pictures[f"{picture.name}.png"] = png(picture.draw())
        advance(1)
    markdown = report_text(computed, rows, suspects, checks, parameters_used(printed), figures)
    files = {"report.html": to_html(markdown, TITLE, pictures).encode(), "report.md": markdown.encode()}
    files |= pictures
    try:
        for name, content in files.items():
            (out / name).write_bytes(content)
    except OSError as error:
        raise InputError(f"{out}: cannot be written: {error.strerror}") from None
    attrs = {"title": TITLE, "method": METHOD, "dt": STEP, "wall_time_s": time.perf_counter() - began}
    write_results(
        out / DATA,
        scene_parameters=scene_parameters(PAPER_SCENE),
        sections=datasets,
        attrs=provenance(thread_count(threads)) | attrs,
        replace=True,
    )
    paths = tuple(out / name for name in (*files, DATA))
    return PaperReport(paths, tuple(rows), misprints, tuple(checks))
