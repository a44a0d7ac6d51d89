"""Erosion profiles: stability, integrity and smallest shocks of every well over a parameter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fastmech.objects import spaced
from fastmech.plots import style
from fastmech.results import Dataset

#: Between the values of the parameter where a well comes or goes.
EVENT = "#eeeeee"

#: Of the share of undecided starts.
GREY = "#7f7f7f"

#: Of intervals: how opaque they are, in the last digits of a colour.
PALE = "4d"

#: Ends of the axis of shares [%]: a line at either end of what there can be is seen whole.
SHARES = (-4.0, 104.0)

#: Panels below the shares: title, ordinate, and measures by a solid and by a dashed line, with their names.
SIZES = (
    (
        "Largest ball in the basin, in the kinetic-energy norm",
        "radius",
        {"lim": "about the well: local integrity measure", "factor": "anywhere: integrity factor"},
    ),
    (
        "Smallest shock that makes it end elsewhere, in the same norm",
        "size",
        {"shock": "of all states", "kick": "of the rates alone"},
    ),
)

#: Lines of the measures of a panel.
LOOKS = ("-o", "--s")

UNDECIDED = "radius, if all undecided starts ended there"


@style.style()
def draw_erosion(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, style.Figure]:
    """Picture of a dataset of the scan type ``erosion`` about the scene with these parameters."""
    name = str(dataset.attrs["along"])
    figure = style.new_figure(8.2, 10.0)
    panels = figure.subplots(3, 1, sharex=True)
    handles = draw_stability(panels[0], dataset)
    panels[0].set(xlabel="", title="Basin stability: random starts in the window")
    for axes, (title, size, measures) in zip(panels[1:], SIZES, strict=True):
        for well in range(dataset.sizes["well"]):
            for measure, line in zip(measures, LOOKS, strict=True):
                _line(axes, dataset, well, measure, line)
        _mark_events(axes, dataset)
        units = {dataset[f"well_{measure}"].units for measure in measures}
        axes.set_title(title, pad=24.0)
        axes.set_ylabel(style.with_unit(size, units.pop()))
        axes.set_ylim(bottom=0.0)
        named = zip(measures.values(), LOOKS, strict=True)
        own = [style.entry(text, ls=line[:-1], marker=line[-1], ms=5) for text, line in named]
        axes.legend(handles=own, loc="lower center", bbox_to_anchor=(0.5, 0.98), ncols=2)
    panels[-1].set_xlabel(_along(dataset, name))
    lines = [line for axes in panels[1:] for line in axes.lines if np.size(line.get_xdata())]
    looks: dict[str, dict[str, Any]] = {
        "limited by the window": {"marker": "os", "mfc": style.paper(), "ms": 5, "ls": "none"},
        "smaller one tried is undecided": {"marker": "x", "ms": 6, "ls": "none"},
        UNDECIDED: {"marker": "^", "mfc": style.paper(), "ms": 6, "ls": ":"},
    }
    seen = {line.get_marker() for line in lines if line.get_linestyle() == "None"}
    for text, look in looks.items():
        if marker := next((mark for mark in look["marker"] if mark in seen), ""):
            handles.append(style.entry(text, **look | {"marker": marker}))
    style.legend_below(figure, handles)
    style.suptitle(figure, _title(dataset, scene, name))
    return {"profile": figure}


def draw_stability(axes: style.Axes, dataset: Dataset) -> list[style.Artist]:
    """Draw the wells' shares of the starts; returns the legend's entries."""
    from matplotlib.colors import to_hex

    name, measures = str(dataset.attrs["along"]), ("stability", "lower", "upper", "undecided")
    x, colors = dataset[name].data, {k: to_hex(style.color(k)) for k in range(dataset.sizes["well"])}
    for well, color in colors.items():
        share, lower, upper, undecided = (100.0 * dataset[f"well_{one}"].data[:, well] for one in measures)
        broken, low, high = _broken(dataset, x, lower, upper)
        axes.fill_between(broken, low, high, color=f"{color}{PALE}", lw=0)
        axes.plot(*_broken(dataset, x, share), color=color, marker="o", ms=4)
        axes.plot(*_broken(dataset, x, share + undecided), color=color, lw=1.0, ls=":")
        for k in _alone(dataset, share):
            axes.vlines(x[k], lower[k], upper[k], color=f"{color}{PALE}", lw=6.0)
            axes.vlines(x[k], share[k], share[k] + undecided[k], color=color, lw=1.0, ls=":")
    axes.set(xlabel=_along(dataset, name), ylabel="share of the starts [%]", ylim=SHARES)
    known = dataset["well_stability"].data
    all_of_them = ": all starts come to the well" * bool((known[np.isfinite(known)] == 1.0).all())
    axes.set_title(f"Basin stability along {name}{all_of_them}")
    look: dict[str, Any]
    wells = [style.entry(_name(dataset, well), color=color, lw=3.0) for well, color in colors.items()]
    band = "band in a line's colour: 95 % Wilson interval, undecided starts as none or all"
    wells.append(style.swatch(band, f"{style.color(0)}{PALE}"))
    if np.nansum(dataset["well_undecided"].data):
        wells.append(style.entry("if all undecided starts ended there", lw=1.0, ls=":", color=style.color(0)))
        look = {"color": GREY, "marker": "x", "ms": 4, "lw": 1.0}
        axes.plot(x, 100.0 * np.fmax.reduce(dataset["well_undecided"].data, axis=1), **look)
        wells.append(style.entry("undecided starts, which each well may have", **look))
    if "out_of_range" in dataset:
        look = {"color": style.ink(), "marker": "v", "ms": 4, "lw": 1.0}
        axes.plot(x, 100.0 * dataset["out_of_range"].data, **look)
        wells.append(style.entry("starts that leave their range and end in no well", **look))
    return [*wells, *_mark_events(axes, dataset)]


def _along(dataset: Dataset, name: str) -> str:
    greek = {"alpha": "α", "beta": "β"}.get(name, name)
    about = str(dataset[name].long_name)
    told = "" if about.startswith("parameter of") else f"{about}, "
    return told + style.with_unit(greek, dataset[name].units)


def _name(dataset: Dataset, well: int) -> str:
    """A well's number or name, the values between which it was found, and its place at first, if known."""
    name = str(dataset.attrs["along"])
    head = dataset.attrs.get("well_names", [f"well {k}" for k in range(well + 1)])[well]
    there = np.isfinite(dataset["well_stability"].data[:, well])
    values = dataset[name].data[there]
    if not values.size:
        return f"{head}: not at these values"
    text = f"{head}, found at values from {values[0]:.4g} to {values[-1]:.4g}{spaced(dataset[name].units)}"
    known = {q: f"position_{q}" for q in style.coordinates_of(dataset) if f"position_{q}" in dataset}
    first = [float(dataset[of].data[there, well][0]) for of in known.values()]
    place = style.place([*known], first, [dataset[of].units for of in known.values()]) if known else ""
    return text + f", at first {place}" * bool(place)


