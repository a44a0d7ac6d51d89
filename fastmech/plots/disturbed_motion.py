"""One disturbance of every equilibrium: the nonlinear motion beside the linearized one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastmech.plots.labels import equilibrium_names, logarithmic
from fastmech.plots.style import LINES, legend_below, new_figure, style
from fastmech.results import Dataset

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

TIME = "time t [s]"

#: What the variables of the two motions begin with.
MOTIONS = ("nonlinear", "linearized")


def draw_disturbed_motion(dataset: Dataset) -> dict[str, Figure]:
    """Pictures of a dataset of the scan type ``disturbed_motion``; none where there is no equilibrium."""
    if not dataset.sizes["equilibrium"]:
        return {}
    with style():
        return {"angles": _angles(dataset), "norm": _norm(dataset)}


def _angles(dataset: Dataset) -> Figure:
    count = dataset.sizes["equilibrium"]
    figure = new_figure(8.4, 1.9 * count + 0.8)
    panels = figure.subplots(count, 2, sharex=True, squeeze=False)
    for row, name in enumerate(equilibrium_names(dataset)):
        for column, (angle, symbol) in enumerate((("phi", "φ"), ("theta", "θ"))):
            axes = panels[row, column]
            nonlinear, linearized = (dataset[f"{which}_{angle}"].data[row] for which in MOTIONS)
            _plot_pair(axes, dataset["time"].data, nonlinear, linearized)
            _limit(axes, nonlinear)
            axes.set_ylabel(f"ξ of {symbol} [rad]")
        panels[row, 0].set_title(f"Equilibrium {name}", loc="left")
    for axes in panels[-1]:
        axes.set_xlabel(TIME)
    legend_below(figure, panels[0, 0], 2)
    return figure


def _norm(dataset: Dataset) -> Figure:
    nonlinear, linearized = (
        np.hypot(*(dataset[f"{which}_{angle}"].data for angle in ("phi", "theta"))) for which in MOTIONS
    )
    rows = -(-len(nonlinear) // 2)
    figure = new_figure(8.4, 2.5 * rows + 0.5)
    panels = figure.subplots(rows, 2, sharex=True, squeeze=False)
    for axes in panels.flat[len(nonlinear) :]:
        axes.remove()
    for i, name in enumerate(equilibrium_names(dataset)):
        axes = panels.flat[i]
        _plot_pair(axes, dataset["time"].data, nonlinear[i], linearized[i])
        axes.set_yscale("log")
        # A linearized motion that grows leaves the picture: the nonlinear one sets the scale.
        known = nonlinear[i][nonlinear[i] > 0.0]
        if known.size:
            axes.set_ylim(known.min() / 3.0, 10.0 * known.max())
        logarithmic(axes.yaxis)
        axes.set_title(name, loc="left", fontsize=10)
        axes.set_ylabel("|ξ| [rad]")
        if i >= len(nonlinear) - 2:
            axes.set_xlabel(TIME)
            axes.tick_params(labelbottom=True)
    figure.suptitle("Size of the disturbance of the angles")
    legend_below(figure, panels[0, 0], 2)
    return figure


def _plot_pair(axes: Axes, t: Floats, nonlinear: Floats, linearized: Floats) -> None:
    axes.plot(t, nonlinear, color=LINES[0], label="nonlinear")
    axes.plot(t, linearized, "--", color=LINES[1], lw=1.2, label="linearized")


def _limit(axes: Axes, nonlinear: Floats) -> None:
    """The nonlinear motion sets the scale: an unstable linearized one would hide it."""
    low, high = np.nanmin(nonlinear, initial=0.0), np.nanmax(nonlinear, initial=0.0)
    margin = 0.25 * (high - low) or 1.0
    axes.set_ylim(low - margin, high + margin)
