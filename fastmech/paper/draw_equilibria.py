"""Figure 6: where the mechanism rests, on the potential's map and as drawings of the mechanism itself."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fastmech.paper.compute import Case
from fastmech.paper.scene import STATIC_SCENE
from fastmech.plots.mechanism import draw_mechanism, drawing_of, legend_handles
from fastmech.plots.style import PALETTE, new_figure, style
from fastmech.results import Dataset

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Marker and name of each kind of equilibrium.
KINDS = {
    "minimum": ("o", "minimum, stable"),
    "saddle": ("X", "saddle, unstable"),
    "maximum": ("^", "maximum, unstable"),
}

#: Curves on which a condition (20) holds: variable, angle, place, colour, dashes.
CURVES = (
    ("condition_phi", r"\varphi", "first", "black", "-"),
    ("condition_theta", r"\theta", "second", PALETTE["vermillion"], "--"),
)


def draw_potential(data: Dataset) -> Figure:
    """Figure 6 (a): contours of U = Pi - F x2, both curves of (20) and their intersections."""
    from matplotlib import patheffects
    from matplotlib.lines import Line2D
    from matplotlib.ticker import MaxNLocator

    with style():
        figure = new_figure(7.4, 7.2)
        axes = figure.subplots()
        phi, theta = data["phi"].data, data["theta"].data
        filled = axes.contourf(phi, theta, data["potential"].data.T, levels=24)
        figure.colorbar(filled, ax=axes, label="U = Π − F x₂ [J]", shrink=0.9, ticks=MaxNLocator(8))
        halo: Any = [patheffects.withStroke(linewidth=4.5, foreground="white")]
        handles = []
        for name, angle, place, colour, dashes in CURVES:
            line = axes.contour(phi, theta, data[name].data.T, levels=[0.0], colors=[colour])
            line.set(linestyles=dashes, linewidths=2.2, path_effects=halo)
            label = rf"$\partial U/\partial{angle} = 0$, {place} of (20)"
            handles.append(Line2D([], [], color=colour, ls=dashes, lw=2.2, label=label))
        handles += _mark_equilibria(axes, data)
        _angle_axes(axes)
        axes.set_title("Fig. 6 (a)  Static equilibria: where both curves cross (F = 100 N)")
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
    return figure


def _mark_equilibria(axes: Axes, data: Dataset) -> list[Any]:
    from matplotlib.lines import Line2D

    box = {"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
    look: dict[str, Any] = {"mfc": "white", "mec": "black", "ms": 11, "ls": "none"}
    places = zip(
        data["case"].data, data["phi_st"].data, data["theta_st"].data, data["kind"].data, strict=True
    )
    for number, phi, theta, kind in places:
        axes.plot(phi, theta, KINDS[kind][0], zorder=5, **look)
        offset = (0, 14) if theta < 0.7 * np.pi else (0, -22)
        text: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "zorder": 6, "bbox": box}
        axes.annotate(f"Case {number}", (phi, theta), offset, **text)
    present = [kind for kind in KINDS if kind in set(data["kind"].data)]
    return [Line2D([], [], marker=KINDS[kind][0], label=KINDS[kind][1], **look) for kind in present]


def _angle_axes(axes: Axes) -> None:
    ticks = np.array([-1.0, -0.5, 0.0, 0.5, 1.0]) * np.pi
    names = ["−π", "−π/2", "0", "π/2", "π"]
    axes.set_xticks(ticks, names)
    axes.set_yticks(ticks, names)
    axes.set(xlabel=r"$\varphi$ [rad]", ylabel=r"$\theta$ [rad]", aspect="equal")
    axes.grid(False)


def draw_positions(cases: Sequence[Case]) -> Figure:
    """Figure 6 (b): the mechanism at each equilibrium, to scale."""
    with style():
        figure = new_figure(9.6, 9.2)
        grid = figure.subplots(2, 2, sharex=True, sharey=True)
        rests = [case.equilibrium for case in cases]
        drawn = drawing_of(STATIC_SCENE, [e.position for e in rests], STATIC_SCENE.F0)
        for k, (axes, case, e) in enumerate(zip(grid.flat, cases, rests, strict=True)):
            draw_mechanism(axes, drawn, k)
            colour = PALETTE["blue"] if case.verdict == "stable" else PALETTE["vermillion"]
            axes.set_title(
                f"Case {case.number}: {case.verdict} ({e.kind})\n"
                rf"$\varphi$ = {degrees(e.phi)}, $\theta$ = {degrees(e.theta)}",
                color=colour,
            )
            axes.label_outer()
        figure.suptitle(
            "Fig. 6 (b)  The mechanism at its static equilibria, to scale; areas of the masses in proportion"
        )
        figure.legend(
            handles=legend_handles(drawn, f"force on $M_2$, {STATIC_SCENE.F0:g} N"),
            loc="outside lower center",
            ncols=4,
        )
    return figure


def degrees(angle: float) -> str:
    """An angle [rad] in degrees, with a true minus."""
    return f"{np.degrees(angle):.1f}°".replace("-", "−")
