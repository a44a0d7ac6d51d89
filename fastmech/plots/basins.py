"""Basin maps: who ends where, with what decides it drawn on top, and how long that takes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastmech.plots.basin_colors import FURTHER, basin_color, basin_name
from fastmech.plots.basin_marks import Slice, decisive, mark
from fastmech.plots.labels import Codes, flag_codes, quantity, setting_of, symbol
from fastmech.plots.style import FIELD, new_figure, style
from fastmech.results import Dataset
from fastmech.scene import Scene

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Basins that a legend names, the largest ones.
NAMED = 10

#: Looks of starts without a label: colour, and the marker that keeps single ones visible.
UNLABELLED = {
    "undecided": ("#ffffff", "x", "undecided at the end of the run"),
    "at_saddle": ("#000000", "s", "on a saddle's stable manifold"),
    "out_of_range": ("#d0b8a0", "v", "leaves its range"),
    "not_finite": ("#4d4d4d", "+", "not finite"),
    "step_too_large": ("#4d4d4d", "1", "step too large"),
    "not_converged": ("#4d4d4d", "3", "Newton's iteration failed"),
    "start_not_finite": ("#4d4d4d", "2", "start not finite"),
}

#: Why a computed start has no time.
WITHOUT_TIME = {"capture_time": "not captured", "settle_time": "not settled"}

#: Colour of starts of a refined map that have not been computed.
SKIPPED = "#d9d9d9"

#: Starts without label up to which each is marked.
FEW = 400


def draw_basins(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
    """Pictures of a dataset of the scan type ``basins`` about the scene with these parameters."""
    with style():
        slice_ = Slice(dataset, None if "mechanism" in dataset.attrs else Scene(**scene))
        figures = {"labels": _labels(slice_)}
        for name, title in (
            ("capture_time", "Time until capture is proved"),
            ("settle_time", "Time to settle"),
        ):
            if name in dataset and np.isfinite(slice_.data(name)).any():
                figures[name] = _times(slice_, name, title)
        for figure in figures.values():
            _describe(figure.axes[0], slice_, scene)
        return figures


def _labels(view: Slice) -> Figure:
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    figure = new_figure(8.2, 8.0)
    axes = figure.subplots()
    label, status = view.data("label").astype(int), view.data("status")
    codes = flag_codes(view.dataset["status"])
    present, number = np.unique(label[label >= 0], return_counts=True)
    order = present[np.argsort(-number, kind="stable")]
    colors: list[str] = []
    handles: list[Artist] = []
    picture = np.full(label.shape, -1)
    own = [basin_color(view.dataset, *_copy(view, basin)) for basin in order]
    named = [(basin, color) for basin, color in zip(order, own, strict=True) if color != FURTHER][:NAMED]
    for basin, color in zip(order, own, strict=True):
        picture[label == basin] = len(colors)
        colors.append(color)
    handles += [
        Patch(
            facecolor=color,
            label=f"{basin_name(view.dataset, *_copy(view, basin))}: {_share(label == basin)}",
        )
        for basin, color in named
    ]
    grey = np.array([color == FURTHER for color in own], dtype=np.bool_)
    smaller = np.setdiff1d(order[~grey], [basin for basin, _ in named])
    if smaller.size:
        text = f"smaller, in own colours (basins: {smaller.size}): {_share(np.isin(label, smaller))}"
        handles.append(Patch(facecolor="none", label=text))
    if grey.any():
        text = f"further away (basins: {np.count_nonzero(grey)}): {_share(np.isin(label, order[grey]))}"
        handles.append(Patch(facecolor=FURTHER, label=text))
    for name, (color, marker, meaning) in unlabelled(codes).items():
        where = status == codes[name]
        if where.any():
            picture[where] = len(colors)
            colors.append(color)
            few = np.count_nonzero(where) <= FEW
            if few:
                x, y = np.meshgrid(view.axis(0), view.axis(1), indexing="ij")
                axes.plot(x[where], y[where], marker, color="black", ms=5, ls="none", zorder=4)
            text = f"{meaning}: {np.count_nonzero(where)} ({_share(where)})"
            handles.append(
                mark(marker, text) if few else Patch(facecolor=color, edgecolor="black", label=text)
            )
    axes.pcolormesh(
        view.axis(0),
        view.axis(1),
        picture.T,
        cmap=ListedColormap(colors),
        vmin=-0.5,
        vmax=len(colors) - 0.5,
        shading="nearest",
        rasterized=True,
    )
    handles += decisive(axes, view)
    figure.legend(handles=handles, loc="outside lower center", ncols=2)
    axes.set_title("Where starts come to rest")
    return figure


def unlabelled(codes: Codes) -> dict[str, tuple[str, str, str]]:
    """Colour, marker and meaning of every status without a label, also of those that only the file knows."""
    others = codes.others({"captured", *UNLABELLED})
    return {**UNLABELLED, **{name: ("#b3a2c7", "P", name.replace("_", " ")) for name in others}}


def _copy(view: Slice, basin: int) -> tuple[int, tuple[int, ...]]:
    """A basin's well and turns."""
    data = view.dataset
    turns = tuple(int(data[f"basin_turns_{name}"].data[basin]) for name in view.coordinates)
    return int(data["basin_well"].data[basin]), turns


