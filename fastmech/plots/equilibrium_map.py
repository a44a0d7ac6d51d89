"""Equilibria over two parameters: how many, where, how deep the wells are and how fast motions settle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fastmech.plots.bifurcation import draw_bifurcation, draw_places
from fastmech.plots.labels import coordinates_of, flag_codes, quantity, symbol
from fastmech.plots.map_curves import draw_curves, not_proved
from fastmech.plots.map_view import View, make_view
from fastmech.plots.style import FIELD, PALETTE, new_figure, style
from fastmech.results import Dataset

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

#: Colours of counts, the same in both maps.
COUNT_COLORS = {
    0: "#bdbdbd",
    1: PALETTE["sky"],
    2: PALETTE["orange"],
    3: PALETTE["purple"],
    4: "#d5e3ec",
    5: PALETTE["green"],
    6: PALETTE["yellow"],
}

#: Half of the smallest range of a colour bar of angles [rad]: rounding shall not look like structure.
LEAST_SPAN = 1e-3

#: How many times the least decay time colours still tell; beyond, damping misses a mode.
SLOWEST = 1e4

#: What part of the deepest well colours still tell; towards a fold depths vanish.
SHALLOWEST = 1e-2

#: Marks of points whose count is not an ordinary proved one.
UNSETTLED = {"at_fold": "|", "degenerate": "x", "unproved": "+"}

_ORDER = ("deepest", "second", "third")


def draw_equilibrium_map(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
    """Pictures of a dataset of the scan type ``equilibrium_map`` about the scene with these parameters."""
    view = make_view(dataset, scene)
    with style():
        if len(view.axes) == 1:
            if not view.has(*coordinates_of(dataset)):
                return {}
            if "mechanism" in dataset.attrs:
                return {"branches": draw_places(view)} if view.has("verdict") else {}
            return {"branches": draw_bifurcation(view)} if view.has("morse_index") else {}
        figures = {}
        if view.has("count", "count_stable", "outcome"):
            figures["count"] = _counts(view)
        first, *others = coordinates_of(dataset)
        needed = (
            "count_stable",
            "energy",
            first,
            "verdict" if "mechanism" in dataset.attrs else "morse_index",
        )
        if not view.has(*needed) or not view.ranks:
            return figures
        if view.has(*others):
            figures["angles"] = _angles(view)
        if view.has("depth") and np.isfinite(view.stable(0, view.data("depth"))).any():
            figures["barrier"] = _barrier(view)
        if view.has("decay_time") and np.isfinite(view.stable(0, view.data("decay_time"))).any():
            figures["decay"] = _decay(view)
        return figures


def _counts(view: View) -> Figure:
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap, to_hex
    from matplotlib.patches import Patch

    figure = new_figure(9.6, 5.6)
    most = max(6, int(view.data("count").max()))
    more = colormaps["tab20c"](np.linspace(0.0, 1.0, max(1, most - 6)))
    looks = {**COUNT_COLORS, **{n: to_hex(more[n - 7]) for n in range(7, most + 1)}}
    colors = ListedColormap(list(looks.values()))
    for axes, name, title in zip(
        figure.subplots(1, 2),
        ("count", "count_stable"),
        ("Number of equilibria", "Number of stable equilibria"),
        strict=True,
    ):
        counts = view.data(name)
        axes.pcolormesh(
            *map(view.axis, view.axes), counts.T, cmap=colors, vmin=-0.5, vmax=most + 0.5, shading="nearest"
        )
        handles: list[Artist] = [
            Patch(color=looks[int(n)], label=f"{n} ({np.mean(counts == n):.1%})") for n in np.unique(counts)
        ]
        curves = draw_curves(axes, view)
        handles += _mark_unsettled(axes, view) + _mark_own(axes, view)
        axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=3)
        _label(axes, view, title)
    _finish(figure, view, curves)
    return figure


def _mark_unsettled(axes: Axes, view: View) -> list[Artist]:
    x, y = np.meshgrid(*map(view.axis, view.axes), indexing="ij")
    codes = flag_codes(view.dataset["outcome"])
    handles: list[Artist] = []
    for name, marker in {**dict.fromkeys(codes.others({"complete"}), "P"), **UNSETTLED}.items():
        where = view.data("outcome") == codes[name]
        if where.any():
            label = f"{name.replace('_', ' ')} ({np.count_nonzero(where)})"
            handles += axes.plot(x[where], y[where], marker, color="black", ms=5, label=label)
    return handles


def _mark_own(axes: Axes, view: View) -> list[Artist]:
    point = view.own()
    if point is None:
        return []
    return list(axes.plot(*point, "*", color="white", mec="black", ms=15, ls="none", label="the scene"))


def _angles(view: View) -> Figure:
    names = coordinates_of(view.dataset)
    figure = new_figure(1.6 + 4.6 * len(view.ranks), 0.4 + 3.8 * len(names))
    panels = figure.subplots(len(names), len(view.ranks), squeeze=False, sharex=True, sharey=True)
    for row, name in enumerate(names):
        fields = [view.stable(rank, view.data(name)) for rank in view.ranks]
        look = _angle_look(fields, view.dataset[name].units)
        for rank, field in enumerate(fields):
            axes = panels[row, rank]
            mesh = axes.pcolormesh(*map(view.axis, view.axes), field.T, shading="nearest", **look)
            curves = draw_curves(axes, view) + _mark_own(axes, view)
            _label(axes, view, f"{symbol(name)} of the {_ORDER[rank]} stable equilibrium")
        figure.colorbar(mesh, ax=panels[row, :], label=quantity(view.dataset, name))
    _finish(figure, view, curves + _nothing(view))
    return figure


def _angle_look(fields: list[Floats], unit: str) -> dict[str, object]:
    """Colours of an angle: cyclic where its values go round."""
    known = np.concatenate([field[np.isfinite(field)] for field in fields])
    if unit == "rad" and np.ptp(known) > 1.5 * np.pi:
        return {"cmap": "twilight", "vmin": -np.pi, "vmax": np.pi}
    middle, half = 0.5 * (known.min() + known.max()), max(0.5 * np.ptp(known), LEAST_SPAN)
    return {"cmap": FIELD, "vmin": middle - half, "vmax": middle + half}


def _barrier(view: View) -> Figure:
    """Depth of each well, and the impulse on M2 that a blow needs at least to leave it."""
    rows = [("depth", "Energy to leave the {} well", "depth [J]")]
    if view.has("shock_limit_m2"):
        rows.append(("shock_limit_m2", "No smaller blow on M2 leaves the {} well", "impulse on M2 [N s]"))
    figure = new_figure(0.6 + 5.4 * len(view.ranks), 1.4 + 4.2 * len(rows))
    panels = figure.subplots(len(rows), len(view.ranks), squeeze=False, sharex=True, sharey=True)
    handles: list[Artist] = []
    for row, (name, title, label) in zip(panels, rows, strict=True):
        for rank, axes in zip(view.ranks, row, strict=True):
            field = view.stable(rank, view.data(name))
            _label(axes, view, title.format(_ORDER[rank]))
            known = field[np.isfinite(field) & (field > 0.0)]
            if known.size:
                low = max(float(known.min()), SHALLOWEST * float(known.max()))
                mesh = _field(axes, view, field, low, float(known.max()))
                _bar(figure, mesh, [axes], label, "min" if float(np.nanmin(field)) < low else "neither")
            handles = draw_curves(axes, view) + _mark_own(axes, view)
    _finish(figure, view, handles + _nothing(view))
    return figure


def _decay(view: View) -> Figure:
    """Time in which the slowest linear mode of each stable equilibrium falls to 1/e."""
    fields = [view.stable(rank, view.data("decay_time")) for rank in view.ranks]
    known = np.concatenate([field[np.isfinite(field)] for field in fields])
    low, high = float(known.min()), min(float(known.max()), SLOWEST * float(known.min()))
    figure = new_figure(1.9 + 4.6 * len(fields), 5.4)
    panels = figure.subplots(1, len(fields), squeeze=False, sharey=True)[0]
    for rank, (axes, field) in enumerate(zip(panels, fields, strict=True)):
        mesh = _field(axes, view, field, low, high)
        handles = draw_curves(axes, view) + _mark_own(axes, view)
        _label(axes, view, f"Slowest mode of the {_ORDER[rank]} stable equilibrium")
    slower = any(float(np.nanmax(field, initial=low)) > high for field in fields)
    _bar(figure, mesh, list(panels), "time to fall to 1/e [s]", "max" if slower else "neither")
    _finish(figure, view, handles + _nothing(view))
    return figure


def _field(axes: Axes, view: View, field: Floats, low: float, high: float) -> Any:
    """A field in logarithmic colours; values beyond the limits have the colour of the nearer one."""
    from matplotlib.colors import LogNorm

    norm = LogNorm(low, high if high > low else low * 1.0001)
    shown = np.clip(field, low, high)
    return axes.pcolormesh(*map(view.axis, view.axes), shown.T, shading="nearest", norm=norm, cmap=FIELD)


def _bar(figure: Figure, mesh: Any, panels: list[Axes], label: str, extend: str) -> None:
    """A colour bar with an arrow at the end beyond which there are values."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    bar = figure.colorbar(mesh, ax=panels, label=label, extend=extend)
    if mesh.norm.vmax <= 3.0 * mesh.norm.vmin / SHALLOWEST:
        bar.ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    bar.ax.yaxis.set_minor_formatter(NullFormatter())


def _nothing(view: View) -> list[Artist]:
    """What white means where not every point has as many stable equilibria as panels."""
    from matplotlib.patches import Patch

    if int(view.data("count_stable").min()) == len(view.ranks):
        return []
    return [Patch(facecolor="white", edgecolor="#808080", label="white: no such equilibrium")]


def _label(axes: Axes, view: View, title: str) -> None:
    axes.set(xlabel=view.label(view.axes[0]), ylabel=view.label(view.axes[1]))
    axes.label_outer()
    axes.set_title(title, fontsize=10.5)
    axes.grid(visible=False)


def _finish(figure: Figure, view: View, handles: list[Artist]) -> None:
    """The scene above everything, the legend below."""
    figure.suptitle(view.setting + not_proved(view), fontsize=10.0)
    if handles:
        columns = 2 if figure.get_figwidth() > 8.0 else 1
        figure.legend(handles=handles, loc="outside lower center", ncols=columns)
