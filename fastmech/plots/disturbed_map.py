"""Disturbed ensembles over parameters: what share returns, how long that takes, how far motions go."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fastmech.plots.labels import logarithmic
from fastmech.plots.map_view import View, make_view
from fastmech.plots.style import FIELD, LINES, PALETTE, legend_below, new_figure, style
from fastmech.results import Dataset

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

#: Sheets of a picture at most, those of the lowest numbers: the stable ones first, the largest first.
MOST_SHEETS = 4

#: Colours where there is no value, and of times later than the run's end; the mark of what is not whole.
ABSENT, LATER, UNTOLD = "#e3e3e3", PALETTE["vermillion"], "x"

ABOUT_UNTOLD = "failed numerically in part, or not computed"

KINDS = {0: "stable", 1: "saddle", 2: "maximum"}


def draw_disturbed_map(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
    """Pictures of a dataset of the scan type ``disturbed`` over parameters."""
    view = make_view(dataset, scene)
    every = np.arange(dataset.sizes["sheet"])
    stable = every[dataset["sheet_morse_index"].data == 0]
    median, late = (int(np.argmin(np.abs(dataset["quantile"].data - q))) for q in (0.5, 0.95))
    share = _percent(view, "share_returned")
    time = view.data("time_to_return_quantile").astype(np.float64)
    rows = {
        "share_returned": (stable, [("proved to return", share, "share that returns [%]")]),
        "time_to_return": (
            stable,
            [
                ("median time to return", time[..., median], "time [s]"),
                ("95 % are back after", time[..., late], "time [s]"),
            ],
        ),
        "excursions": (
            every,
            [
                (
                    f"farthest |{symbol} - {symbol} there|",
                    view.data(f"largest_excursion_{angle}").astype(np.float64),
                    "excursion [rad]",
                )
                for angle, symbol in (("phi", "φ"), ("theta", "θ"))
            ],
        ),
    }
    most = _percent(view, "share_returned_at_most")
    if (most > share).any():
        rows["share_returned"][1].append(("if all undecided returned", most, "share that returns [%]"))
    draw = _lines if len(view.axes) == 1 else _panels
    with style():
        return {
            name: draw(view, name, sheets[:MOST_SHEETS], fields)
            for name, (sheets, fields) in rows.items()
            if sheets.size
        }


def _panels(view: View, name: str, sheets: NDArray[np.int_], fields: list[tuple[str, Floats, str]]) -> Figure:
    """A row for each field, a column for each sheet."""
    figure = new_figure(2.2 + 3.5 * len(sheets), 1.7 + 3.0 * len(fields))
    panels = figure.subplots(len(fields), len(sheets), squeeze=False, sharex=True, sharey=True)
    x, y = (view.axis(axis) for axis in view.axes)
    for row, (title, field, label) in zip(panels, fields, strict=True):
        look = _look(name, field[..., sheets])
        for axes, sheet in zip(row, sheets, strict=True):
            axes.set_facecolor(ABSENT)
            # Infinity is beyond every colour, and so has the one for that.
            shown = np.ma.masked_where(np.isnan(field[..., sheet]), np.minimum(field[..., sheet], 1e300))
            mesh = axes.pcolormesh(x, y, shown.T, shading="nearest", rasterized=True, **look)
            untold = _untold(view, sheet)
            if untold.any():
                i, j = np.nonzero(untold)
                axes.plot(x[i], y[j], UNTOLD, color="black", ms=5, ls="none")
            axes.set(xlabel=view.label(view.axes[0]), ylabel=view.label(view.axes[1]))
            axes.label_outer()
            axes.set_title(f"{_name(view, int(sheet))}:\n{title}", fontsize=10.0)
            axes.grid(visible=False)
        if np.isfinite(field[..., sheets]).any():
            bar = figure.colorbar(mesh, ax=list(row), label=label)
            if name != "share_returned":
                logarithmic(bar.ax.yaxis)
    if handles := _marks(view, sheets, fields):
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
    _title(figure, _setting(view))
    return figure


def _lines(view: View, name: str, sheets: NDArray[np.int_], fields: list[tuple[str, Floats, str]]) -> Figure:
    """A panel for each field, a line for each sheet."""
    figure = new_figure(7.6, 1.9 + 2.7 * len(fields))
    panels = figure.subplots(len(fields), 1, squeeze=False, sharex=True)[:, 0]
    x = view.axis(view.axes[0])
    for axes, (title, field, label) in zip(panels, fields, strict=True):
        for k, sheet in enumerate(sheets):
            shown = np.where(np.isinf(field[..., sheet]), np.nan, field[..., sheet])
            axes.plot(x, shown, "o-", ms=4, color=LINES[k % len(LINES)], label=_name(view, int(sheet)))
            if name == "share_returned" and title == fields[0][0]:
                low, high = (
                    _percent(view, f"share_returned_{end}")[..., sheet] for end in ("lower", "upper")
                )
                axes.fill_between(x, low, high, color=LINES[k % len(LINES)], alpha=0.25, lw=0)
            later = x[np.isinf(field[..., sheet])]
            if later.size:  # on the upper edge
                look = {"color": LINES[k % len(LINES)], "transform": axes.get_xaxis_transform()}
                axes.plot(later, np.full(later.size, 0.97), "^", **look)
            untold = x[_untold(view, int(sheet))]
            if untold.size:  # on the lower edge
                at = axes.get_xaxis_transform()
                axes.plot(untold, np.full(untold.size, 0.04), UNTOLD, color="black", transform=at)
        if name == "share_returned":
            axes.set_ylim(0.0, 102.0)
        elif np.isfinite(field[..., sheets]).any():
            axes.set_yscale("log")
            logarithmic(axes.yaxis)
        axes.set(ylabel=label)
        axes.set_title(title[0].upper() + title[1:])
    panels[-1].set_xlabel(view.label(view.axes[0]))
    if x.size > 1:
        panels[-1].set_xlim(x.min(), x.max())
    if any(np.isinf(field[..., sheets]).any() for _, field, _ in fields):
        panels[0].plot([], [], "^", color="#808080", label="later than the end of the run")
    if any(_untold(view, int(sheet)).any() for sheet in sheets):
        panels[0].plot([], [], UNTOLD, color="black", label=ABOUT_UNTOLD)
    legend_below(figure, panels[0], 2)
    band = "\nband: 95 % Wilson interval, undecided ones as none or all" if name == "share_returned" else ""
    _title(figure, _setting(view) + band)
    return figure


def _title(figure: Figure, text: str) -> None:
    """Over all panels, in as many lines as it takes."""
    width = int(12 * figure.get_figwidth())
    figure.suptitle("\n".join(fill(line, width) for line in text.splitlines()), fontsize=10.0)


def _look(name: str, field: Floats) -> dict[str, Any]:
    """Colours: shares from 0 to 100 %, lengths and times by their logarithm."""
    from matplotlib import colormaps
    from matplotlib.colors import LogNorm, Normalize

    colors = colormaps[FIELD].with_extremes(over=LATER)
    if name == "share_returned":
        return {"cmap": colors, "norm": Normalize(0.0, 100.0)}
    known = field[np.isfinite(field) & (field > 0.0)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.1, 1.0)
    return {"cmap": colors, "norm": LogNorm(low, max(high, 1.001 * low))}


def _percent(view: View, name: str) -> Floats:
    return 100.0 * view.data(name).astype(np.float64)


def _untold(view: View, sheet: int) -> NDArray[np.bool_]:
    """Where a sheet has an equilibrium of which not all, or nothing, could be computed."""
    there = np.isfinite(view.data("phi")[..., sheet])
    return there & ~(view.data("share_failed")[..., sheet] == 0.0)


def _marks(view: View, sheets: NDArray[np.int_], fields: list[tuple[str, Floats, str]]) -> list[Artist]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Artist] = []
    absent = ~np.isfinite(view.data("phi")[..., sheets])
    if absent.any():
        handles.append(Patch(facecolor=ABSENT, edgecolor="#808080", label="no such equilibrium"))
    if any((np.isnan(field[..., sheets]) & ~absent).any() for _, field, _ in fields):
        handles[:] = [Patch(facecolor=ABSENT, edgecolor="#808080", label="no such equilibrium, or no value")]
    if any(np.isinf(field[..., sheets]).any() for _, field, _ in fields):
        handles.append(Patch(facecolor=LATER, label="later than the end of the run"))
    if any(_untold(view, int(sheet)).any() for sheet in sheets):
        handles.append(Line2D([], [], marker=UNTOLD, color="black", ms=5, ls="none", label=ABOUT_UNTOLD))
    return handles


def _name(view: View, sheet: int) -> str:
    """A sheet's number and kind."""
    return f"sheet {sheet}, {KINDS[int(view.dataset['sheet_morse_index'].data[sheet])]}"


def _setting(view: View) -> str:
    attrs = view.dataset.attrs
    more = view.dataset.sizes["sheet"] - MOST_SHEETS
    return (
        f"{attrs['trajectories']:,} disturbances up to {attrs['radius']:g} rad of each equilibrium, "
        f"runs to {attrs['t_end']:g} s\n{view.setting}"
    ) + (f"; {more} more sheets in the file" if more > 0 else "")
