"""What became of disturbances: single ones, random ones, and those of every equilibrium over parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Flags, Floats
from fastmech.plots import style
from fastmech.plots.equilibria import SHAPES
from fastmech.plots.map_view import View, make_view
from fastmech.results import Dataset

UNSTABLE = ("still at an unstable one", "#8c8c8c")
LEFT_OVER = {
    "at_saddle": UNSTABLE,
    "at_unstable": UNSTABLE,  # in older files
    "undecided": ("not decided", "#d0d0d0"),
}
#: Outcomes that tell nothing of the motion, in words.
FAILED = {
    name: name.replace("_", " ")
    for name in ("not_finite", "step_too_large", "not_converged", "start_not_finite")
}
#: Colour of outcomes that only another version knows.
UNKNOWN = "#b3a2c7"
#: What a picture of outcomes cannot show without a variable, the one that leaves out most first.
NOT_KEPT = {
    "end_equilibrium": "(which other equilibrium was not kept)",
    "turns": "(full turns on the way to another equilibrium were not kept)",
}
#: Without ``end_equilibrium``; yellow is no equilibrium's colour.
ANOTHER = ("rest at another, or full turns further", {"color": style.PALETTE["yellow"]})
BOX = (0.05, 0.25, 0.5, 0.75, 0.95)
SHOWN_QUANTILES = (0.5, 0.95, 0.99)

#: Points of a cumulative distribution and of a strip: more cannot be told apart.
POINTS = 1001


@style.style()
def draw_disturbed(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, style.Figure]:
    """Outcomes, times to return, excursions and the linearized motion's range; those of a map over it."""
    dataset = dataset.merged
    if "axes" in dataset.attrs:
        return _draw_map(dataset, scene)
    if not dataset.sizes["equilibrium"]:
        return {}
    names = style.coordinates_of(dataset)
    pictures = {
        "outcomes": (_outcomes, {"outcome"}),
        "time_to_return": (_time_to_return, {"time_to_return"}),
        "excursions": (_excursions, {f"excursion_{name}" for name in names}),
        "linear_range": (_linear_range, {"linear_limit"}),
    }
    figures = {name: draw(dataset) for name, (draw, needed) in pictures.items() if needed <= set(dataset)}
    told = f"{_about(dataset)}\n{style.setting_of(dataset.attrs, scene)}"
    for figure in figures.values():
        style.suptitle(figure, told)
    return figures


def _about(dataset: Dataset) -> str:
    """What was run."""
    attrs, unit = dataset.attrs, dataset[style.coordinates_of(dataset)[-1]].units
    sizes = dataset["disturbance_radius"].data if "disturbance_radius" in dataset else attrs["radius"]
    size = " or ".join(dict.fromkeys(f"{one:.3g}" for one in np.unique(sizes)))
    return (
        f"{attrs['trajectories']:,} disturbances up to {size} {unit} of each equilibrium, "
        f"runs\xa0to\xa0{attrs['t_end']:g}\xa0s"
    )


def _outcomes(dataset: Dataset) -> style.Figure:
    figure, axes = _rows_of_equilibria(dataset, 0.7)
    names = style.equilibrium_names(dataset)
    for row in range(len(names)):
        left = 0.0
        for share, label, look in _segments(dataset, row):
            known = label in axes.get_legend_handles_labels()[1]
            look = {"height": 0.62, "edgecolor": style.paper(), **look}
            axes.barh(row, share, left=left, label=None if known else label, **look)
            if share >= 8.0:
                dark = look["color"] in (style.LINES[0], style.LINES[1], style.LINES[2])
                box = {"facecolor": look["color"], "edgecolor": "none", "pad": 1.5}
                text: Any = {"ha": "center", "va": "center", "color": "white" if dark else "black"}
                axes.text(left + share / 2, row, f"{share:.3g} %", bbox=box, **text)
            left += share
        _beside(axes, row, _failed(dataset, row))
    axes.set(xlim=(0.0, 100.0), xlabel="share of the disturbed trajectories [%]")
    axes.grid(visible=False)
    elsewhere = (dataset["outcome"].data == dataset["outcome"].codes["elsewhere"]).any()
    kept = {"turns" if name.startswith("turns_") else name for name in dataset}
    unknown = [text for name, text in NOT_KEPT.items() if elsewhere and name not in kept]
    axes.set_title("\n".join(["Where disturbances of each equilibrium end", *unknown[:1]]))
    labelled = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    order = sorted(labelled, key=lambda label: (not label.startswith("rest"), label))
    style.legend_below(figure, [labelled[label] for label in order], 3)
    return figure


