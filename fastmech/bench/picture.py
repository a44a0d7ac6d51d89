"""The work-precision picture: trajectories per second over the largest error, one panel a problem."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fastmech.bench.measure import frontier
from fastmech.bench.problem import PROBLEMS
from fastmech.plots.style import LINES, new_figure, save, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fastmech.bench.measure import Row

#: Errors [rad, rad/s] that the picture shows: larger ones answer nothing.
LARGEST, SMALLEST = 3e-2, 3e-15

GREY = "0.35"

#: Names of methods on the curve keep this ratio of errors between them.
APART = 20.0

#: Curves: what the family's name begins with, its label, marker; in the order of the colours.
CURVES = (
    ("fastmech", "fastmech, best method", "o"),
    ("heyoka", "heyoka batch", "s"),
    ("torch", "torch.compile, best step", "D"),
    ("CyRK", "CyRK", "^"),
    ("numbalsoda", "numbalsoda", "v"),
    ("diffrax", "diffrax", "P"),
    ("Numba RK4", "plain Numba RK4", "X"),
    ("SciPy", "SciPy, best solver", "*"),
)


def draw_bench(rows: list[Row], path: Path) -> None:
    """The fastest settings of every library on one thread; the package's own methods thin behind."""
    with style():
        figure = new_figure(11.0, 6.2)
        panels = figure.subplots(1, len(PROBLEMS), sharey=True, squeeze=False)[0]
        for axes, (name, make) in zip(panels, PROBLEMS.items(), strict=True):
            problem = make(1)
            mine = [row for row in rows if (row.problem, row.threads) == (name, 1)]
            _draw(axes, mine)
            axes.set(xscale="log", yscale="log", xlim=(LARGEST, SMALLEST))
            axes.set_title(f"{problem.description}, to {problem.t_end:g} s")
            axes.set_xlabel("largest error of a final state [rad, rad/s], smaller to the right")
        panels[0].set_ylabel("trajectories per second of one core")
        named: dict[str, Any] = {}
        for axes in panels:
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
                named.setdefault(label, handle)
        place: Any = "outside lower center"
        figure.legend(list(named.values()), list(named), loc=place, ncols=5, frameon=False)
        save(figure, path)


def _draw(axes: Axes, rows: list[Row]) -> None:
    for family in dict.fromkeys(row.family for row in rows if row.family.startswith("fastmech")):
        own = sorted(_shown(row for row in rows if row.family == family), key=lambda row: row.max_error())
        errors, rates = [row.max_error() for row in own], [row.rate for row in own]
        axes.plot(errors, rates, color="0.75", linewidth=0.8, label="fastmech, each method")
    for (prefix, label, marker), color in zip(CURVES, [*LINES, GREY], strict=True):
        best = frontier(_shown(row for row in rows if row.family.startswith(prefix)))
        if best:
            errors, rates = [row.max_error() for row in best], [row.rate for row in best]
            width = 2.4 if prefix == "fastmech" else 1.4
            axes.plot(errors, rates, marker=marker, color=color, linewidth=width, label=label)
            if prefix == "fastmech":
                _name_methods(axes, best, color)


def _name_methods(axes: Axes, best: list[Row], color: str) -> None:
    """Names above the curve, where the settings of a method begin that lie together on it."""
    last, named = 0.0, ""
    for name, rows in groupby(best, key=lambda row: row.family.split()[1].rstrip(",")):
        row = list(rows)[-1]
        if name != named and row.max_error() > last * APART:
            last, named = row.max_error(), name
            at = (last, row.rate)
            axes.annotate(name, at, (2, 7), textcoords="offset points", color=color, size=9)


def _shown(rows: Iterable[Row]) -> list[Row]:
    return [row for row in rows if SMALLEST < row.max_error() < LARGEST]
