"""Figures 2 to 5: the motion from Table 1's start over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fastmech.plots.style import LINES, legend_below, new_figure, style
from fastmech.results import Dataset

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TIME = "time t [s]"

_POINTS = {1: "point $M_1$", 2: "point $M_2$", 3: "slider $M_3$"}

#: Title of a figure, and its panels: label of the ordinate, names of what is drawn.
PANELS: dict[str, tuple[str, dict[str, dict[str, str]]]] = {
    "figure_2": (
        "Fig. 2  Generalized coordinates, force decaying as F₀ exp(−αt)",
        {"angle [rad]": {"phi": r"$\varphi$", "theta": r"$\theta$"}},
    ),
    "figure_3": (
        "Fig. 3  Coordinates of the points; the slider stays on its guide, y₃ = 0",
        {f"{axis} [m]": {f"{axis}{i}": name for i, name in _POINTS.items()} for axis in "xy"},
    ),
    "figure_5": (
        "Fig. 5  Generalized momenta, from Hamilton's equations",
        {"generalized momentum [kg m²/s]": {"p_phi": r"$p_\varphi$", "p_theta": r"$p_\theta$"}},
    ),
}

#: The constraints of Figure 4.
CONSTRAINTS = {
    "f_1": "(2)  $x_1^2 + y_1^2 - l^2$",
    "f_2": "(3)  $(x_2-x_1)^2 + (y_2-y_1)^2 - l^2$",
    "f_3": "(4)  $y_3$",
    "f_4": "(5)  $(x_3-x_1)^2 + (y_3-y_1)^2 - 4l^2$",
}


def draw_over_time(name: str, data: Dataset) -> Figure:
    """Figures 2, 3 and 5."""
    title, panels = PANELS[name]
    with style():
        figure = new_figure(7.2, 2.8 + 1.4 * len(panels))
        rows = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for axes, (label, lines) in zip(rows, panels.items(), strict=True):
            for dashes, (line, about) in zip(("-", "-", "--"), lines.items(), strict=False):
                axes.plot(data["time"].data, data[line].data, dashes, label=about)
            axes.axhline(0.0, color="0.4", lw=0.8, zorder=1.5)
            axes.set_ylabel(label)
            axes.margins(x=0)
        rows[0].set_title(title)
        rows[-1].set_xlabel(TIME)
        legend_below(figure, rows[0], len(lines))
    return figure


def draw_constraints(data: Dataset) -> Figure:
    """Figure 4: residuals of the constraints (2)-(5)."""
    with style():
        figure = new_figure(7.2, 6.4)
        rows = figure.subplots(4, 1, sharex=True, sharey=True)
        for axes, (name, label), colour in zip(rows, CONSTRAINTS.items(), LINES, strict=False):
            axes.plot(data["time"].data, data[name].data / 1e-15, color=colour, lw=0.7)
            unit = data[name].units.replace("m2", "m²")
            axes.set_title(f"{label}", loc="left", fontsize=10)
            axes.set_ylabel(f"10⁻¹⁵ {unit}")
            axes.margins(x=0)
        figure.suptitle("Fig. 4  Residuals of the constraints: rounding of double precision")
        rows[-1].set_xlabel(TIME)
    return figure
