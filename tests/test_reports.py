"""Reports on paper: pages of one size, letters that can be read, nothing lost of wide tables."""

from __future__ import annotations

import re
import zlib
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from fastmech.reports import table, to_pdf


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
