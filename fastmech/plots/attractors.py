"""Attractors: their shares of the starts, and which start of a grid ends at which."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from fastmech.ensembles.status import LABELS
from fastmech.plots.style import LINES, entry, flag_codes, new_figure, setting_of, style, symbol
from fastmech.results import Dataset, Variable

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

#: Attractors that have a colour of their own, and the colour of the others; greys of starts without a label.
NAMED, OTHERS = len(LINES) - 1, "#999999"
UNLABELLED = {"unsure": "#ffffff", "undecided": "#e6e6e6", "escaped": "#404040", "not_finite": "#606060"}


def draw_attractors(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
    """Pictures of a dataset of the scan type ``attractors`` of the system with these parameters."""
    with style():
        figures = {"shares": _shares(dataset, scene)}
        if len(dataset["label"].dims) == 2:
            figures["labels"] = _labels(dataset, scene)
        return figures


def _name(table: Dataset, k: int) -> str:
    """Kind, period and place of an attractor."""
    kind, forcing = str(table["kind"].data[k]), int(table["forcing_periods"].data[k])
    period = float(table["period"].data[k])
    told = f", {forcing} T" if forcing > 0 else f", {period:.4g} s" if np.isfinite(period) else ""
    names = [name for name in table if name.startswith("place_")]
    place = ", ".join(f"{table[name].data[k]:.3g}" for name in names[:4])
    return f"{k}: {kind}{told} at ({place}{', ...' * (len(names) > 4)})"


def _color(k: int) -> str:
    return LINES[k] if k < NAMED else OTHERS


def _shares(dataset: Dataset, scene: Mapping[str, float]) -> Figure:
    table, total = dataset.groups["attractors"], dataset["label"].data.size
    share = 100.0 * table["share"].data
    low, high = 100.0 * table["share_low"].data, 100.0 * table["share_high"].data
    names = [_name(table, k) for k in range(len(share))]
    other = 100.0 * float(np.mean(dataset["label"].data < 0))
    figure = new_figure(8.0, 1.8 + 0.42 * (len(share) + 1))
    axes = figure.subplots()
    y = np.arange(len(share))
    axes.barh(
        y, share, color=[_color(k) for k in range(len(share))], xerr=[share - low, high - share], capsize=3
    )
    axes.barh(len(share), other, color="#d9d9d9", edgecolor="black")
    axes.set_yticks([*y, len(share)], [*names, "without a label"])
    axes.invert_yaxis()
    axes.set_xlabel(f"share of the {total:,} starts [%], with 95 % Wilson interval")
    figure.suptitle(f"Where motions settle\n{setting_of(dataset, scene)}")
    return figure


def _labels(dataset: Dataset, scene: Mapping[str, float]) -> Figure:
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    label, status, table = dataset["label"].data, dataset["status"].data, dataset.groups["attractors"]
    names, n = dataset["label"].dims, table["share"].data.size
    picture, colors = np.minimum(label, NAMED), [_color(k) for k in range(min(n, NAMED + 1))]
    handles: list[Artist] = [
        Patch(facecolor=_color(k), label=f"{_name(table, k)}: {100.0 * table['share'].data[k]:.3g} %")
        for k in range(min(n, NAMED))
    ]
    if n > NAMED:
        rest = 100.0 * float(table["share"].data[NAMED:].sum())
        handles.append(Patch(facecolor=OTHERS, label=f"{n - NAMED} more: {rest:.3g} %"))
    codes = flag_codes(dataset["status"])
    for code in LABELS:
        meaning = code.name.lower()
        where = (label < 0) & (status == codes[meaning])
        if where.any():
            colors.append(UNLABELLED.get(meaning, "#bfbfbf"))
            picture[where] = len(colors) - 1
            told = f"{meaning.replace('_', ' ')}: {100.0 * float(where.mean()):.3g} %"
            handles.append(Patch(facecolor=colors[-1], edgecolor="black", label=told))
    figure = new_figure(7.6, 7.0)
    axes = figure.subplots()
    x, y = (dataset[name].data for name in names)
    axes.pcolormesh(
        x, y, picture.T, cmap=ListedColormap(colors), vmin=-0.5, vmax=len(colors) - 0.5,
        shading="nearest", rasterized=True,
    )  # fmt: skip
    points = dataset.groups["points"]
    owner = points["point_attractor"].data
    few = np.isin(owner, np.flatnonzero(np.bincount(owner, minlength=n) <= 32))
    where = [points[f"point_{name}"].data[few] for name in names]
    axes.plot(*where, "o", mfc="white", mec="black", ms=5, ls="none", zorder=3)
    if ((where[0] >= x[0]) & (where[0] <= x[-1]) & (where[1] >= y[0]) & (where[1] <= y[-1])).any():
        handles.append(entry("points of attractors", marker="o", mfc="white", mec="black", ms=5, ls="none"))
    axes.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    axes.set_xlabel(f"{_told(dataset[names[0]], names[0])} at the start")
    axes.set_ylabel(f"{_told(dataset[names[1]], names[1])} at the start")
    held = {k.removeprefix("fixed_"): v for k, v in dataset.attrs.items() if k.startswith("fixed_")}
    fixed = "".join(f"; {symbol(k)} = {v:g}" for k, v in held.items())
    axes.set_title(f"Where each start ends\n{setting_of(dataset, scene)}{fixed}")
    axes.grid(visible=False)
    figure.legend(handles=handles, loc="outside lower center", ncols=2)
    return figure


def _told(variable: Variable, name: str) -> str:
    return symbol(name) if variable.units == "1" else f"{symbol(name)} [{variable.units}]"
