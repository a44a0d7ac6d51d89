"""Motion over a parameter: amplitudes of periodic motions, and shares of the starts that end where."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from fastmech.errors import InputError
from fastmech.plots.style import LINES, new_figure, setting_of, style
from fastmech.results import Dataset
from fastmech.scene import nearest

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: What tells areas of the same colour apart.
HATCHES = ("", "//", "..", "xx")

#: Marker of each kind of special point.
MARKERS = {"fold": "o", "period doubling": "s", "Neimark-Sacker": "D"}


def draw_response(response: Any, ax: Axes, state: str | None = None) -> None:
    """Draw the amplitude of a state, the first by default, over the parameter: stable solid, unstable dashed.

    Raises:
        InputError: there is no such state.
    """
    state = response.names[0] if state is None else state
    if state not in response.names:
        raise InputError(f"state: {nearest(str(state), list(response.names))}")
    column = response.names.index(state)
    for k, branch in enumerate(response.branches):
        color = LINES[k % len(LINES)]
        stable = branch.stable
        change = np.flatnonzero(np.diff(stable.astype(int))) + 1
        for part in np.split(np.arange(len(stable)), change):
            joined = np.append(part, part[-1] + 1) if part[-1] + 1 < len(stable) else part
            look: dict[str, Any] = {"ls": "-", "lw": 1.8} if stable[part[0]] else {"ls": "--", "lw": 1.2}
            ax.plot(branch.values[joined], branch.amplitudes[joined, column], color=color, **look)
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


def _with_unit(response: Any, name: str) -> str:
    unit = response.units.get(name)
    return f"{name} [{unit}]" if unit else name


def draw_fractions(along: Any, ax: Axes) -> None:
    """Draw shares stacked over the parameter."""
    shares = np.nan_to_num(along.fractions).T
    number = len(shares)
    names = [f"attractor {k}" for k in range(number)]
    colors = [LINES[k % len(LINES)] for k in range(number)]
    rest = np.maximum(along.unlabelled, 0.0)
    if (rest > 0.0).any():
        shares, names, colors = np.vstack([shares, rest]), [*names, "without a label"], [*colors, "#d9d9d9"]
    areas = ax.stackplot(along.values, shares, labels=names, colors=colors, alpha=0.85)
    for k, area in enumerate(areas[:number]):
        area.set_hatch(HATCHES[k // len(LINES) % len(HATCHES)])
    for tipping in along.tipping:
        ax.axvline(0.5 * (tipping.low + tipping.high), color="black", lw=0.8, ls=":")
    low, high = sorted((along.values[0], along.values[-1]))
    ax.set(xlabel=along.parameter, ylabel="share of the starts", xlim=(low, high), ylim=(0.0, 1.0))
    ax.set_title("Where starts end")
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))


def draw_numbers(over: Any, ax: Axes) -> None:
    """Draw how many attractors there are over two parameters, and where one comes or goes."""
    first = over.lines[0]
    number = np.isfinite(over.fractions).sum(axis=2)
    mesh = ax.pcolormesh(first.values, over.values, number, cmap="Blues", vmin=0, shading="nearest")
    tips = [
        (0.5 * (t.low + t.high), v)
        for v, line in zip(over.values, over.lines, strict=True)
        for t in line.tipping
    ]
    ax.plot(*np.reshape(tips, (-1, 2)).T, "k.", ms=4, label="one comes or goes")
    ax.figure.colorbar(mesh, ax=ax, label="attractors")
    ax.set(xlabel=first.parameter, ylabel=over.second, title="Attractors")


def draw_lines(
    dataset: Dataset, scene: Mapping[str, float], line: Callable[[int], Any], count: int
) -> Figure:
    """What ``line`` gives at the first, middle and last of so many values of a second parameter."""
    shown = sorted({0, count // 2, count - 1})
    with style():
        figure = new_figure(8.0, 1.2 + 3.8 * len(shown))
        panels = figure.subplots(len(shown), 1, squeeze=False)[:, 0]
        for k, ax in zip(shown, panels, strict=True):
            line(k).plot(ax=ax)
            second = [(n, v) for n, v in dataset.variables.items() if v.dims == (n,) and v.data.size == count]
            if count > 1:
                name, values = second[0]
                unit = "" if values.units == "1" else f" {values.units}"
                ax.set_title(f"{ax.get_title()}; {name} = {values.data[k]:g}{unit}")
        changes = {*dataset.variables, dataset.attrs.get("parameter")}
        figure.suptitle(setting_of(dataset, {k: v for k, v in scene.items() if k not in changes}))
    return figure
