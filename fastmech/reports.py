"""What reports share: Markdown tables, pages in HTML and PDF."""

from __future__ import annotations

import base64
import re
import textwrap
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fastmech.ensembles.run import Progress
from fastmech.plots.style import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Makes a bar from what is done and how many pieces that are; it is told of each.
Stage = Callable[[str, int], Progress]


def no_stage(name: str, total: int) -> Progress:
    """A stage that nobody looks at."""
    return lambda done: None


#: Of a table: its cells, or a text with " | " between them.
Line = str | Iterable[object]


def table(head: Line, rows: Iterable[Line], left: Collection[int] = (0,)) -> list[str]:
    """A Markdown table and an empty line; numbers, all columns but those ``left``, stand to the right."""
    lines = [line if isinstance(line, str) else " | ".join(map(str, line)) for line in (head, *rows)]
    marks = ("---" if i in left else "---:" for i in range(lines[0].count(" | ") + 1))
    return [f"| {lines[0]} |", f"|{'|'.join(marks)}|", *(f"| {line} |" for line in lines[1:]), ""]


_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
body {{ font: 16px/1.5 system-ui, sans-serif; color: #1b1b1b; background: #fff; }}
body {{ max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }}
h1, h2, h3 {{ line-height: 1.25; margin-top: 2.2rem; }}
h1 {{ margin-top: 0; }}
h2 {{ border-bottom: 2px solid #0072b2; padding-bottom: .2rem; }}
table {{ border-collapse: collapse; margin: 1rem 0; font-size: .9rem; display: block; overflow-x: auto; }}
th, td {{ border: 1px solid #d0d0d0; padding: .3rem .6rem; vertical-align: top; }}
th {{ background: #eef3f7; text-align: left; }}
tr:nth-child(even) td {{ background: #fafafa; }}
code {{ background: #f3f3f3; padding: .1rem .25rem; font-size: .88em; overflow-wrap: anywhere; }}
img {{ max-width: 100%; height: auto; display: block; margin: .5rem 0; }}
a {{ color: #0072b2; }}
</style>
</head>
<body>
{body}
</body>
</html>
"""


def to_html(markdown: str, title: str, pictures: Mapping[str, bytes]) -> str:
    """A page from Markdown text; ``pictures`` are the PNG files that it shows, by file name."""
    from markdown import markdown as convert

    body = convert(markdown, extensions=["tables", "toc"], output_format="html")
    for name, content in pictures.items():
        inside = base64.b64encode(content).decode("ascii")
        body = body.replace(f'src="{name}"', f'src="data:image/png;base64,{inside}"')
    return _PAGE.format(title=title, body=body)


#: A page of paper [inch], its margin, and the sizes of text, headings and tables [points].
PAPER, MARGIN, TEXT = (8.27, 11.69), 0.7, 9.0
HEADINGS = {"# ": 17.0, "## ": 13.0, "### ": 10.5}


def to_pdf(markdown: str, figures: Mapping[str, Figure], path: Path) -> None:
    """The same on paper by Matplotlib: pages of text and tables, each followed by its pictures."""
    from matplotlib.backends.backend_pdf import PdfPages
    from matplotlib.figure import Figure

    with style(), PdfPages(path, metadata={"CreationDate": None}) as pdf:
        pages: list[Figure] = [Figure(figsize=PAPER)]
        pictures: list[Figure] = []  # of the last page's text: they follow it
        y = PAPER[1] - MARGIN

        def turn() -> None:
            for page in [pages.pop(), *pictures]:
                pdf.savefig(page)
            pictures.clear()

        def put(text: str, size: float, room: float = 0.0, **look: Any) -> None:
            nonlocal y
            y -= 1.45 * size / 72.0
            if y < MARGIN + room:
                turn()
                pages.append(Figure(figsize=PAPER))
                y = PAPER[1] - MARGIN - 1.45 * size / 72.0
            pages[-1].text(MARGIN / PAPER[0], y / PAPER[1], text, size=size, parse_math=False, **look)

        lines = iter(markdown.splitlines())
        for line in lines:
            text = re.sub(r"[*`]|\[(.*?)\]\(.*?\)", r"\1", line)
            head = next((mark for mark in HEADINGS if line.startswith(mark)), None)
            if head is not None:
                y -= 0.12
                put(text.removeprefix(head), HEADINGS[head], 1.0, weight="bold")
            elif line.startswith("!["):
                pictures.append(figures[line.rpartition("(")[2].removesuffix(".png)")])
            elif line.startswith("|"):
                rows = [line, *takewhile(lambda one: one.startswith("|"), lines)]
                for row, size in _aligned(rows):
                    put(row, size, family="monospace")
                y -= 0.1
            else:
                for part in textwrap.wrap(text, 108) or [""]:
                    put(part, TEXT)
        turn()


def _aligned(rows: Sequence[str]) -> list[tuple[str, float]]:
    """A table's rows in columns, with the size at which the longest fits the page."""
    cells = [[re.sub(r"[*`]", "", cell.strip()) for cell in row.strip("|").split(" | ")] for row in rows]
    cells = [cells[0], *cells[2:]]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    told = ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)) for row in cells]
    told.insert(1, "  ".join("-" * w for w in widths))
    size = min(8.0, 72.0 * (PAPER[0] - 2.0 * MARGIN) / (0.61 * max(map(len, told))))
    return [(row, size) for row in told]