def _failed(dataset: Dataset, row: int) -> str:
    """How much of an equilibrium's bar is missing, and why; empty where nothing has failed."""
    codes, outcome = dataset["outcome"].codes, dataset["outcome"].data[row]
    counts = {text: np.count_nonzero(outcome == codes[name]) for name, text in FAILED.items()}
    lines = [f"{100.0 * count / outcome.size:.3g} % {text}" for text, count in counts.items() if count]
    return "\n".join(["failed, no end known:", *lines]) if lines else ""


def _segments(dataset: Dataset, row: int) -> list[tuple[float, str, dict[str, Any]]]:
    """Share [%], label and look of each part of an equilibrium's bar; who has failed has none."""
    codes = dataset["outcome"].codes
    outcome = dataset["outcome"].data[row]
    elsewhere = outcome == codes["elsewhere"]
    parts = [(outcome == codes["returned"], f"rest at {row}", {"color": style.color(row)})]
    if "end_equilibrium" in dataset:
        parts += _resting_elsewhere(dataset, row, elsewhere)
    else:
        parts.append((elsewhere, *ANOTHER))
    parts += [(outcome == codes[name], label, {"color": grey}) for name, (label, grey) in LEFT_OVER.items()]
    parts += [
        (outcome == codes[name], name.replace("_", " "), {"color": UNKNOWN})
        for name in codes.others({"returned", "elsewhere", *LEFT_OVER, *FAILED})
    ]
    return [(100.0 * float(np.mean(where)), label, look) for where, label, look in parts if where.any()]


def _resting_elsewhere(
    dataset: Dataset, row: int, elsewhere: Flags
) -> list[tuple[Flags, str, dict[str, Any]]]:
    """Those at rest at each other equilibrium, or at their own some turns further."""
    end = dataset["end_equilibrium"].data[row]
    # Elsewhere and yet at its own equilibrium is full turns further, known without the turns themselves.
    turns = [dataset[name].data[row] for name in dataset if name.startswith("turns_")]
    turned = np.any(turns, axis=0) if turns else end == row
    parts: list[tuple[Flags, str, dict[str, Any]]] = []
    for other in range(dataset.sizes["equilibrium"]):
        there = elsewhere & (end == other)
        further = {"color": style.color(other), "hatch": "//"}
        parts.append((there & ~turned, f"rest at {other}", {"color": style.color(other)}))
        parts.append((there & turned, f"rest at {other}, full turns further", further))
    return parts


def _time_to_return(dataset: Dataset) -> style.Figure:
    figure, axes = style.new_panel(7.2, 4.8)
    marked = [int(np.argmin(np.abs(dataset["quantile"].data - q))) for q in SHOWN_QUANTILES]
    level = dataset["quantile"].data[marked]
    share = np.linspace(0.0, 1.0, POINTS)
    for row, name in enumerate(style.equilibrium_names(dataset)):
        every = dataset["time_to_return"].data[row]
        times = every[np.isfinite(every)]
        if not times.size:
            continue
        at = dataset["time_to_return_quantile"].data[row, marked]
        texts = ", ".join(f"{100 * q:g} %: {_seconds(time)}" for q, time in zip(level, at, strict=True))
        returned = float(dataset["share_returned"].data[row])
        label = f"{name}, {_returned(dataset, row)} return\n(marks: {texts})"
        # Who returns after the run's end counts, so that a curve may end below 100 %.
        known = 100.0 * min(1.0, times.size / (returned * every.size))
        look: Any = {"color": style.color(row), "marker": SHAPES[row % len(SHAPES)], "mfc": "none", "ms": 9}
        axes.plot(np.quantile(times, share), known * share, color=style.color(row))
        axes.plot(at, 100.0 * level, ls="none", mew=1.6, **look)
        axes.plot([], [], label=label, mew=1.6, **look)
    axes.set(xlabel="time to return t [s]", ylabel="share of those that return [%]", ylim=(0.0, 103.0))
    axes.set_xlim(left=0.0)
    if axes.lines:
        style.legend_below(figure, axes, 1)
    else:
        style.message(axes, "no trajectory was back by the end of the run")
    axes.set_title("Time after which a disturbed trajectory stays near its equilibrium")
    return figure


