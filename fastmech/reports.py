"""What reports share: Markdown tables, pages in HTML and PDF."""

from __future__ import annotations

import base64
import html
import re
import textwrap
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from io import BytesIO
from itertools import takewhile, zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fastmech.ensembles.run import Progress
from fastmech.plots.style import png, style

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


#: What Markdown, HTML or a table may take for a mark of its own.
_MARKS = re.compile(r"[\\`*_\[\]<>&#|]")


def plain(text: str) -> str:
    """Somebody else's text for Markdown, in one line, of which nothing is a mark, a link or HTML."""
    return _MARKS.sub(lambda mark: f"&#{ord(mark[0])};", " ".join(text.split()))


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
    """A page from Markdown text; ``pictures`` are the PNG files that it shows, by file name.

    What others wrote is :func:`plain` in the text; the title is as they wrote it.
    """
    from markdown import markdown as convert

    body = convert(markdown, extensions=["tables", "toc"], output_format="html")
    for name, content in pictures.items():
        inside = base64.b64encode(content).decode("ascii")
        body = body.replace(f'src="{name}"', f'src="data:image/png;base64,{inside}"')
    return _PAGE.format(title=html.escape(title), body=body)


#: A page of paper [inch], its margin, the room that a caption takes, and sizes of text and tables [points].
PAPER, MARGIN, CAPTION, TEXT, CELLS = (8.27, 11.69), 0.7, 0.75, 9.0, 8.0
HEADINGS = {"# ": 17.0, "## ": 13.0, "### ": 10.5}

#: Height of a line [inch] over the size of its letters [points], and of a picture, over its height by the
#: page's width, where it fills the rest of a page.
LINE, SMALLEST = 1.45 / 72.0, 0.6

#: Letters of a table's font in a line of the page.
ACROSS = int(72.0 * (PAPER[0] - 2.0 * MARGIN) / (0.603 * CELLS))


def to_pdf(markdown: str, figures: Mapping[str, Figure], path: Path) -> None:
    """The same on paper by Matplotlib: text, tables and pictures, which stand above their captions."""
    from matplotlib.backends.backend_pdf import PdfPages
    from matplotlib.figure import Figure
    from matplotlib.image import imread

    with style(), PdfPages(path, metadata={"CreationDate": None}) as pdf:
        page, y = Figure(figsize=PAPER), PAPER[1] - MARGIN

        def turned(height: float) -> bool:
            """Begin a page if so much has no room on this one."""
            nonlocal page, y
            if y - height >= MARGIN:
                return False
            pdf.savefig(page)
            page, y = Figure(figsize=PAPER), PAPER[1] - MARGIN
            return True

        def put(text: str, size: float, room: float = 0.0, **look: Any) -> None:
            nonlocal y
            turned(LINE * size + room)
            y -= LINE * size
            page.text(MARGIN / PAPER[0], y / PAPER[1], text, size=size, parse_math=False, **look)

        def show(figure: Figure) -> None:
            nonlocal y
            sides = figure.get_size_inches()
            room = np.array(PAPER) - 2.0 * MARGIN - [0.0, CAPTION]
            width, height = sides * min(1.0, *(room / sides))
            if not turned(SMALLEST * height + CAPTION):
                width, height = np.array([width, height]) * min(1.0, (y - MARGIN - CAPTION) / height)
            y -= height
            left = 0.5 * (PAPER[0] - width)
            axes = page.add_axes(
                (left / PAPER[0], y / PAPER[1], width / PAPER[0], height / PAPER[1]), frameon=False
            )
            axes.imshow(imread(BytesIO(png(figure))), aspect="auto", interpolation="none")
            axes.set_axis_off()

        lines = iter(markdown.splitlines())
        for line in lines:
            text = line if line.startswith("    ") else _without_marks(line)
            mark = next((mark for mark in HEADINGS if line.startswith(mark)), None)
            if mark is not None:
                y -= 0.12
                put(text.removeprefix(mark), HEADINGS[mark], 1.0, weight="bold")
            elif line.startswith("!["):
                show(figures[line.rpartition("(")[2].removesuffix(".png)")])
            elif line.startswith("|"):
                for head, *rows in _on_paper([line, *takewhile(lambda one: one.startswith("|"), lines)]):
                    turned(LINE * CELLS * sum(map(len, [head, *rows[:1]])))
                    for k, row in enumerate(rows):
                        begun = turned(LINE * CELLS * len(row)) or k == 0
                        for one in head * begun + row:
                            put(one, CELLS, family="monospace")
                y -= 0.1
            else:
                for part in textwrap.wrap(text, 108) or [""]:
                    put(part, TEXT)
        pdf.savefig(page)


def _without_marks(line: str) -> str:
    """What Markdown means, but for how it looks."""
    return html.unescape(re.sub(r"[*`]|\[(.*?)\]\(.*?\)", r"\1", line))


def _on_paper(rows: Sequence[str]) -> Iterator[list[list[str]]]:
    """A table as wide as the page: cells are broken into lines, wide tables into parts.

    Each part begins with the first column. It is a list of rows, the head first, of so many lines each.
    """
    cells = [[_without_marks(cell.strip()) for cell in row.strip("|").split(" | ")] for row in rows]
    del cells[1]
    columns = list(zip(*cells, strict=True))
    least = [max(len(word) for cell in column for word in cell.split(" ")) for column in columns]
    parts = [[0]]
    for k in range(1, len(columns)):
        if sum(least[i] + 2 for i in [*parts[-1], k]) > ACROSS and len(parts[-1]) > 1:
            parts.append([0])
        parts[-1].append(k)
    for part in parts:
        widths = {k: max([1, *map(len, columns[k])]) for k in part}
        while sum(widths.values()) + 2 * len(part) > ACROSS:  # the one that has most to give, gives
            widest = max(part, key=lambda k: (widths[k] - least[k], widths[k]))
            widths[widest] -= 1
        made = [
            [
                "  ".join(word.ljust(w) for word, w in zip(line, widths.values(), strict=True))
                for line in zip_longest(*(textwrap.wrap(row[k], widths[k]) for k in part), fillvalue="")
            ]
            for row in cells
        ]
        made[0].append("  ".join("-" * w for w in widths.values()))
        yield made
