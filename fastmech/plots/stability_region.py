"""Stability regions with a scene's eigenvalues, scaled by the largest stable step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastmech.integrators.method import Method
from fastmech.plots.style import LINES, new_figure, style
from fastmech.results import Dataset
from fastmech.step_limits.amplification import amplification

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Points a side of the fields of |R|.
SIDE = 121


def draw_stability_regions(
    methods: Mapping[str, Method], eigenvalues: NDArray[np.complex128], limits: Dataset
) -> Figure:
    """One panel a method: where a step does not amplify, and h lambda at the predicted and measured limit."""
    names = list(limits["method"].data)
    rows = -(-len(methods) // 3)
    with style():
        figure = new_figure(9.6, 3.5 * rows + 0.6)
        panels = figure.subplots(rows, 3, squeeze=False)
        for axes in panels.flat[len(methods) :]:
            axes.remove()
        for axes, (name, method) in zip(panels.flat, methods.items(), strict=False):
            row = names.index(name)
            predicted, measured = (float(limits[k].data[row]) for k in ("predicted_step", "measured_step"))
            scaled = predicted * eigenvalues
            width = 1.25 * max(float(limits["real_limit"].data[row]), float(np.abs(scaled).max()))
            x, y = np.linspace(-width, 0.25 * width, SIDE), np.linspace(-width, width, SIDE)
            field = amplification(method, x[None, :] + 1j * y[:, None])
            axes.contourf(x, y, field, levels=[0.0, 1.0], colors=[LINES[5]], alpha=0.35)
            axes.contour(x, y, field, levels=[1.0], colors=[LINES[0]], linewidths=1.2)
            axes.plot(scaled.real, scaled.imag, "o", color=LINES[1], ms=6, label="h λ, h predicted")
            again = measured * eigenvalues
            axes.plot(again.real, again.imag, "x", color=LINES[6], ms=7, label="h λ, h measured")
            axes.axhline(0.0, color="0.5", lw=0.6)
            axes.axvline(0.0, color="0.5", lw=0.6)
            axes.set_aspect("equal")
            axes.set_title(f"{name}: h ≤ {predicted:.3g} s", loc="left", fontsize=10)
            axes.set_xlabel("Re z")
            axes.set_ylabel("Im z")
        handles, labels = panels.flat[0].get_legend_handles_labels()
        from matplotlib.patches import Patch

        handles.append(Patch(facecolor=LINES[5], edgecolor=LINES[0], alpha=0.5))
        figure.legend(
            handles, [*labels, "stable: a step amplifies nothing"], loc="outside lower center", ncols=3
        )
        figure.suptitle("Stability regions and the scene's eigenvalues at the largest stable step")
    return figure
