"""Reports on paper: pages of one size, letters that can be read, nothing lost of wide tables."""

from __future__ import annotations

import re
import zlib
from html import unescape
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from fastmech.reports import plain, table, to_html, to_pdf

OTHERS = "1*2*3 <b>x</b> & [a](http://b.c) | `d` _e_ &lt; \\_ #f ![g](h.png) $i$"


@pytest.mark.nojit
def test_others_texts_are_no_marks_on_pages_and_on_paper(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "\n".join([f"# {plain(OTHERS)}", "", plain(OTHERS), "", *table("A | B", [[plain(OTHERS), 1]])])
    page = to_html(text, OTHERS, {})
    parts = [re.search(rf"<{tag}[^>]*>(.*?)</{tag}>", page)[1] for tag in ("title", "h1", "p", "td")]
    assert [unescape(part) for part in parts] == [OTHERS] * 4
    words: list[str] = []
    monkeypatch.setattr(Figure, "text", lambda self, x, y, text, **look: words.append(text))
    to_pdf(f"{text}\n    t = '*{OTHERS}*'", {}, tmp_path / "x.pdf")
    assert words.count(OTHERS) == 2
    assert any(line.startswith(OTHERS) for line in words if line != OTHERS)  # the table's
    assert f"t = '*{OTHERS}*'" in [line.strip() for line in words]


@pytest.mark.nojit
def test_pages_are_a4_pictures_have_their_captions_and_letters_8_points(tmp_path: Path) -> None:
    head = ["Answer", *(f"by parameter number {k} + 0.25" for k in range(14))]
    rows = [[f"{k}: decay rate of the slowest mode", *["+1.23456e-07"] * 14] for k in range(3)]
    caption = "A picture wider than the page."
    text = "\n".join(["# Title", *table(head, rows), "![x](wide.png)", "", caption, "", *["text", ""] * 30])
    to_pdf(text, {"wide": Figure(figsize=(14.5, 12.6))}, tmp_path / "x.pdf")
    content = (tmp_path / "x.pdf").read_bytes()
    boxes = re.findall(rb"/MediaBox \[ (\S+) (\S+) (\S+) (\S+) \]", content)
    assert len(boxes) >= 2
    for box in boxes:  # 210 x 297 mm in points
        assert [float(x) for x in box] == pytest.approx([0.0, 0.0, 595.3, 841.9], abs=0.5)
    pages = []
    for part in re.findall(rb"stream\r?\n(.*?)\r?\nendstream", content, re.S):
        try:
            pages.append(zlib.decompress(part))
        except zlib.error:  # fonts and pictures are packed in other ways
            continue
    sizes = [float(size) for page in pages for size in re.findall(rb"/F\S* (\S+) Tf", page)]
    assert min(sizes) >= 8.0
    shown = [page for page in pages if b" Do" in page and b" Tf" in page]
    assert len(shown) == 1  # the picture is on a page with its caption


@pytest.mark.nojit
def test_tables_begin_every_page_with_their_head_and_pictures_fill_the_rest_of_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pages: dict[Figure, list[str]] = {}
    text, add_axes = Figure.text, Figure.add_axes

    def noted(self: Figure, x: float, y: float, words: str, **look: object) -> object:
        pages.setdefault(self, []).append(words)
        return text(self, x, y, words, **look)

    def shown(self: Figure, place: tuple[float, ...], **look: object) -> object:
        pages.setdefault(self, []).append(f"picture {place[3]:.3f}")
        return add_axes(self, place, **look)

    monkeypatch.setattr(Figure, "text", noted)
    monkeypatch.setattr(Figure, "add_axes", shown)
    lines = table("Number | Square", (f"{k} | {k * k}" for k in range(100)))
    # Of the 10.3 inches in a page the lines leave 6.7, for the picture and its caption.
    to_pdf(
        "\n".join([*["text", ""] * 10, "![x](x.png)", "", "Caption.", "", *lines]),
        {"x": Figure((6.8, 6.8))},
        tmp_path / "x.pdf",
    )
    first, *others = pages.values()
    (picture,) = [words for words in first if words.startswith("picture")]
    assert 0.6 * 6.8 / 11.69 <= float(picture.split()[1]) < 6.8 / 11.69
    assert others
    assert all(page[0].split() == ["Number", "Square"] for page in others)
