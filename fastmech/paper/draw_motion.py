"""Figures 2 to 5: the motion from Table 1's start over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fastmech.plots.style import LINES, legend_below, new_figure, style
from fastmech.results import Dataset

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TIME = "time t [s]"


def draw_angles(data: Dataset) -> Figure:
    """Figure 2: phi and theta."""
    return _two_lines(
        data,
        {"phi": r"$\varphi$", "theta": r"$\theta$"},
        "angle [rad]",
        "Fig. 2  Generalized coordinates, force decaying as F₀ exp(−αt)",
    )


def draw_momenta(data: Dataset) -> Figure:
    """Figure 5: generalized momenta from the canonical equations."""
    return _two_lines(
        data,
        {"p_phi": r"$p_\varphi$", "p_theta": r"$p_\theta$"},
        "generalized momentum [kg m²/s]",
        "Fig. 5  Generalized momenta, from Hamilton's equations",
    )


def _two_lines(data: Dataset, labels: dict[str, str], ylabel: str, title: str) -> Figure:
    with style():
        figure = new_figure()
        axes = figure.subplots()
        for name, label in labels.items():
            axes.plot(data["time"].data, data[name].data, label=label)
        axes.axhline(0.0, color="0.4", lw=0.8)
        axes.set(xlabel=TIME, ylabel=ylabel, title=title)
        axes.margins(x=0)
        legend_below(figure, axes, 2)
    return figure


def draw_coordinates(data: Dataset) -> Figure:
    """Figure 3: coordinates of the three points."""
    with style():
        figure = new_figure(7.2, 5.6)
        both = figure.subplots(2, 1, sharex=True)
        for axes, axis in zip(both, "xy", strict=True):
            for i, dashes in ((1, "-"), (2, "-"), (3, "--")):
                label = f"point $M_{i}$" if i < 3 else "slider $M_3$"
                axes.plot(data["time"].data, data[f"{axis}{i}"].data, dashes, label=label)
            axes.set_ylabel(f"{axis} [m]")
            axes.margins(x=0)
        both[0].set_title("Fig. 3  Coordinates of the points; the slider stays on its guide, y₃ = 0")
        both[1].set_xlabel(TIME)
        legend_below(figure, both[0], 3)
    return figure


def draw_constraints(data: Dataset) -> Figure:
    """Figure 4: residuals of the constraints (2)-(5)."""
    labels = {
        "f_1": "(2)  $x_1^2 + y_1^2 - l^2$",
        "f_2": "(3)  $(x_2-x_1)^2 + (y_2-y_1)^2 - l^2$",
        "f_3": "(4)  $y_3$",
        "f_4": "(5)  $(x_3-x_1)^2 + (y_3-y_1)^2 - 4l^2$",
    }
    with style():
        figure = new_figure(7.2, 6.4)
        rows = figure.subplots(4, 1, sharex=True, sharey=True)
        for axes, (name, label), colour in zip(rows, labels.items(), LINES, strict=False):
            axes.plot(data["time"].data, data[name].data / 1e-15, color=colour, lw=0.7)
            unit = data[name].units.replace("m2", "m²")
            axes.set_title(f"{label}", loc="left", fontsize=10)
            axes.set_ylabel(f"10⁻¹⁵ {unit}")
            axes.margins(x=0)
        figure.suptitle("Fig. 4  Residuals of the constraints: rounding of double precision")
        rows[-1].set_xlabel(TIME)
    return figure
