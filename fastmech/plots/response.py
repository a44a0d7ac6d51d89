"""Motion over a parameter: amplitudes of periodic motions, and shares of the starts that end where."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fastmech.errors import InputError
from fastmech.plots.style import LINES, new_figure, style
from fastmech.scene import nearest

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: What tells areas of the same colour apart.
HATCHES = ("", "//", "..", "xx")

#: Marker of each kind of special point.
MARKERS = {"fold": "o", "period doubling": "s", "Neimark-Sacker": "D"}


def draw_response(response: Any, state: str, ax: Axes | None) -> Axes:
    """Draw a :class:`~fastmech.attractors.branches.FrequencyResponse` into axes, new ones by default."""
    if state not in response.names:
        raise InputError(f"state: {nearest(str(state), list(response.names))}")
    column = response.names.index(state)
    with style():
        if ax is None:
            ax = new_figure(8.0, 5.0).subplots()
        for k, branch in enumerate(response.branches):
            color = LINES[k % len(LINES)]
            stable = branch.stable
            change = np.flatnonzero(np.diff(stable.astype(int))) + 1
            for part in np.split(np.arange(len(stable)), change):
                joined = np.append(part, part[-1] + 1) if part[-1] + 1 < len(stable) else part
                ax.plot(
                    branch.values[joined],
                    branch.amplitudes[joined, column],
                    color=color,
                    ls="-" if stable[part[0]] else "--",
                    lw=1.8 if stable[part[0]] else 1.2,
                )
        for kind, marker in MARKERS.items():
            points = [s for s in response.special if s.kind == kind]
            if points:
                x, y = [s.value for s in points], [s.amplitude[column] for s in points]
                ax.plot(x, y, marker, ls="none", mfc="white", mec="black", ms=5, label=kind, zorder=4)
        ax.plot([], [], "-", color="black", lw=1.8, label="stable")
        ax.plot([], [], "--", color="black", lw=1.2, label="unstable")
        ax.set(
            xlabel=_with_unit(response, response.parameter),
            ylabel=f"amplitude of {_with_unit(response, state)}",
            title=f"Periodic motion, period {response.periods} of the forcing",
        )
        ax.legend()
        return ax


def _with_unit(response: Any, name: str) -> str:
    unit = response.units.get(name)
    return f"{name} [{unit}]" if unit else name


def draw_fractions(along: Any, ax: Axes | None) -> Axes:
    """Draw a :class:`~fastmech.attractors.follow.BasinsAlong` into axes, new ones by default."""
    with style():
        if ax is None:
            ax = new_figure(8.0, 5.0).subplots()
        shares = np.nan_to_num(along.fractions).T
        number = len(shares)
        names = [f"attractor {k}" for k in range(number)]
        colors = [LINES[k % len(LINES)] for k in range(number)]
        rest = np.maximum(along.unlabelled, 0.0)
        if (rest > 0.0).any():
            shares, names, colors = (
                np.vstack([shares, rest]),
                [*names, "without a label"],
                [*colors, "#d9d9d9"],
            )
        areas = ax.stackplot(along.values, shares, labels=names, colors=colors, alpha=0.85)
        for k, area in enumerate(areas[:number]):
            area.set_hatch(HATCHES[k // len(LINES) % len(HATCHES)])
        for tipping in along.tipping:
            ax.axvline(0.5 * (tipping.low + tipping.high), color="black", lw=0.8, ls=":")
        low, high = sorted((along.values[0], along.values[-1]))
        ax.set(xlabel=along.parameter, ylabel="share of the starts", xlim=(low, high), ylim=(0.0, 1.0))
        ax.set_title("Where starts end")
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        return ax
