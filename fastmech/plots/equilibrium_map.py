"""Equilibria over two parameters: how many, where, how deep the wells are and how fast motions settle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fastmech.plots.bifurcation import draw_bifurcation
from fastmech.plots.labels import flag_codes
from fastmech.plots.map_curves import draw_curves
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
    4: "#7fb3d5",
    5: PALETTE["green"],
    6: PALETTE["yellow"],
}

#: Half of the smallest range of a colour bar of angles [rad]: rounding shall not look like structure.
LEAST_SPAN = 1e-3

#: Decades of a quantity that has extremes that its colours show; the rest has the colour of the end.
DECADES = 1e4

#: Marks of points whose count is not an ordinary proved one.
UNSETTLED = {"at_fold": "|", "degenerate": "x", "unproved": "+"}

_ORDER = ("deepest", "second", "third")


def draw_equilibrium_map(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
    """Pictures of a dataset of the scan type ``equilibrium_map`` about the scene with these parameters."""
    view = make_view(dataset, scene)
    with style():
        if len(view.axes) == 1:
            return {"branches": draw_bifurcation(view)} if view.has("phi", "theta", "morse_index") else {}
        figures = {}
        if view.has("count", "count_stable", "outcome"):
            figures["count"] = _counts(view)
        if not view.has("count_stable", "morse_index", "energy", "phi") or not view.ranks:
            return figures
        if view.has("theta"):
            figures["angles"] = _angles(view)
        if view.has("depth") and np.isfinite(view.stable(0, view.data("depth"))).any():
            figures["barrier"] = _barrier(view)
        if view.has("decay_time") and np.isfinite(view.stable(0, view.data("decay_time"))).any():
            figures["decay"] = _decay(view)
        return figures


def _counts(view: View) -> Figure:
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    figure = new_figure(9.6, 5.6)
    colors = ListedColormap(list(COUNT_COLORS.values()))
    for axes, name, title in zip(
        figure.subplots(1, 2),
        ("count", "count_stable"),
        ("Number of equilibria", "Number of stable equilibria"),
        strict=True,
    ):
        counts = view.data(name)
        axes.pcolormesh(
            *map(view.axis, view.axes), counts.T, cmap=colors, vmin=-0.5, vmax=6.5, shading="nearest"
        )
        handles: list[Artist] = [
            Patch(color=COUNT_COLORS[int(n)], label=f"{n} ({np.mean(counts == n):.1%})")
            for n in np.unique(counts)
        ]
        curves = draw_curves(axes, view)
        handles += _mark_unsettled(axes, view) + _mark_own(axes, view)
        axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=3)
        _label(axes, view, f"{title}{view.note}")
    _legend(figure, curves)
    return figure


def _mark_unsettled(axes: Axes, view: View) -> list[Artist]:
    x, y = np.meshgrid(*map(view.axis, view.axes), indexing="ij")
    codes = flag_codes(view.dataset["outcome"])
    handles: list[Artist] = []
    for name, marker in UNSETTLED.items():
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
    figure = new_figure(1.6 + 4.6 * len(view.ranks), 8.0)
    panels = figure.subplots(2, len(view.ranks), squeeze=False, sharex=True, sharey=True)
    for row, (name, symbol) in enumerate((("phi", "φ"), ("theta", "θ"))):
        fields = [view.stable(rank, view.data(name)) for rank in view.ranks]
        look = _angle_look(fields)
        for rank, field in enumerate(fields):
            axes = panels[row, rank]
            mesh = axes.pcolormesh(*map(view.axis, view.axes), field.T, shading="nearest", **look)
            curves = draw_curves(axes, view) + _mark_own(axes, view)
            _label(axes, view, f"{symbol} of the {_ORDER[rank]} stable equilibrium{view.note}")
        figure.colorbar(mesh, ax=panels[row, :], label=f"{symbol} [rad]")
    _legend(figure, curves)
    return figure


def _angle_look(fields: list[Floats]) -> dict[str, object]:
    """Colours of an angle: cyclic where its values go round."""
    known = np.concatenate([field[np.isfinite(field)] for field in fields])
    if np.ptp(known) > 1.5 * np.pi:
        return {"cmap": "twilight", "vmin": -np.pi, "vmax": np.pi}
    middle, half = 0.5 * (known.min() + known.max()), max(0.5 * np.ptp(known), LEAST_SPAN)
    return {"cmap": FIELD, "vmin": middle - half, "vmax": middle + half}


def _barrier(view: View) -> Figure:
    """Depth of each well; the colour bar tells it as an energy and, for a given m2, as a speed of M2."""
    fields = [view.stable(rank, view.data("depth")) for rank in view.ranks]
    high = max(np.nanmax(field) for field in fields if np.isfinite(field).any())
    low = max(min(np.nanmin(field) for field in fields if np.isfinite(field).any()), high / DECADES)
    title = "Energy to leave the {} well"
    figure, bar = _fields(view, fields, title, (low, high), "depth of the well [J]")
    if "m2" not in view.dataset.attrs["axes"]:
        m2 = view.scene["m2"]
        speed = bar.ax.secondary_yaxis(
            -0.8, functions=(lambda e: np.sqrt(2.0 * np.abs(e) / m2), lambda v: 0.5 * m2 * v**2)
        )
        speed.set_ylabel("least speed of M2 with that energy [m/s]")
    return figure


def _decay(view: View) -> Figure:
    fields = [view.stable(rank, view.data("decay_time")) for rank in view.ranks]
    known = np.concatenate([field[np.isfinite(field)] for field in fields])
    low = float(known.min())
    high = max(min(float(known.max()), low * DECADES), low * 1.0001)
    title = "Slowest mode of the {} stable equilibrium"
    return _fields(view, fields, title, (low, high), "time to fall to 1/e [s]")[0]


def _fields(
    view: View, fields: list[Floats], title: str, limits: tuple[float, float], label: str
) -> tuple[Figure, Any]:
    """One panel for each stable equilibrium, deepest first, with a common logarithmic colour bar."""
    from matplotlib.colors import LogNorm

    figure = new_figure(1.9 + 4.6 * len(fields), 5.2)
    panels = figure.subplots(1, len(fields), squeeze=False, sharey=True)[0]
    low, high = limits
    norm = LogNorm(low, high if high > low else low * 1.0001)
    for rank, (axes, field) in enumerate(zip(panels, fields, strict=True)):
        shown = np.clip(field, *limits)
        mesh = axes.pcolormesh(*map(view.axis, view.axes), shown.T, shading="nearest", norm=norm, cmap=FIELD)
        curves = draw_curves(axes, view) + _mark_own(axes, view)
        _label(axes, view, f"{title.format(_ORDER[rank])}{view.note}")
    bar = figure.colorbar(mesh, ax=panels, label=label)
    _legend(figure, curves)
    return figure, bar


def _label(axes: Axes, view: View, title: str) -> None:
    axes.set(xlabel=view.label(view.axes[0]), ylabel=view.label(view.axes[1]))
    axes.label_outer()
    axes.set_title(title, fontsize=10.5)
    axes.grid(visible=False)


def _legend(figure: Figure, handles: list[Artist]) -> None:
    if handles:
        columns = 2 if figure.get_figwidth() > 8.0 else 1
        figure.legend(handles=handles, loc="outside lower center", ncols=columns)