def _share(where: NDArray[np.bool_]) -> str:
    return f"{100.0 * np.mean(where):.3g} %"


def _times(view: Slice, name: str, title: str) -> Figure:
    from matplotlib.colors import ListedColormap, LogNorm, Normalize
    from matplotlib.patches import Patch
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    figure = new_figure(8.2, 7.0)
    axes = figure.subplots()
    times = np.asarray(view.data(name), dtype=np.float64)
    known = times[np.isfinite(times)]
    positive = known[known > 0.0]
    low, high = (float(positive.min()), float(positive.max())) if positive.size else (0.1, 1.0)
    norm = LogNorm(low, high) if high > 20.0 * low else Normalize(low, max(high, low * 1.01))
    # A start that has been computed and has no time is white, as an undecided one among the labels.
    computed = view.data("computed").astype(np.bool_)
    without = {"white": computed & ~np.isfinite(times), SKIPPED: ~computed & ~np.isfinite(times)}
    axes.set_facecolor("white")
    axes.pcolormesh(
        view.axis(0),
        view.axis(1),
        np.where(without[SKIPPED], 0.0, np.nan).T,
        cmap=ListedColormap([SKIPPED]),
        shading="nearest",
        rasterized=True,
    )
    mesh = axes.pcolormesh(
        view.axis(0),
        view.axis(1),
        np.maximum(times, low).T,
        norm=norm,
        cmap=FIELD,
        shading="nearest",
        rasterized=True,
    )
    bar = figure.colorbar(mesh, ax=axes, label=f"{name.replace('_', ' ')} [s]")
    if isinstance(norm, LogNorm):
        bar.ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        bar.ax.yaxis.set_minor_formatter(NullFormatter())
    handles = decisive(axes, view)
    meanings = {"white": WITHOUT_TIME[name], SKIPPED: "not computed: filled in between equal labels"}
    handles[:0] = [
        Patch(facecolor=color, edgecolor="black", label=f"{meanings[color]}: {_share(where)}")
        for color, where in without.items()
        if where.any()
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=2)
    if view.data("computed").all():  # else those near boundaries are over-represented
        title += f" (median {np.median(known):.3g} s, 99 % within {np.quantile(known, 0.99):.3g} s)"
    axes.set_title(title)
    return figure


def _describe(axes: Axes, view: Slice, parameters: Mapping[str, float]) -> None:
    """Labels with units, the decisive parameters, and what is held."""
    if view.scene is not None:
        scene = view.scene
        force = f"F0 = {scene.F0:g} N" + (f" exp(-{scene.alpha:g} t)" if scene.F0 and scene.alpha else "")
        told = f"{force}, c1 = {scene.c1:g} N/m, c2 = {scene.c2:g} N/m"
    else:
        told = setting_of(view.dataset, parameters)
    at_rest = all(value == 0.0 for value in view.held.values()) and not set(view.coordinates) & set(view.held)
    held = "starts at rest" if at_rest and set(view.axes) == set(view.coordinates) else _held(view)
    axes.set_title(f"{axes.get_title()}\n{told}; {held}" if held else f"{axes.get_title()}\n{told}")
    for axis, name in (("x", view.axes[0]), ("y", view.axes[1])):
        getattr(axes, f"set_{axis}label")(quantity(view.dataset, name).replace(" [", " at the start ["))
    axes.grid(visible=False)


def _held(view: Slice) -> str:
    each = ", ".join(f"{symbol(name)} = {value:.4g}" for name, value in view.held.items())
    return f"starts with {each}" if each else ""
