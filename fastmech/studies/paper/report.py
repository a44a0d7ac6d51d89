"""``fastmech paper``: the report as Markdown and HTML, data and pictures, written into one folder."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from fastmech.errors import InputError
from fastmech.plots.style import png, style
from fastmech.reports import Stage, no_stage, table, to_html
from fastmech.store.write import check_writable
from fastmech.studies.paper.compare import HEADINGS, Agreement, PaperRow
from fastmech.studies.paper.compute import METHOD, MOTION_SPAN, PAPER_SCENE, STEP, Computed, compute
from fastmech.studies.paper.figures import ABOUT, DRAWN, all_datasets
from fastmech.studies.paper.misprints import Misprint, candidates
from fastmech.studies.paper.rows import Check, all_checks, all_rows
from fastmech.studies.reporting import content, section, write_data

TITLE = "The source paper, computed again"


def _report(
    computed: Computed, rows: Sequence[PaperRow], suspects: Sequence[Misprint], checks: Sequence[Check]
) -> Iterator[str]:
    """All but the figures."""
    confirmed = [item for item in suspects if item.confirmed]
    right = [item for item in suspects if not item.confirmed]
    places, printed = {item.key: item.place for item in suspects}, content(__package__, "printed.toml")
    numbers = Counter(row.verdict for row in rows if row.is_number)
    words = [row.verdict.good for row in rows if not row.is_number]
    yield from [
        f"# {TITLE}",
        "",
        f"Of **{numbers.total()} printed numbers**, {numbers[Agreement.AGREES]} agree to the printed digit, "
        f"{numbers[Agreement.LEGIBLE]} in every legible digit, {numbers[Agreement.ROUNDING]} is a rounding "
        f"of the value that was used, **{numbers[Agreement.MISPRINT]} are misprints** and "
        f"**{numbers[Agreement.DIFFERS]} differ unexplained**. "
        f"{sum(words)} of {len(words)} printed verdicts say the same as the computation.",
        "",
        f"{len(confirmed)} misprints are proved, formulas included:",
        "",
        *(f"- [{item.place}](#{_anchor(item.key)}): {item.error}" for item in confirmed),
        "",
        f"{sum(check.passed for check in checks)} of {len(checks)} checks of the computation itself are "
        f"passed; on the equilibria: {computed.equilibria.certificate.sentence}. Motions: {METHOD}, step "
        f"{STEP:g} s.",
        "",
        "## Printed against computed",
        "",
    ]
    for name in dict.fromkeys(row.section for row in rows):
        own, note = (_row(row, places) for row in rows if row.section == name), printed["notes"].get(name, "")
        yield from section(f"### {name}, printed numbers", note, HEADINGS, own, (0, 1, 2, 6))
    yield from [
        "## Misprints",
        "",
        "A place counts as misprinted only if each measure of the print exceeds the tolerance and the same "
        "measure of the correction does not. Formulas are in Python's syntax and are what was evaluated.",
        "",
    ]
    for item in confirmed:
        yield from _misprint(item)
    if right:
        yield from ["## Suspected, but printed rightly", ""]
        yield from [*(f"- {item.place}: {item.error}" for item in right), ""]
    promises = (
        f"{c.name} | {c.value:.2g} | {c.limit:.1g} | {c.unit} | {'passed' if c.passed else '**failed**'}"
        for c in checks
    )
    head = "Check | Value | Limit | Unit | Result"
    yield from section("## Checks of the computation", "", head, promises, (0, 3, 4))


def _anchor(key: str) -> str:
    return key.replace("_", "-")


def _row(row: PaperRow, places: dict[str, str]) -> list[str]:
    # Markdown would read the stars as emphasis.
    texts = [f"`{text}`" if "*" in text and i in (0, 1, 3) else text for i, text in enumerate(row.cells)]
    if row.verdict == Agreement.MISPRINT:
        texts[-1] = f"**misprint**: see [{places[row.see]}](#{_anchor(row.see)})"
    if row.verdict == Agreement.DIFFERS:
        texts[-1] = "**differs**"
    return texts


def _misprint(item: Misprint) -> list[str]:
    evidence = (
        f"{measure} | {unit} | {printed:.3g} | {corrected:.2g} | {tolerance:.1g}"
        for measure, unit, printed, corrected, tolerance in item.evidence
    )
    return [
        f'<a id="{_anchor(item.key)}"></a>',  # plain Markdown has no anchors of its own
        "",
        f"### {item.place}: {item.error}",
        "",
        f"- printed: `{item.printed}`",
        f"- corrected: `{item.corrected}`",
        "",
        *table("Measure | Unit | As printed | Corrected | Tolerance", evidence, (0, 1)),
    ]


DATA = "paper.h5"


class PaperReport(NamedTuple):
    """What was written, and what it says."""

    paths: tuple[Path, ...]  #: all files, the HTML report first
    rows: tuple[PaperRow, ...]  #: every printed number and verdict
    misprints: tuple[Misprint, ...]  #: those that the evidence confirms
    checks: tuple[Check, ...]

    @property
    def as_expected(self) -> bool:
        """Whether every difference is a proved misprint and every check is passed."""
        explained = all(row.verdict.good or row.see for row in self.rows)
        return explained and all(check.passed for check in self.checks)


def write_paper(out: Path, *, stage: Stage = no_stage) -> PaperReport:
    """Compute the paper's tables and figures and set them against what it prints.

    Writes into the folder ``out`` (made if missing, files of an earlier report replaced): ``report.html``
    (which needs no other file), ``report.md``, a PNG for every figure, and their data in
    ``paper.h5``.

    Raises:
        InputError: the folder cannot be written.
    """
    began = time.perf_counter()
    check_writable(out / DATA, replace=True)
    printed = content(__package__, "printed.toml")
    computed = compute(printed)
    suspects = candidates(printed, computed)
    misprints = tuple(item for item in suspects if item.confirmed)
    rows = all_rows(printed, computed, {item.key for item in misprints})
    checks = all_checks(computed)
    datasets = all_datasets(rows)
    figures = ABOUT["figure"]
    advance = stage("figures", len(figures))
    pictures: dict[str, bytes] = {}
    for name, about in figures.items():
        with style():
            pictures[f"{name}.png"] = png(DRAWN[about["kind"]](about, computed, datasets))
        advance(1)
    lines = [*_report(computed, rows, suspects, checks), "## Figures", ""]
    lines += [
        f"Spans are not printed in the paper; those here show decay or escape. The data are in `{DATA}`: ",
        "sections `motion` (2 to 5), `equilibria` and `figure_6`, `disturbed_motion` (7 to 11).",
        "",
    ]
    for name, about in figures.items():
        heading, caption = about["heading"], about["caption"].format(motion=MOTION_SPAN)
        lines += [f"### {heading}", "", f"![{heading}]({name}.png)", "", caption, ""]
    markdown = "\n".join(lines)
    files = {"report.html": to_html(markdown, TITLE, pictures).encode(), "report.md": markdown.encode()}
    files |= pictures
    try:
        for name, written in files.items():
            (out / name).write_bytes(written)
    except OSError as error:
        raise InputError(f"{out}: cannot be written: {error.strerror}") from None
    write_data(out / DATA, PAPER_SCENE, datasets, began, title=TITLE, method=METHOD, dt=STEP)
    paths = tuple(out / name for name in (*files, DATA))
    return PaperReport(paths, tuple(rows), misprints, tuple(checks))
