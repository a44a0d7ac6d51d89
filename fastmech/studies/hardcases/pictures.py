"""Pictures of the hard cases: stability regions with a scene's eigenvalues, and the drift of energies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastmech.arrays import Floats
from fastmech.integrators.methods import Method
from fastmech.plots.style import PALETTE, entry, legend_below, new_figure, style
from fastmech.results import Dataset
from fastmech.step_limits.amplification import amplification

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Points a side of the fields of |R|, and panels in a row.
SIDE, ACROSS = 181, 4

#: Step [s] for the eigenvalues of a method that has no limit.
WITHOUT_LIMIT = 2.0

#: Half width of the panel of a method that has no limit.
WIDE = 14.0


def draw_stability_regions(
    methods: Mapping[str, Method], eigenvalues: NDArray[np.complex128], limits: Dataset, title: str
) -> Figure:
    """Where a step does not amplify, h lambda at the predicted and at the measured limit, limits on the axes.

    Args:
        methods: which to draw, by name; a page holds about sixteen.
        eigenvalues: of the small motion [1/s].
        limits: ``method``, ``real_limit``, ``imaginary_limit``, ``predicted_step``, ``measured_step`` [s].
        title: of the page.
    """
    rows = -(-len(methods) // ACROSS)
    with style():
        figure = new_figure(12.0, 3.6 * rows + 0.9)
        panels = figure.subplots(rows, ACROSS, squeeze=False)
        for axes in panels.flat[len(methods) :]:
            axes.remove()
        for axes, (name, method) in zip(panels.flat, methods.items(), strict=False):
            _panel(axes, name, method, eigenvalues, limits)
        _legend(figure, bool(np.isfinite(_limits_of(limits, next(iter(methods)))[2])))
        figure.suptitle(title)
    return figure


def _limits_of(limits: Dataset, name: str) -> tuple[float, float, float, float]:
    row = list(limits["method"].data).index(name)
    real, imaginary, predicted, measured = (
        float(limits[k].data[row])
        for k in ("real_limit", "imaginary_limit", "predicted_step", "measured_step")
    )
    return real, imaginary, predicted, measured


def _panel(
    axes: Axes, name: str, method: Method, eigenvalues: NDArray[np.complex128], limits: Dataset
) -> None:
    real, imaginary, predicted, measured = _limits_of(limits, name)
    bounded = np.isfinite(predicted)
    scaled = (predicted if bounded else WITHOUT_LIMIT) * eigenvalues
    if bounded:
        reach = 1.2 * max(real, imaginary, float(np.abs(scaled).max()))
        left, right = -reach, 0.5 * reach
    else:
        reach, left, right = WIDE, -WIDE, WIDE
    x, y = np.linspace(left, right, SIDE), np.linspace(-reach, reach, SIDE)
    field = amplification(method, x[None, :] + 1j * y[:, None])
    axes.contourf(x, y, field, levels=[0.0, 1.0], colors=[PALETTE["sky"]], alpha=0.35)
    axes.contour(x, y, field, levels=[1.0], colors=[PALETTE["blue"]], linewidths=1.1)
    axes.axhline(0.0, color="0.5", lw=0.6)
    axes.axvline(0.0, color="0.5", lw=0.6)
    axes.plot(scaled.real, scaled.imag, "o", color=PALETTE["vermillion"], ms=6)
    if bounded:
        again = measured * eigenvalues
        axes.plot(again.real, again.imag, "x", color=PALETTE["black"], ms=7)
        axes.plot([-real], [0.0], "D", mfc="white", mec=PALETTE["black"], ms=5, clip_on=False)
        axes.plot([0.0, 0.0], [-imaginary, imaginary], "s", mfc="white", mec=PALETTE["black"], ms=5)
    axes.set_aspect("equal")
    axes.set_xlim(left, right)
    axes.set_ylim(-reach, reach)
    axes.locator_params(axis="x", nbins=4)
    axes.locator_params(axis="y", nbins=5)
    if bounded:
        steps = f"h predicted {predicted:.5f} s\nh measured {measured:.5f} s\n"
        ends = f"real −{real:.3g}, imaginary ±{imaginary:.3g}"
    else:
        steps = f"h predicted {_no_limit(predicted)}\nh measured {_no_limit(measured)}\n"
        ends = f"real {_no_limit(real)}, imaginary {_no_limit(imaginary)}"
    axes.set_title(f"{name}, order {method.order}", loc="left", fontsize=10, pad=44, weight="bold")
    axes.text(0.0, 1.02, steps + ends, transform=axes.transAxes, fontsize=8.5, va="bottom", linespacing=1.25)
    axes.set_xlabel("Re z", labelpad=1)
    axes.set_ylabel("Im z", labelpad=1)


def _no_limit(value: float) -> str:
    return f"{value:.4g}" if np.isfinite(value) else "no limit"


def _legend(figure: Figure, bounded: bool) -> None:
    from matplotlib.patches import Patch

    def mark(marker: str, color: str, label: str, face: str | None = None) -> Artist:
        return entry(label, ls="", marker=marker, mfc=face or color, mec=color, ms=6)

    stable = Patch(facecolor=PALETTE["sky"], edgecolor=PALETTE["blue"], alpha=0.5, label="no step amplifies")
    if bounded:
        handles = [
            stable,
            mark("o", PALETTE["vermillion"], "h λ of the scene, h predicted"),
            mark("x", PALETTE["black"], "h λ of the scene, h measured"),
            mark("D", PALETTE["black"], "limit on the real axis", "white"),
            mark("s", PALETTE["black"], "limit on the imaginary axis", "white"),
        ]
    else:
        label = f"h λ of the scene at h = {WITHOUT_LIMIT:g} s: no step is too long for stability"
        handles = [stable, mark("o", PALETTE["vermillion"], label)]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))


#: Error that is drawn for zero, below the rounding of an energy.
FLOOR = 1e-17


def draw_energy_drift(histories: Mapping[str, tuple[Floats, Floats]], title: str, subtitle: str) -> Figure:
    """``histories``: label -> (times [s], relative energy error), on two logarithmic axes.

    ``title`` says whose error it is, ``subtitle`` start and step.
    """
    with style():
        figure = new_figure(7.6, 4.6)
        axes = figure.subplots()
        for label, (times, error) in histories.items():
            axes.loglog(times, np.maximum(np.abs(error), FLOOR), lw=1.1, label=label)
        axes.set_xlabel("time t [s]")
        axes.set_ylabel("|E − E(0)| / (E(0) − min U)")
        axes.set_title(subtitle, loc="left", fontsize=9)
        figure.suptitle(title, x=0.01, ha="left")
        legend_below(figure, axes, 2)
    return figure
