"""Dynamic snapping over force and decay rate: where the mechanism ends up, and what is critical."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from fastmech.plots.basins import FEW, FURTHER, NAMED, basin_color, basin_name, unlabelled
from fastmech.plots.style import entry, flag_codes, in_fifths, new_figure, style
from fastmech.results import Dataset

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Where the mechanism comes back to its well.
BACK = "#e6e6e6"


def draw_snapping(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
    """Picture of a dataset of the scan type ``snapping`` about the scene with these parameters."""
    from matplotlib.colors import ListedColormap

    with style():
        figure = new_figure(8.2, 6.6)
        axes = figure.subplots()
        picture, colors, handles = _ends(dataset)
        force, alpha = dataset["F0"].data, dataset["alpha"].data
        axes.pcolormesh(
            _edges(np.log(alpha), exponential=True),
            _edges(force),
            picture.T,
            cmap=ListedColormap(colors),
            vmin=-0.5,
            vmax=len(colors) - 0.5,
            rasterized=True,
        )
        axes.set_xscale("log")
        handles += _unlabelled(axes, dataset) + _curves(axes, dataset)
        axes.set_xlim(*_edges(np.log(alpha), exponential=True)[[0, -1]])
        axes.set_ylim(*_edges(force)[[0, -1]])
        in_fifths(axes.xaxis)
        axes.set_xlabel("rate α at which the force decays [1/s]")
        axes.set_ylabel("force F0 when it is switched on [N]")
        axes.set_title(
            "Where the mechanism ends that rests until F0 exp(-α t) is switched on\n"
            f"c1 = {scene['c1']:g} N/m, c2 = {scene['c2']:g} N/m"
        )
        axes.grid(visible=False)
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
        return {"map": figure}


def _ends(dataset: Dataset) -> tuple[np.ndarray, list[str], list[Artist]]:
    """Numbers of colours over (alpha, F0), the colours, and what they mean; what stays comes first."""
    from matplotlib.patches import Patch

    well, left = dataset["well"].data, dataset["left"].data.astype(np.bool_)
    ends = np.stack([well, dataset["turns_phi"].data, dataset["turns_theta"].data], axis=-1)
    gone, inverse, number = np.unique(ends[left], axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(-number, kind="stable")
    picture = np.full(well.shape, -1)
    picture[(well >= 0) & ~left] = 0
    colors = [BACK]
    back = np.mean((well >= 0) & ~left)
    handles: list[Artist] = [Patch(facecolor=BACK, label=f"comes back to its well: {100.0 * back:.3g} %")]
    flat = picture[left]
    named, others, other_share = 0, 0, 0.0
    for end in order:
        copy = int(gone[end, 0]), (int(gone[end, 1]), int(gone[end, 2]))
        color, share = basin_color(dataset, *copy), 100.0 * number[end] / well.size
        flat[inverse.ravel() == end] = len(colors)
        colors.append(color)
        if color != FURTHER and named < NAMED:
            named += 1
            handles.append(
                Patch(facecolor=color, label=f"leaves to {basin_name(dataset, *copy)}: {share:.3g} %")
            )
        else:
            others, other_share = others + 1, other_share + share
    if others:
        text = f"leaves elsewhere, grey or small ({others} ends): {other_share:.3g} %"
        handles.append(Patch(facecolor=FURTHER, label=text))
    picture[left] = flat
    if (well < 0).any():
        picture[well < 0] = len(colors)
        colors.append("#ffffff")
    return picture, colors, handles


def _unlabelled(axes: Axes, dataset: Dataset) -> list[Artist]:
    """Motions without a label, each marked where they are few."""
    from matplotlib.patches import Patch

    status, codes = dataset["status"].data, flag_codes(dataset["status"])
    handles: list[Artist] = []
    for name, (_, marker, meaning) in unlabelled(codes).items():
        where = status == codes[name]
        number = int(np.count_nonzero(where))
        if not number:
            continue
        text = f"{meaning}: {number}"
        if number > FEW:
            handles.append(Patch(facecolor="white", edgecolor="black", label=text))
            continue
        k, j = np.nonzero(where)
        axes.plot(
            dataset["alpha"].data[k], dataset["F0"].data[j], marker, color="black", ms=5, ls="none", zorder=4
        )
        handles.append(entry(text, marker=marker, ms=6, ls="none"))
    return handles


def _curves(axes: Axes, dataset: Dataset) -> list[Artist]:
    """The critical curve, and its limit for fast decay."""
    alpha, critical = dataset["alpha"].data, dataset["critical_F0"].data
    handles: list[Artist] = []
    if np.isfinite(critical).any():
        line = axes.plot(alpha, critical, color="black", lw=1.6, marker="o", ms=2.5, zorder=5)
        line[0].set_label("smallest force that leaves")
        handles += line
    limit = float(dataset["critical_impulse"].data)
    if np.isfinite(limit):
        text = f"its limit for fast decay: F0/α = {limit:.4g} N s"
        handles += axes.plot(alpha, limit * alpha, color="black", lw=1.4, ls="--", zorder=5, label=text)
    return handles


def _edges(middles: np.ndarray, exponential: bool = False) -> np.ndarray:
    """Edges of cells about evenly spaced middles."""
    half = 0.5 * (middles[1] - middles[0]) if middles.size > 1 else 0.5 * max(abs(float(middles[0])), 1e-3)
    edges = np.append(middles - half, middles[-1] + half)
    return np.exp(edges) if exponential else edges