def _events(dataset: Dataset) -> np.ndarray:
    """Indices of the values since which a well has come or gone."""
    there = np.isfinite(dataset["well_stability"].data)
    return np.flatnonzero((there[1:] != there[:-1]).any(axis=1)) + 1


def _broken(dataset: Dataset, *lines: np.ndarray) -> list[np.ndarray]:
    """Lines that break where a well comes or goes."""
    return [np.insert(line.astype(np.float64), _events(dataset), np.nan) for line in lines]


def _alone(dataset: Dataset, line: np.ndarray) -> np.ndarray:
    """Indices of values with no neighbour on their line."""
    events, there = _events(dataset), np.isfinite(line)
    begins = np.append(True, ~there[:-1]) | np.isin(np.arange(line.size), events)
    ends = np.append(~there[1:], True) | np.isin(np.arange(line.size) + 1, events)
    return np.flatnonzero(there & begins & ends)


def _mark_events(axes: style.Axes, dataset: Dataset) -> list[style.Artist]:
    """Where a well comes or goes; returns the legend's entry."""
    x = dataset[str(dataset.attrs["along"])].data
    for k in _events(dataset):
        axes.axvspan(x[k - 1], x[k], color=EVENT, lw=0, zorder=0)
    return [style.swatch("a well comes or goes in between", EVENT)] * bool(_events(dataset).size)


def _line(axes: style.Axes, dataset: Dataset, well: int, measure: str, look: str) -> None:
    x, name = dataset[str(dataset.attrs["along"])].data, f"well_{measure}"
    y, color, hollow = dataset[name].data[:, well], style.color(well), style.paper()
    axes.plot(*_broken(dataset, x, y), look, color=color, ms=5)
    if f"{name}_at_window" in dataset:
        cut = dataset[f"{name}_at_window"].data[:, well].astype(np.bool_)
        axes.plot(x[cut], y[cut], look[-1], color=color, mfc=hollow, ms=5)
    if f"{name}_at_most" in dataset:
        most = dataset[f"{name}_at_most"].data[:, well]
        more = most > y
        axes.vlines(x[more], y[more], most[more], color=color, lw=1.0, ls=":")
        axes.plot(x[more], most[more], "^", color=color, mfc=hollow, ms=6)
    if f"{name}_undecided" in dataset:
        first = dataset[f"{name}_undecided"].data[:, well]
        early = np.isfinite(first) & ~(first >= y)
        axes.plot(x[early], first[early], "x", color=color, ms=6)


def _title(dataset: Dataset, scene: Mapping[str, float], name: str) -> str:
    held = style.setting_of(dataset.attrs, {key: value for key, value in scene.items() if key != name})
    title = f"Erosion of the wells along {name}, {held}"
    if "axes" not in dataset.attrs:  # what fm.erosion's object saves itself tells no window
        return title
    spans = []
    for axis in dataset.attrs["axes"]:
        low, high = dataset.attrs[f"window_{axis}"]
        place = f"position_{axis.removesuffix('_dot')}"  # older files have the paper's coordinates alone
        unit = (dataset[place].units if place in dataset else "rad") + "/s" * axis.endswith("_dot")
        spans.append(f"{style.symbol(axis)} from {low:.3g} to {high:.3g} {unit}")
    runs = f"; runs\xa0to\xa0{dataset.attrs['t_end']:g}\xa0s" if "t_end" in dataset.attrs else ""
    return f"{title}\nwindow: {', '.join(spans)}{runs}"
