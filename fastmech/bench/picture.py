"""The work-precision picture: trajectories per second over the largest error, one panel a problem."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from fastmech.bench.problem import PROBLEMS
from fastmech.plots.style import LINES, legend_below, new_figure, save, style

if TYPE_CHECKING:
    from fastmech.bench.measure import Row

_MARKERS = "osD^vPX*<>"


def draw_bench(rows: list[Row], path: Path) -> None:
    """One line for each integrator, one thread."""
    with style():
        figure = new_figure(11.0, 5.6)
        panels = figure.subplots(1, len(PROBLEMS), sharey=True, squeeze=False)[0]
        families = list(dict.fromkeys(row.family for row in rows))
        for axes, (name, make) in zip(panels, PROBLEMS.items(), strict=True):
            for i, family in enumerate(families):
                own = [r for r in rows if (r.problem, r.family, r.threads) == (name, family, 1)]
                axes.loglog(
                    [r.max_error for r in own],
                    [r.rate for r in own],
                    marker=_MARKERS[i % len(_MARKERS)],
                    color=LINES[i % len(LINES)],
                    linestyle="-" if family.startswith("fastmech") else "--",
                    label=family,
                )
            axes.set_title(make(1).description)
            axes.set_xlabel("largest error of a final state [rad, rad/s]")
            axes.invert_xaxis()
        panels[0].set_ylabel("trajectories per second, one thread")
        legend_below(figure, panels[0], 4)
        save(figure, path)