def _seconds(time: float) -> str:
    return f"{time:.3g} s" if np.isfinite(time) else "later"


def _returned(dataset: Dataset, row: int) -> str:
    """Share that returns, as a range where not every end is known."""
    share = 100.0 * float(dataset["share_returned"].data[row])
    most = share
    if "share_returned_at_most" in dataset:
        most = 100.0 * float(dataset["share_returned_at_most"].data[row])
    return f"{share:.3g} %" if most == share else f"{share:.3g} to {most:.3g} %"


def _excursions(dataset: Dataset) -> style.Figure:
    figure, axes = _rows_of_equilibria(dataset, 0.85)
    names = style.coordinates_of(dataset)
    units = {dataset[name].units for name in names}
    for column, name in enumerate(names):
        shift = 0.36 * (column - 0.5 * (len(names) - 1)) / max(1, len(names) - 1)
        told = style.with_unit(style.symbol(name), "1" if len(units) == 1 else dataset[name].units)
        for row, values in enumerate(dataset[f"excursion_{name}"].data):
            values = values[np.isfinite(values)]
            if values.size:
                _box(axes, row + shift, np.quantile(values, BOX), style.LINES[column])
                axes.plot(values.max(), row + shift, "|", color=style.LINES[column], ms=9, mew=2)
        axes.plot([], [], "s", color=style.LINES[column], label=f"largest departure of {told}")
    axes.plot([], [], "|", color=style.ink(), mew=2, ms=9, label="median")
    axes.set(xscale="log", xlabel=f"excursion [{units.pop()}]" if len(units) == 1 else "excursion")
    style.logarithmic(axes.xaxis)
    axes.set_title("How far trajectories go (box: 25-75 %, line: 5-95 %, coloured tick: the farthest)")
    style.legend_below(figure, axes, 3)
    return figure


