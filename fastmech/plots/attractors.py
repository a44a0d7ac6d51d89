"""Attractors: their shares of the starts, and which start of a grid ends at which."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from fastmech.ensembles.status import LABELS
from fastmech.plots import style
from fastmech.plots.basins import largest
from fastmech.results import Dataset

#: Attractors that have a colour of their own, and the colour of the others; greys of starts without a label.
NAMED, OTHERS = len(style.LINES) - 1, "#999999"
UNLABELLED = {"unsure": "#ffffff", "undecided": "#e6e6e6", "escaped": "#404040", "not_finite": "#606060"}


def draw_attractors(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, style.Figure]:
    """Pictures of a dataset of the scan type ``attractors`` of the system with these parameters."""
    with style.style():
        figures = {"shares": _shares(dataset, scene)}
        if len(dataset["label"].dims) == 2:
            figures["labels"] = _labels(dataset, scene)
        return figures


def _name(table: Dataset, k: int) -> str:
    """Kind, period and place of an attractor."""
    kind, forcing = str(table["kind"].data[k]), int(table["forcing_periods"].data[k])
    period = float(table["period"].data[k])
    told = f", period {period:.4g} s" if np.isfinite(period) else ""
    if forcing > 0:
        told = f", period {forcing} of the forcing"
    names = [name for name in table if name.startswith("place_")]
    place = ", ".join(f"{table[name].data[k]:.3g}" for name in names[:4])
    return f"{k}: {kind}{told} at ({place}{', ...' * (len(names) > 4)})"


def _shares(dataset: Dataset, scene: Mapping[str, float]) -> style.Figure:
    table, total = dataset.groups["attractors"], dataset["label"].data.size
    shares, low, high = (100.0 * table[name].data for name in ("share", "share_low", "share_high"))
    n, other = len(shares), 100.0 * float(np.mean(dataset["label"].data < 0))
    figure, axes = style.new_panel(8.0, 1.8 + 0.42 * (n + 1))
    colors = [*style.LINES[:NAMED], *[OTHERS] * n][:n]
    bars: Any = {"color": colors, "xerr": [shares - low, high - shares]}
    axes.barh(np.arange(n), shares, capsize=3, **bars)
    axes.barh(n, other, color="#d9d9d9", edgecolor=style.ink())
    axes.set_yticks(range(n + 1), [*(_name(table, k) for k in range(n)), "without a label"])
    axes.invert_yaxis()
    axes.set_xlabel(f"share of the {total:,} starts [%], with 95 % Wilson interval")
    style.suptitle(figure, f"Where motions settle\n{style.setting_of(dataset.attrs, scene)}")
    return figure


def _labels(dataset: Dataset, scene: Mapping[str, float]) -> style.Figure:
    label, status, table = dataset["label"].data, dataset["status"].data, dataset.groups["attractors"]
    names, n = dataset["label"].dims, table["share"].data.size
    picture, colors, handles = largest(label, partial(_name, table), "{} more", style.LINES[:NAMED], OTHERS)
    codes = style.flag_codes(dataset["status"])
    for code in LABELS:
        meaning = code.name.lower()
        where = (label < 0) & (status == codes[meaning])
        if where.any():
            colors.append(UNLABELLED.get(meaning, "#bfbfbf"))
            picture[where] = len(colors) - 1
            handles.append(
                style.swatch(f"{meaning.replace('_', ' ')}: {style.share(where)}", colors[-1], style.ink())
            )
    figure, axes = style.new_panel(7.6, 7.0)
    x, y = (dataset[name].data for name in names)
    style.paint(axes, x, y, picture, colors)
    points = dataset.groups["points"]
    owner = points["point_attractor"].data
    few = np.isin(owner, np.flatnonzero(np.bincount(owner, minlength=n) <= 32))
    where = [points[f"point_{name}"].data[few] for name in names]
    look: Any = {"marker": "o", "mfc": style.paper(), "mec": style.ink(), "ms": 5, "ls": "none"}
    axes.plot(*where, zorder=3, **look)
    if ((where[0] >= x[0]) & (where[0] <= x[-1]) & (where[1] >= y[0]) & (where[1] <= y[-1])).any():
        handles.append(style.entry("points of attractors", **look))
    told = [f"{style.with_unit(style.symbol(name), dataset[name].units)} at the start" for name in names]
    axes.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]), xlabel=told[0], ylabel=told[1])
    style.angle_ticks(axes, x=dataset[names[0]].units, y=dataset[names[1]].units)
    held = {k.removeprefix("fixed_"): v for k, v in dataset.attrs.items() if k.startswith("fixed_")}
    fixed = "".join(f"; {style.symbol(k)} = {v:g}" for k, v in held.items())
    style.title(axes, f"Where each start ends\n{style.setting_of(dataset.attrs, scene)}{fixed}")
    axes.grid(visible=False)
    style.legend_below(figure, handles)
    return figure
