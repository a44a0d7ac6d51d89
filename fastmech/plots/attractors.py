"""Attractors: their shares of the starts, and which start of a grid ends at which."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fastmech.arrays import Flags
from fastmech.ensembles.status import LABELS
from fastmech.plots import style
from fastmech.plots.basins import COLORS, FURTHER, by_number
from fastmech.results import Dataset

#: Colours of starts without a label.
UNLABELLED = {"unsure": "#ffffff", "undecided": "#e6e6e6", "escaped": "#404040", "not_finite": "#606060"}


@style.style()
def draw_attractors(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, style.Figure]:
    """Pictures of a dataset of the scan type ``attractors`` of the system with these parameters."""
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
    values, units = [table[n].data[k] for n in names[:4]], [table[n].units for n in names[:4]]
    place = style.place([name.removeprefix("place_") for name in names[:4]], values, units, ".3g")
    return f"{k}: {kind}{told}\nat {place}{', ...' * (len(names) > 4)}"


def _setting(dataset: Dataset, scene: Mapping[str, float]) -> str:
    return f"{style.setting_of(dataset.attrs, scene)}; runs\xa0to\xa0{dataset.attrs['t_end']:.4g}\xa0s"


def _without(dataset: Dataset) -> dict[str, tuple[Flags, str]]:
    """Starts without a label and their colour, by what is known of them."""
    label, status, codes = dataset["label"].data, dataset["status"].data, dataset["status"].codes
    meanings = [code.name.lower() for code in LABELS]
    found = {m: (label < 0) & (status == codes[m]) for m in meanings}
    return {
        m.replace("_", " "): (where, UNLABELLED.get(m, "#bfbfbf"))
        for m, where in found.items()
        if where.any()
    }


def _shares(dataset: Dataset, scene: Mapping[str, float]) -> style.Figure:
    table, total = dataset.groups["attractors"], dataset["label"].data.size
    shares, low, high = (100.0 * table[name].data for name in ("share", "share_low", "share_high"))
    n, other = len(shares), _without(dataset)
    figure, axes = style.new_panel(8.0, 1.9 + 0.42 * (n + len(other)))
    bars: Any = {"color": [*COLORS, *[FURTHER] * n][:n], "xerr": [shares - low, high - shares]}
    axes.barh(np.arange(n), shares, capsize=3, **bars)
    for row, (where, color) in enumerate(other.values(), n):
        axes.barh(row, 100.0 * np.mean(where), color=color, edgecolor=style.ink())
    axes.set_yticks(range(n + len(other)), [*(_name(table, k) for k in range(n)), *other])
    axes.invert_yaxis()
    axes.set_xlabel(f"share of the {total:,} starts [%]\nwith 95 % Wilson interval")
    style.suptitle(figure, f"Where motions settle\n{_setting(dataset, scene)}")
    return figure


def _labels(dataset: Dataset, scene: Mapping[str, float]) -> style.Figure:
    label, table = dataset["label"].data, dataset.groups["attractors"]
    names, n = dataset["label"].dims, table["share"].data.size
    picture, colors, handles = by_number(
        label, range(n), n, lambda k: _name(table, k).replace("\n", " "), "{} more"
    )
    for meaning, (among, color) in _without(dataset).items():
        picture[among] = len(colors)
        colors.append(color)
        handles.append(style.swatch(f"{meaning}: {style.share(among)}", color, style.ink()))
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
    told = [style.quantity(dataset, name, " at the start") for name in names]
    axes.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]), xlabel=told[0], ylabel=told[1])
    style.angle_ticks(axes, x=dataset[names[0]].units, y=dataset[names[1]].units)
    held = {k.removeprefix("fixed_"): v for k, v in dataset.attrs.items() if k.startswith("fixed_")}
    fixed = "".join(f"; {style.symbol(k)} = {v:g}" for k, v in held.items())
    style.title(axes, f"Where each start ends\n{_setting(dataset, scene)}{fixed}")
    axes.grid(visible=False)
    style.legend_below(figure, handles)
    return figure