def _linear_range(dataset: Dataset) -> style.Figure:
    figure, axes = _rows_of_equilibria(dataset, 0.85)
    limit = dataset["linear_limit"].data
    tolerance, horizon = dataset.attrs["linear_tolerance"], dataset.attrs["linear_horizon"]
    positive = limit[limit > 0.0]
    low, high = (positive.min(), positive.max()) if positive.size else (1e-3, np.pi)
    for row, ordered in enumerate(limit):
        # NaN stands for more than the largest size tried, 0 for less than the smallest.
        beyond, never = 100.0 * np.mean(np.isinf(ordered)), 100.0 * np.mean(ordered == 0.0)
        told = {"above": beyond, "below": never}
        lines = [f"{part:.3g} % {where} all tried sizes" for where, part in told.items() if part]
        _beside(axes, row, "\n".join(lines))
        if 100.0 in (beyond, never):
            continue
        shown = np.clip(ordered[:: -(-ordered.size // POINTS)], 0.9 * low, 1.1 * high)
        jitter = np.random.default_rng(row).uniform(0.22, 0.42, shown.size)
        axes.plot(shown, row + jitter, ".", color=style.LINES[5], ms=3)
        # The lower value at each quantile, because no mean can be taken with infinity.
        quantiles = np.quantile(ordered, BOX, method="lower")
        _box(axes, row, np.clip(quantiles, 0.9 * low, 1.1 * high), style.LINES[0])
    unit = dataset["linear_limit"].units
    axes.set(xscale="log", xlabel=f"size of the disturbance, kinetic-energy norm [{unit}]")
    style.logarithmic(axes.xaxis)
    axes.set_title(
        f"Size up to which the linearized motion is within {100.0 * tolerance:g} % for {horizon:g} s\n"
        "(dots: directions, box: 25-75 %, line: 5-95 %)"
    )
    return figure


def _rows_of_equilibria(dataset: Dataset, height: float) -> tuple[style.Figure, style.Axes]:
    """A figure with a row for each equilibrium, the first on top."""
    names = style.equilibrium_names(dataset)
    figure, axes = style.new_panel(8.4, height * len(names) + 1.9)
    axes.set_yticks(range(len(names)), [name.replace(", ", ",\n", 1) for name in names])
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.grid(visible=False, axis="y")
    return figure, axes


def _beside(axes: style.Axes, row: int, text: str) -> None:
    axes.annotate(text, (1.01, row), xycoords=("axes fraction", "data"), va="center", fontsize=9)


def _box(axes: style.Axes, place: float, quantiles: Floats, color: str) -> None:
    names = ("whislo", "q1", "med", "q3", "whishi")
    axes.bxp(
        [dict(zip(names, quantiles, strict=True), fliers=[])],
        positions=[place],
        widths=0.28,
        orientation="horizontal",
        manage_ticks=False,
        showfliers=False,
        patch_artist=True,
        boxprops={"facecolor": color, "alpha": 0.55, "edgecolor": color},
        medianprops={"color": style.ink(), "linewidth": 2.0},
        whiskerprops={"color": color},
        capprops={"color": color},
    )


#: Sheets of a picture at most, those of the lowest numbers: the stable ones first, the largest first.
MOST_SHEETS = 4

#: Colours where there is no value, and of times later than the run's end; the mark of what is not whole.
ABSENT, LATER, UNTOLD = "#e3e3e3", style.PALETTE["vermillion"], "x"

ABOUT_UNTOLD = "failed numerically in part, or not computed"

KINDS = {0: "stable", 1: "saddle", 2: "maximum"}


#: A quantity over the parameters and the sheets shown: what it is, values, and its name with unit.
Quantity = tuple[str, Floats, str]


def _draw_map(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, style.Figure]:
    view = make_view(dataset, scene)
    every = np.arange(dataset.sizes["sheet"])
    stable = every[dataset["sheet_morse_index"].data == 0]
    median, late = (int(np.argmin(np.abs(dataset["quantile"].data - q))) for q in (0.5, 0.95))
    share, most = (100.0 * view.floats(f"share_returned{end}") for end in ("", "_at_most"))
    shares = [("proved to return", share, "share that returns [%]")]
    if (most > share).any():
        shares.append(("if all undecided returned", most, "share that returns [%]"))
    time = view.floats("time_to_return_quantile")
    times = [("median time to return", time[..., median], "time [s]")]
    times.append(("95 % are back after", time[..., late], "time [s]"))
    excursions = [
        (f"largest departure of {style.symbol(n)}", view.floats(f"largest_excursion_{n}"), "excursion [rad]")
        for n in style.ANGLES
    ]
    rows = {
        "share_returned": (stable, shares),
        "time_to_return": (stable, times),
        "excursions": (every, excursions),
    }
    figures = {}
    for name, (sheets, fields) in rows.items():
        if sheets.size:
            shown = sheets[:MOST_SHEETS]
            draw = _lines if len(view.axes) == 1 else _panels
            figures[name] = draw(view, name, shown, [(t, f[..., shown], label) for t, f, label in fields])
    return figures


def _panels(view: View, name: str, sheets: NDArray[np.int_], fields: list[Quantity]) -> style.Figure:
    """A row for each field, a column for each sheet."""
    figure = style.new_figure(2.2 + 3.5 * len(sheets), 1.7 + 3.0 * len(fields))
    panels = figure.subplots(len(fields), len(sheets), squeeze=False, sharex=True, sharey=True)
    (x, y), untold = map(view.axis, view.axes), _untold(view, sheets)
    for row, (title, field, label) in zip(panels, fields, strict=True):
        look = _look(name, field)
        for k, axes in enumerate(row):
            axes.set_facecolor(ABSENT)
            # Infinity is beyond every colour, and so has the one for that.
            shown = np.ma.masked_where(np.isnan(field[..., k]), np.minimum(field[..., k], 1e300))
            mesh = style.shade(axes, x, y, shown, **look)
            if untold[..., k].any():
                i, j = np.nonzero(untold[..., k])
                axes.plot(x[i], y[j], UNTOLD, color=style.ink(), ms=5)
            axes.set(xlabel=view.label(view.axes[0]), ylabel=view.label(view.axes[1]))
            axes.label_outer()
            axes.set_title(f"{_name(view, sheets[k])}:\n{title}", fontsize=10.0)
            axes.grid(visible=False)
        if np.isfinite(field).any():
            bar = figure.colorbar(mesh, ax=list(row), label=label)
            if name != "share_returned" and not style.tell_one_value(bar):
                style.logarithmic(bar.ax.yaxis)
    absent = ~_there(view, sheets)
    handles: list[style.Artist] = []
    missing = any((np.isnan(field) & ~absent).any() for _, field, _ in fields)
    if absent.any() or missing:
        told = "no such equilibrium" + ", or no value" * missing
        handles.append(style.swatch(told, ABSENT, "#808080"))
    if any(np.isinf(field).any() for _, field, _ in fields):
        handles.append(style.swatch("later than the end of the run", LATER))
    if untold.any():
        handles.append(style.entry(ABOUT_UNTOLD, marker=UNTOLD, ms=5, ls="none"))
    if handles:
        style.legend_below(figure, handles)
    style.suptitle(figure, _setting(view))
    return figure


def _lines(view: View, name: str, sheets: NDArray[np.int_], fields: list[Quantity]) -> style.Figure:
    """A panel for each field, a line for each sheet."""
    figure = style.new_figure(7.6, 1.9 + 2.7 * len(fields))
    panels = figure.subplots(len(fields), 1, squeeze=False, sharex=True)[:, 0]
    x, untold = view.axis(view.axes[0]), _untold(view, sheets)
    for axes, (title, field, label) in zip(panels, fields, strict=True):
        edge = axes.get_xaxis_transform()
        for k, sheet in enumerate(sheets):
            shown, color = np.where(np.isinf(field[:, k]), np.nan, field[:, k]), style.color(k)
            axes.plot(x, shown, "o-", ms=4, color=color, label=_name(view, sheet))
            if name == "share_returned" and title == fields[0][0]:
                low, high = (
                    100.0 * view.floats(f"share_returned_{end}")[:, sheet] for end in ("lower", "upper")
                )
                axes.fill_between(x, low, high, color=color, alpha=0.25, lw=0)
            for where, height, mark, own in (
                (np.isinf(field[:, k]), 0.97, "^", color), (untold[:, k], 0.04, UNTOLD, style.ink())
            ):  # fmt: skip
                if where.any():  # on the upper and on the lower edge
                    axes.plot(x[where], np.full(where.sum(), height), mark, color=own, transform=edge)
        if name == "share_returned":
            axes.set_ylim(0.0, 102.0)
        elif np.isfinite(field).any():
            axes.set_yscale("log")
            style.logarithmic(axes.yaxis)
        axes.set(ylabel=label)
        axes.set_title(title[0].upper() + title[1:])
    panels[-1].set_xlabel(view.label(view.axes[0]))
    if x.size > 1:
        panels[-1].set_xlim(x.min(), x.max())
    if any(np.isinf(field).any() for _, field, _ in fields):
        panels[0].plot([], [], "^", color="#808080", label="later than the end of the run")
    if untold.any():
        panels[0].plot([], [], UNTOLD, color=style.ink(), label=ABOUT_UNTOLD)
    style.legend_below(figure, panels[0], 2)
    band = "\nband: 95 % Wilson interval, undecided ones as none or all" if name == "share_returned" else ""
    style.suptitle(figure, _setting(view) + band)
    return figure


def _look(name: str, field: Floats) -> dict[str, Any]:
    """Colours: shares from 0 to 100 %, lengths and times by their logarithm."""
    from matplotlib import colormaps
    from matplotlib.colors import Normalize

    colors = colormaps[style.FIELD].with_extremes(over=LATER)
    if name == "share_returned":
        return {"cmap": colors, "norm": Normalize(0.0, 100.0)}
    known = field[np.isfinite(field) & (field > 0.0)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.1, 1.0)
    return {"cmap": colors, "norm": style.log_colors(low, high)}


def _untold(view: View, sheets: NDArray[np.int_]) -> Flags:
    """Where sheets have an equilibrium of which not all, or nothing, could be computed."""
    return _there(view, sheets) & ~(view.data("share_failed")[..., sheets] == 0.0)


def _there(view: View, sheets: NDArray[np.int_]) -> Flags:
    """Where sheets have an equilibrium."""
    return np.isfinite(view.data(style.coordinates_of(view.dataset)[0])[..., sheets])


def _name(view: View, sheet: int) -> str:
    """An equilibrium's number among those of a point, and its kind."""
    return f"equilibrium {sheet}, {KINDS[int(view.dataset['sheet_morse_index'].data[sheet])]}"


def _setting(view: View) -> str:
    more = view.dataset.sizes["sheet"] - MOST_SHEETS
    left_out = f"; {more} more equilibria in the file" if more > 0 else ""
    return f"{_about(view.dataset)}\n{view.setting}{left_out}"


#: What the variables of the two motions begin with.
MOTIONS = ("nonlinear", "linearized")


@style.style()
def draw_disturbed_motion(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, style.Figure]:
    """Pictures of a dataset of the scan type ``disturbed_motion``; none where there is no equilibrium."""
    if not dataset.sizes["equilibrium"]:
        return {}
    setting = style.setting_of(dataset.attrs, scene)
    figures = {"angles": _departures(dataset)}
    style.suptitle(figures["angles"], f"Disturbance of each coordinate\n{setting}")
    units = {dataset[name].units for name in style.coordinates_of(dataset)}
    if len(units) == 1:  # angles and lengths have no common size
        figures["norm"] = _norm(dataset, *units)
        style.suptitle(figures["norm"], f"Size of the disturbance of the coordinates\n{setting}")
    return figures


def _departures(dataset: Dataset) -> style.Figure:
    count, coordinates = dataset.sizes["equilibrium"], style.coordinates_of(dataset)
    figure = style.new_figure(4.2 * max(len(coordinates), 2), 1.9 * count + 0.8)
    panels = figure.subplots(count, len(coordinates), sharex=True, squeeze=False)
    for row, name in enumerate(style.equilibrium_names(dataset)):
        for column, angle in enumerate(coordinates):
            axes = panels[row, column]
            nonlinear, linearized = (dataset[f"{which}_{angle}"].data[row] for which in MOTIONS)
            _plot_pair(axes, dataset["time"].data, nonlinear, linearized)
            # The nonlinear motion sets the scale: an unstable linearized one would hide it.
            low, high = np.nanmin(nonlinear, initial=0.0), np.nanmax(nonlinear, initial=0.0)
            margin = 0.25 * (high - low) or 1.0
            axes.set_ylim(low - margin, high + margin)
            axes.set_ylabel(f"ξ of {style.symbol(angle)} [{dataset[angle].units}]")
        panels[row, 0].set_title(f"Equilibrium {name}", loc="left")
    for axes in panels[-1]:
        axes.set_xlabel(style.TIME)
    style.legend_below(figure, panels[0, 0], 2)
    return figure


def _norm(dataset: Dataset, unit: str) -> style.Figure:
    names = style.coordinates_of(dataset)
    nonlinear, linearized = (
        np.linalg.norm([dataset[f"{which}_{name}"].data for name in names], axis=0) for which in MOTIONS
    )
    rows = -(-len(nonlinear) // 2)
    figure = style.new_figure(8.4, 2.5 * rows + 0.5)
    panels = figure.subplots(rows, 2, sharex=True, squeeze=False)
    for axes in panels.flat[len(nonlinear) :]:
        axes.remove()
    for i, name in enumerate(style.equilibrium_names(dataset)):
        axes = panels.flat[i]
        _plot_pair(axes, dataset["time"].data, nonlinear[i], linearized[i])
        axes.set_yscale("log")
        # A linearized motion that grows leaves the picture: the nonlinear one sets the scale.
        known = nonlinear[i][nonlinear[i] > 0.0]
        if known.size:
            axes.set_ylim(known.min() / 3.0, 10.0 * known.max())
        style.logarithmic(axes.yaxis)
        axes.set_title(name, loc="left", fontsize=10)
        axes.set_ylabel(f"|ξ| [{unit}]")
        if i >= len(nonlinear) - 2:
            axes.set_xlabel(style.TIME)
            axes.tick_params(labelbottom=True)
    style.legend_below(figure, panels[0, 0], 2)
    return figure


def _plot_pair(axes: style.Axes, t: Floats, nonlinear: Floats, linearized: Floats) -> None:
    axes.plot(t, nonlinear, color=style.LINES[0], label="nonlinear")
    axes.plot(t, linearized, "--", color=style.LINES[1], lw=1.2, label="linearized")
