from __future__ import annotations

import base64
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from fastmech.errors import InputError
from fastmech.store.read import open_results
from fastmech.studies.paper.report import PaperReport, write_paper

TABLES = [f"table_{i}" for i in range(1, 5)]
FIGURES = [f"figure_{i}" for i in range(2, 12)]
PICTURES = [
    *(name for name in FIGURES if name != "figure_6"),
    "figure_6a",
    "figure_6b",
]
PNG = b"\x89PNG\r\n\x1a\n"


class Page(HTMLParser):
    """What a page refers to, and its tables' rows."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.references: list[str] = []
        self.ids: set[str] = set()
        self.open: list[str] = []
        self.rows = 0
        self.text = text
        self.words = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in ("src", "href") and value is not None:
                self.references.append(value)
            if name == "id" and value is not None:
                self.ids.add(value)
        if tag not in ("meta", "img", "br", "hr"):
            self.open.append(tag)
        self.rows += tag == "tr"

    def handle_data(self, data: str) -> None:
        self.words += data

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def page(report: PaperReport) -> Page:
    return Page(report.paths[0].read_text(encoding="utf-8"))


def test_all_files_are_written(report: PaperReport) -> None:
    names = {path.name for path in report.paths}
    assert names == {"report.html", "report.md", "paper.h5", *(f"{name}.png" for name in PICTURES)}
    assert all(path.stat().st_size > 1000 for path in report.paths)
    assert all(path.read_bytes().startswith(PNG) for path in report.paths if path.suffix == ".png")
    assert {path.name for path in report.paths[0].parent.iterdir()} == names


def test_progress_counts_to_the_end(report: PaperReport, told: list[int]) -> None:
    assert told == [len(PICTURES), *[1] * len(PICTURES)]


def test_the_page_needs_no_other_file(page: Page) -> None:
    assert all(reference.startswith(("data:image/png;base64,", "#")) for reference in page.references)
    assert not re.search(r"https?://", page.text)
    assert "@import" not in page.text
    assert "<script" not in page.text


def test_every_figure_is_inside_of_the_page(page: Page, report: PaperReport) -> None:
    inside = [
        base64.b64decode(reference.partition(",")[2])
        for reference in page.references
        if reference.startswith("data:")
    ]
    figures = [path for path in report.paths if path.name.startswith("figure_")]
    assert {path.read_bytes() for path in figures} == set(inside)


def test_links_lead_somewhere(page: Page) -> None:
    targets = {reference[1:] for reference in page.references if reference.startswith("#")}
    assert targets
    assert targets <= page.ids


def test_the_page_is_well_formed_and_has_all_rows(page: Page, report: PaperReport) -> None:
    assert page.open == []
    assert page.rows > len(report.rows)


def test_the_report_says_what_it_found(report: PaperReport) -> None:
    text = (report.paths[0].parent / "report.md").read_text(encoding="utf-8")
    numbers = sum(row.is_number for row in report.rows)
    assert f"Of **{numbers} printed numbers**" in text
    assert "**0 differ unexplained**" in text
    assert f"{len(report.misprints)} misprints are proved" in text
    assert "Suspected, but printed rightly" not in text
    assert "failed" not in text
    for item in report.misprints:
        assert f"### {item.place}: {item.error}" in text
        assert item.printed in text


def test_powers_are_not_read_as_emphasis(page: Page, report: PaperReport) -> None:
    for item in report.misprints:
        assert item.error.replace("`", "") in page.words
        assert item.printed in page.words
        assert item.corrected in page.words


def test_checks_are_passed(report: PaperReport) -> None:
    assert report.as_expected
    assert all(check.passed for check in report.checks)


def test_the_data_hold_every_table_and_figure(report: PaperReport) -> None:
    with open_results(report.paths[0].parent / "paper.h5") as results:
        assert {*TABLES, "motion", "equilibria", "figure_6", "disturbed_motion"} <= set(results)
        motion = results["motion"]
        assert motion["phi"].units == "rad"
        assert motion["time"].data[-1] == 20.0
        rows = results["printed_numbers"]
        assert rows.sizes["row"] == len(report.rows)


def test_a_report_can_be_written_again(report: PaperReport) -> None:
    again = write_paper(report.paths[0].parent)
    assert again.rows == report.rows


def test_a_folder_that_cannot_be_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InputError, match="cannot be written"):
        write_paper(tmp_path / "file" / "report")
