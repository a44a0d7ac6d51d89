"""``fastmech paper``: the report as Markdown and HTML, data and pictures, written into one folder."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from fastmech.ensembles.threads import thread_count
from fastmech.errors import InputError
from fastmech.plots.style import png
from fastmech.reports import Stage, no_stage, table, to_html
from fastmech.results import scene_parameters
from fastmech.store.provenance import provenance
from fastmech.store.write import check_writable, write_results
from fastmech.studies.paper.compare import HEADINGS, Row, Verdict, load_printed
from fastmech.studies.paper.compute import METHOD, PAPER_SCENE, STEP, Computed, compute
from fastmech.studies.paper.figures import Picture, all_datasets, figure_pictures, table_pictures
from fastmech.studies.paper.misprints import Misprint, candidates
from fastmech.studies.paper.rows import Check, Guess, all_checks, all_rows, parameters_used

TITLE = "The source paper, computed again"

_NOTES = {
    "Table 1": "Given values, as this report's scene has them. The paper prints no g; see *Parameters used*.",
    "Equation (16)": "The exact coefficients of the Hamiltonian in the paper's shape, with the inner bracket "
    "of the denominator closed after the last term.",
    "Table 4": "Computed coefficients are given the sign of the print. A `*` stands for characters that are "
    "lost in the text at hand; a row agrees if some rounding of the computed number fits what is left.",
}


def report_text(
    computed: Computed,
    rows: Sequence[Row],
    misprints: Sequence[Misprint],
    checks: Sequence[Check],
    guesses: Sequence[Guess],
    figures: Sequence[Picture],
) -> str:
    """The whole report."""
    confirmed = [item for item in misprints if item.confirmed]
    right = [item for item in misprints if not item.confirmed]
    places = {item.key: item.place for item in misprints}
    lines = [
        f"# {TITLE}",
        "",
        *_summary(computed, rows, confirmed, checks),
        "",
        "## Printed against computed",
        "",
        *_rows(rows, places),
        "## Misprints",
        "",
        "A place counts as misprinted only if each measure of the print exceeds the tolerance and the same "
        "measure of the correction does not. Formulas are in Python's syntax and are what was evaluated.",
        "",
        *(line for item in confirmed for line in _misprint(item)),
    ]
    if right:
        lines += ["## Suspected, but printed rightly", ""]
        lines += [*(f"- {item.place}: {item.error}" for item in right), ""]
    lines += ["## Parameters used", "", *_guesses(guesses)]
    lines += ["## Checks of the computation", "", *_checks(checks)]
    lines += ["## Equilibria", "", *_equilibria(computed)]
    lines += ["## Figures", "", "Spans are not printed in the paper; those here show decay or escape.", ""]
    for name, heading, caption, _ in figures:
        lines += [f"### {heading}", "", f"![{heading}]({name}.png)", "", caption, ""]
    return "\n".join(lines)


def _summary(
    computed: Computed, rows: Sequence[Row], confirmed: Sequence[Misprint], checks: Sequence[Check]
) -> Iterator[str]:
    numbers = [row for row in rows if row.is_number]
    words = [row for row in rows if not row.is_number]

    def count(verdict: Verdict) -> int:
        return sum(row.verdict == verdict for row in numbers)

    same = sum(row.verdict.good for row in words)
    yield (
        f"Of **{len(numbers)} printed numbers**, {count(Verdict.AGREES)} agree to the printed digit, "
        f"{count(Verdict.LEGIBLE)} in every legible digit, {count(Verdict.ROUNDING)} is a rounding of the "
        f"value that was used, **{count(Verdict.MISPRINT)} are misprints** and "
        f"**{count(Verdict.DIFFERS)} differ unexplained**. "
        f"{same} of {len(words)} printed verdicts say the same as the computation."
    )
    yield ""
    yield f"{len(confirmed)} misprints are proved, formulas included:"
    yield ""
    yield from (f"- [{item.place}](#{_anchor(item.key)}): {item.error}" for item in confirmed)
    yield ""
    kept = sum(check.passed for check in checks)
    yield (
        f"{kept} of {len(checks)} checks of the computation itself are passed; on the equilibria: "
        f"{computed.certificate.sentence}. Motions: {METHOD}, step {STEP:g} s."
    )


def _anchor(key: str) -> str:
    return key.replace("_", "-")


def _rows(rows: Sequence[Row], places: dict[str, str]) -> Iterator[str]:
    for section in dict.fromkeys(row.section for row in rows):
        yield f"### {section}, printed numbers"
        yield ""
        if section in _NOTES:
            yield _NOTES[section]
            yield ""
        own = [_row(row, places) for row in rows if row.section == section]
        yield from table(HEADINGS, own, (0, 1, 2, 6))


def _row(row: Row, places: dict[str, str]) -> list[str]:
    texts = list(row.cells)
    for i in (0, 1, 3):
        # Markdown would read the stars as emphasis.
        texts[i] = f"`{texts[i]}`" if "*" in texts[i] else texts[i]
    if row.verdict == Verdict.MISPRINT:
        texts[-1] = f"**misprint**: see [{places[row.see]}](#{_anchor(row.see)})"
    if row.verdict == Verdict.DIFFERS:
        texts[-1] = "**differs**"
    return texts


def _misprint(item: Misprint) -> Iterator[str]:
    # Plain Markdown has no anchors of its own.
    yield f'<a id="{_anchor(item.key)}"></a>'
    yield ""
    yield f"### {item.place}: {item.error}"
    yield ""
    yield f"- printed: `{item.printed}`"
    yield f"- corrected: `{item.corrected}`"
    yield ""
    yield from table(
        "Measure | Unit | As printed | Corrected | Tolerance",
        (
            f"{e.measure} | {e.unit} | {e.printed:.3g} | {e.corrected:.2g} | {e.tolerance:.1g}"
            for e in item.evidence
        ),
        (0, 1),
    )


def _guesses(guesses: Sequence[Guess]) -> Iterator[str]:
    yield "Angles of Table 2 that come out to the printed digit with each choice of c2 and g:"
    yield ""
    rows = (f"{guess.c2} | {guess.g} | {guess.agreeing} of {guess.total}" for guess in guesses)
    yield from table("c2 [N/m] | g [m/s²] | Agreeing angles", rows, ())


def _checks(checks: Sequence[Check]) -> list[str]:
    rows = (
        f"{c.name} | {c.value:.2g} | {c.limit:.1g} | {c.unit} | {'passed' if c.passed else '**failed**'}"
        for c in checks
    )
    return table("Check | Value | Limit | Unit | Result", rows, (0, 3, 4))


def _equilibria(computed: Computed) -> Iterator[str]:
    rows = []
    for case in computed.cases:
        e, c = case.equilibrium, case.classification
        roots = ", ".join(_complex(root) for root in c.eigenvalues if root.imag >= 0.0)
        rows.append(
            f"Case {case.number} | {e.phi:.10f} | {e.theta:.10f} | {e.energy:.4f} | {e.kind} | {roots}"
        )
    yield from table("Case | φ [rad] | θ [rad] | U [J] | Kind | Roots [1/s]", rows, (0, 4, 5))
    for case in computed.cases:
        yield f"- Case {case.number}, {case.classification.verdict}: {case.classification.explanation}."
    yield ""


def _complex(root: complex) -> str:
    return f"{root.real:.4f}" + (f" ± {root.imag:.4f}i" if root.imag else "")


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
