"""Tables 1 to 4 as pictures, printed beside computed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from fastmech.paper.compare import HEADINGS, Row, Verdict
from fastmech.plots.style import new_figure, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROW_HEIGHT = 0.27  #: inch

#: Widths of the columns: place, symbol, unit, printed, computed, difference, verdict.
WIDTHS = (0.10, 0.12, 0.10, 0.13, 0.16, 0.12, 0.27)
HEADING, SHADES = "#e6e6e6", {Verdict.MISPRINT: "#fbe3cf", Verdict.DIFFERS: "#f4b6a6"}


def draw_table(title: str, rows: Sequence[Row]) -> Figure:
    """One table of the paper, a line for each number; misprints are shaded."""
    from matplotlib.transforms import Bbox

    with style():
        figure = new_figure(9.4, 0.75 + ROW_HEIGHT * (len(rows) + 1))
        axes = figure.subplots()
        axes.axis("off")
        axes.set_title(title, loc="left")
        shades = [[SHADES.get(row.verdict, "#ffffff")] * len(WIDTHS) for row in rows]
        table = axes.table(
            cellText=[list(row.cells) for row in rows],
            cellColours=shades,
            colLabels=HEADINGS,
            colColours=[HEADING] * len(WIDTHS),
            colWidths=WIDTHS,
            bbox=Bbox.unit(),
            cellLoc="left",
            colLoc="left",
        )
        table.auto_set_font_size(False)
        table.set_fontsize(9.0)
        for (_, column), cell in table.get_celld().items():
            cell.set_edgecolor("#d0d0d0")
            if 3 <= column <= 5:
                cell.set_text_props(ha="right")
    return figure
