"""One motion in full: angles, points, reactions, energies and what the checks leave over."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fastmech.arrays import Floats
from fastmech.plots import style
from fastmech.results import Dataset

_REACTIONS = {
    "rod_om1": "Rod OM1, tension positive",
    "rod_m1m2": "Rod M1M2, tension positive",
    "rod_m1m3": "Rod M1M3, tension positive",
    "slider_normal": "Guide on the slider, upwards positive",
}

#: Dashes of several motions.
MOTIONS: tuple[Any, ...] = ("-", "--", "-.", ":", (0, (7, 1, 1, 1, 1, 1)), (0, (1, 4)))


@style.style()
def draw_motion(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, style.Figure]:
    """Pictures of a dataset of the scan type ``motion``."""
    names = style.coordinates_of(dataset)
    states = (*names, *(f"{name}_dot" for name in names))
    points = _points(dataset)
    at = [float(dataset[name].data[0]) for name in states]
    start = f"Motion from {style.place(states, at, [dataset[name].units for name in states], '.4g')}"
    figures = {"angles": _states(dataset, states)}
    if points:
        figures["coordinates"] = _coordinates(dataset, points)
    if set(_REACTIONS) <= set(dataset):
        figures["reactions"] = _reactions(dataset)
    figures |= {"energies": _energies(dataset), "residuals": _residuals(dataset, states)}
    left = [str(dataset.attrs["left_range"])] if "left_range" in dataset.attrs else []
    for figure in figures.values():
        style.suptitle(figure, "\n".join([start, style.setting_of(dataset.attrs, scene), *left]))
    return figures


def _states(dataset: Dataset, states: tuple[str, ...]) -> style.Figure:
    """A panel for each unit."""
    t = dataset["time"].data
    units = list(dict.fromkeys(dataset[name].units for name in states))
    figure, panels = _rows(len(units))
    for axes, unit in zip(panels, units, strict=True):
        draw_states(axes, t, {n: dataset[n].data for n in states if dataset[n].units == unit}, unit)
        _legend(axes)
    panels[0].set_title("Coordinates and their rates")
    return figure


def draw_states(axes: style.Axes, t: Floats, values: Mapping[str, Floats], unit: str, first: int = 0) -> None:
    """Draw states of one unit over time, each (times,) or (times, trajectories), in one look a state.

    Looks are counted from ``first``. Dashes tell up to six trajectories apart, and then not states.
    """
    for k, (name, states) in enumerate(values.items(), first):
        look: Any = {"color": style.color(k), "ls": ("-", "--", "-.", ":")[k % 4]}
        look["marker"] = "o" if t.size == 1 else ""
        line, *others = axes.plot(t, states, **look)
        line.set_label(style.symbol(name))
        if 0 < len(others) < len(MOTIONS):
            for one, dashes in zip([line, *others], MOTIONS, strict=False):
                one.set_linestyle(dashes)
    kind = style.KINDS.get(unit, "rate" if "/s" in unit else "state")
    axes.set_ylabel(kind if unit == "1" else f"{kind} [{unit}]")


def _points(dataset: Dataset) -> dict[str, tuple[str, str | None]]:
    """Names of moving points with the variables of their coordinates; one that is None stays 0."""
    if "x1" in dataset:
        return {"M1": ("x1", "y1"), "M2": ("x2", "y2"), "M3": ("x3", None)}
    found = [name.removesuffix("_x") for name in dataset if name.startswith("point_") and name.endswith("_x")]
    return {name.removeprefix("point_"): (f"{name}_x", f"{name}_y") for name in found}


def _coordinates(dataset: Dataset, points: dict[str, tuple[str, str | None]]) -> style.Figure:
    t = dataset["time"].data
    figure = style.new_figure(7.2, 7.4)
    over_time, paths = figure.subplots(2, 1, height_ratios=[1.0, 1.3])
    for point, (along, up) in points.items():
        for axis, name, line in (("x", along, "-"), ("y", up, "--")):
            if name is not None:
                over_time.plot(t, dataset[name].data, line, label=f"{axis} of {point}")
        if up is None:
            continue
        x, y = dataset[along].data, dataset[up].data
        (path,) = paths.plot(x, y, lw=1.2, label=f"path of {point}")
        paths.plot(x[0], y[0], "o", color=path.get_color(), mfc=style.paper(), label=f"start of {point}")
        paths.plot(x[-1], y[-1], "o", color=path.get_color(), label=f"end of {point}")
    over_time.set(xlabel=style.TIME, ylabel="coordinate [m]", title="Coordinates of the points")
    _legend(over_time)
    paths.set(xlabel="x [m]", ylabel="y [m]", title="Paths in the plane")
    paths.set_aspect("equal", adjustable="datalim")
    _legend(paths)
    return figure


def _reactions(dataset: Dataset) -> style.Figure:
    t = dataset["time"].data
    figure, panels = _rows(len(_REACTIONS), 1.9)
    for axes, (name, title) in zip(panels, _REACTIONS.items(), strict=True):
        values = dataset[name].data
        axes.plot(t, values)
        axes.set(ylabel="force [N]")
        axes.set_title(title, loc="left")
        if np.isfinite(values).any():
            _mark_extremes(axes, t, values)
    return figure


def _mark_extremes(axes: style.Axes, t: Floats, values: Floats) -> None:
    texts = []
    for name, i, marker in (("max", np.nanargmax(values), "^"), ("min", np.nanargmin(values), "v")):
        axes.plot(t[i], values[i], marker, color=style.ink(), ms=6)
        texts.append(f"{'▲' if name == 'max' else '▼'} {name} {values[i]:.4g} N at {t[i]:.3g} s")
    axes.set_title("    ".join(texts), loc="right", fontsize=9)
    axes.margins(y=0.12)


def _energies(dataset: Dataset) -> style.Figure:
    t = dataset["time"].data
    kinetic, potential = dataset["kinetic_energy"].data, dataset["potential_energy"].data
    figure, (energies, works) = _rows(2)
    energies.plot(t, kinetic, label="kinetic T")
    energies.plot(t, potential, "--", label="potential Π")
    energies.plot(t, kinetic + potential, "-.", label="T + Π")
    energies.set(ylabel="energy [J]", title="Energies, and what changes them")
    if "work_force" in dataset:
        works.plot(t, dataset["work_force"].data, label="force")
        works.plot(t, dataset["work_damper"].data, "--", label="damper")
        works.set(ylabel="work [J]")
    else:
        works.plot(t, dataset["power_loads"].data, label="brought by loads")
        works.plot(t, dataset["power_lost"].data, "--", label="lost")
        works.set(ylabel="power [W]")
    for axes in (energies, works):
        _legend(axes)
    return figure


def _residuals(dataset: Dataset, states: tuple[str, ...]) -> style.Figure:
    t = dataset["time"].data
    of_paper = "energy_residual" in dataset
    figure, panels = _rows(3 if of_paper else 1)
    for name in states:
        difference = dataset[f"formulation_difference_{name}"]
        _log_plot(panels[0], t, difference.data, f"{style.symbol(name)} [{difference.units}]")
    panels[0].set(ylabel="difference [SI]", title="Canonical equations minus Lagrange's")
    if of_paper:
        _, constraints, energy = panels
        for number, unit in {2: "m²", 3: "m²", 4: "m", 5: "m²"}.items():
            residual = dataset[f"constraint_residual_{number}"].data
            _log_plot(constraints, t, residual, f"({number}) [{unit}]")
        constraints.set(ylabel="residual [m²], [m]", title="Constraints, paper (2)-(5)")
        _log_plot(energy, t, dataset["energy_residual"].data, "[J]")
        energy.set(ylabel="residual [J]", title="Change of T + Π less the works of damper and force")
    for axes in panels:
        style.logarithmic(axes.yaxis)
    for axes in panels[:2]:
        _legend(axes)
    return figure


def _log_plot(axes: style.Axes, t: Floats, values: Floats, label: str) -> None:
    """Magnitudes on a logarithmic axis; exact zeros have no place there and are left out."""
    size = np.abs(values)
    size = np.where(size > 0.0, size, np.nan)
    axes.semilogy(t, size, ".", ms=2.0, label=label if np.isfinite(size).any() else f"{label}: all 0")


def _legend(axes: style.Axes) -> None:
    axes.legend(
        loc="center left", bbox_to_anchor=(1.0, 0.5), markerscale=2.0 if axes.get_yscale() == "log" else 1.0
    )


def _rows(count: int, height: float = 2.4) -> tuple[style.Figure, list[style.Axes]]:
    """A figure with panels over one axis of time."""
    figure = style.new_figure(7.2, count * height + 0.4)
    panels = list(figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0])
    panels[-1].set_xlabel(style.TIME)
    return figure, panels
