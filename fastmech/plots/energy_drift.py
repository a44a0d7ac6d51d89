"""Energy error of conservative motions against time, one curve a method."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from fastmech.arrays import Floats
from fastmech.plots.style import legend_below, new_figure, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
