"""Figures 7 to 11: disturbed motion about each equilibrium, with the roots beside it, and its norm."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fastmech.paper.compute import Case
from fastmech.plots.style import LINES, PALETTE, legend_below, new_figure, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ANGLES = (r"$\xi_1$ (of $\varphi$)", r"$\xi_2$ (of $\theta$)")

BOX = {"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}

GROWTH = 1.5
"""A linearized disturbance leaves the picture at so many times the nonlinear one's largest angle."""


def draw_disturbed(cases: Sequence[Case], title: str, *, linearized: bool) -> Figure:
    """Disturbances of the angles over time, one row a case, with the roots of the polynomial."""
    with style():
        figure = new_figure(9.6, 1.4 + 3.1 * len(cases))
        rows = figure.subplots(len(cases), 2, squeeze=False, gridspec_kw={"width_ratios": [1.9, 1.0]})
        for (left, right), case in zip(rows, cases, strict=True):
            _draw_angles(left, case, linearized)
            _draw_roots(right, case)
        figure.suptitle(title)
        legend_below(figure, rows[0, 0], 4 if linearized else 2)
    return figure


def _draw_angles(axes: Axes, case: Case, linearized: bool) -> None:
    t, nonlinear, linear = case.disturbed.t, case.disturbed.nonlinear[:, 0], case.disturbed.linearized[:, 0]
    shown = _span(t, nonlinear, linear) if linearized else t[-1]
    inside = t <= shown
    broad = 3.4 if linearized else 1.8
    for i, (name, colour) in enumerate(zip(ANGLES, (PALETTE["sky"], PALETTE["orange"]), strict=True)):
        axes.plot(t[inside], nonlinear[inside, i], color=colour, lw=broad, label=f"{name}, nonlinear")
    if linearized:
        for i, (name, colour) in enumerate(
            zip(ANGLES, (PALETTE["blue"], PALETTE["vermillion"]), strict=True)
        ):
            axes.plot(t[inside], linear[inside, i], "--", color=colour, lw=1.5, label=f"{name}, linearized")
        if case.verdict == "unstable":
            axes.set_ylim(_limits(nonlinear[inside, :2]))
    axes.axhline(0.0, color="0.4", lw=0.8)
    axes.set(xlabel="time t [s]", ylabel="disturbance [rad]", title=case.title)
    axes.margins(x=0)


def _limits(values: NDArray[np.float64]) -> tuple[float, float]:
    low, high = min(0.0, float(values.min())), max(0.0, float(values.max()))
    room = 0.15 * (high - low)
    return low - room, high + room


def _span(t: NDArray[np.float64], nonlinear: NDArray[np.float64], linear: NDArray[np.float64]) -> float:
    """Time to show: twice as long as the linearized angles stay in the nonlinear one's range [s]."""
    gone = np.max(np.abs(linear[:, :2]), axis=1) > GROWTH * np.max(np.abs(nonlinear[:, :2]))
    return float(min(t[-1], 2.0 * t[np.argmax(gone)])) if gone.any() else float(t[-1])


def _draw_roots(axes: Axes, case: Case) -> None:
    roots = case.classification.eigenvalues
    reach = 1.7 * float(np.max(np.abs(roots.real)))
    height = 1.5 * max(1.0, float(np.max(np.abs(roots.imag))))
    axes.axvspan(0.0, reach, color=PALETTE["vermillion"], alpha=0.10, lw=0)
    axes.axhline(0.0, color="0.4", lw=0.8)
    axes.axvline(0.0, color="0.4", lw=0.8)
    for root in roots:
        colour = PALETTE["vermillion"] if root.real > 0 else PALETTE["blue"]
        axes.plot(root.real, root.imag, "x", color=colour, ms=9, mew=2.4)
        if root.imag >= 0.0:
            pair = f" ± {root.imag:.2f}i" if root.imag > 0 else ""
            text = f"{root.real:.2f}{pair}".replace("-", "−")
            look: dict[str, Any] = {"ha": "center", "fontsize": 8.5, "bbox": BOX}
            axes.annotate(text, (root.real, root.imag), (0, 11), textcoords="offset points", **look)
    axes.set(xlim=(-reach, reach), ylim=(-height, height), xlabel="Re λ [1/s]", ylabel="Im λ [1/s]")
    unstable = int(np.sum(roots.real > 0))
    axes.set_title(
        "no root on the right"
        if not unstable
        else f"{unstable} root{'s' if unstable > 1 else ''} on the right"
    )


def draw_norms(cases: Sequence[Case]) -> Figure:
    """The size of the disturbance over time for all cases, nonlinear and linearized."""
    with style():
        figure = new_figure(9.6, 4.6)
        left, right = figure.subplots(1, 2, sharey=True)
        for case, colour in zip(cases, LINES, strict=False):
            left.semilogy(case.disturbed.t, case.norm_nonlinear, color=colour, label=case.title)
            right.semilogy(case.disturbed.t, case.norm_linearized, color=colour)
        left.set(title="nonlinear equations", ylabel="size of the disturbance [rad]", ylim=(3e-4, 30.0))
        right.set_title("linearized equations")
        for axes in (left, right):
            axes.set_xlabel("time t [s]")
            axes.margins(x=0)
        figure.suptitle("Norm of the disturbance over time")
        legend_below(figure, left, 4)
    return figure
