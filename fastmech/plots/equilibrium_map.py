"""Equilibria over parameters: maps over two of them, branches over one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastmech.plots.labels import flag_codes, logarithmic
from fastmech.plots.style import FIELD, LINES, PALETTE, legend_below, new_figure, style
from fastmech.results import Dataset

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

#: Colours of counts, the same in both maps.
COUNT_COLORS = {
    0: "#bdbdbd",
    1: PALETTE["sky"],
    2: PALETTE["orange"],
    3: PALETTE["purple"],
    4: PALETTE["blue"],
    5: PALETTE["green"],
    6: PALETTE["yellow"],
}

#: Relative difference of energies, and of eigenvalues, that rounding may cause.
ROUNDING = 1e-10

#: Half of the smallest range of a colour bar of angles [rad]: rounding shall not look like structure.
LEAST_SPAN = 1e-3

#: Marks of points whose count is not an ordinary proved one.
UNSETTLED = {"at_fold": "|", "degenerate": "x", "unproved": "+"}


@dataclass(frozen=True)
class _View:
    """What is drawn of a map: one or two axes, any further one held at the index nearest to the scene."""

    dataset: Dataset
    scene: Mapping[str, float]
    axes: tuple[str, ...]
    held: Mapping[str, int]

    @property
    def at(self) -> tuple[int | slice, ...]:
        """Index of what is drawn."""
        return tuple(self.held.get(name, slice(None)) for name in self.dataset.attrs["axes"])

    @property
    def note(self) -> str:
        """For titles: where further axes are held."""
        values = [
            f"{name} = {self.axis(name)[i]:.4g} {self.dataset[name].units}" for name, i in self.held.items()
        ]
        return ", ".join(["", *values])

    def data(self, name: str) -> NDArray[np.generic]:
        """A variable over the axes drawn."""
        return np.asarray(self.dataset[name].data[self.at])

    def axis(self, name: str) -> Floats:
        """Values along an axis."""
        return np.asarray(self.dataset[name].data, dtype=np.float64)

    def label(self, name: str) -> str:
        """Name and unit of an axis."""
        return f"{name} [{self.dataset[name].units}]"

    def own(self) -> tuple[float, ...] | None:
        """The scene's own point, if the picture shows it."""
        if any(self.axis(name)[i] != self.scene[name] for name, i in self.held.items()):
            return None
        point = tuple(self.scene[name] for name in self.axes)
        inside = all(
            self.axis(name).min() <= value <= self.axis(name).max()
            for name, value in zip(self.axes, point, strict=True)
        )
        return point if inside else None

    def stable(self, rank: int, values: NDArray[np.generic]) -> Floats:
        """Of values over the equilibria, that of the stable one of this rank (0: deepest), NaN if none."""
        energy = np.where(self.data("morse_index") == 0, self.data("energy"), np.inf)
        # Mirror images are equally deep but for rounding: the angle orders them, so that maps are smooth.
        deepest = energy.min(axis=-1, keepdims=True)
        tied = energy <= deepest + ROUNDING * np.abs(deepest)
        order = np.lexsort((self.data("phi"), np.where(tied, deepest, energy)), axis=-1)
        chosen = (np.argsort(order, axis=-1) == rank) & np.isfinite(energy)
        return np.where(chosen.any(axis=-1), np.where(chosen, values, 0.0).sum(axis=-1), np.nan)

    def decay_rate(self) -> Floats:
        """Decay rate of the slowest mode [1/s] of every equilibrium, NaN if no more than rounding."""
        real, imaginary = self.data("eigenvalue_re"), self.data("eigenvalue_im")
        rate = -np.max(real, axis=-1)
        return np.where(rate > ROUNDING * np.max(np.hypot(real, imaginary), axis=-1), rate, np.nan)


def draw_equilibrium_map(dataset: Dataset, scene: Mapping[str, float]) -> dict[str, Figure]:
    """Pictures of a dataset of the scan type ``equilibrium_map`` about the scene with these parameters."""
    view = _view(dataset, scene)
    with style():
        if len(view.axes) == 1:
            return {"branches": _branches(view)}
        figures = {"count": _counts(view)}
        if view.data("count_stable").any():
            figures["angles"] = _angles(view)
        if np.isfinite(view.stable(0, view.decay_rate())).any():
            figures["decay"] = _decay(view)
        return figures


def _view(dataset: Dataset, scene: Mapping[str, float]) -> _View:
    names = tuple(dataset.attrs["axes"])
    free = tuple(name for name in names if dataset.sizes[name] > 1)[:2] or names[:1]
    held = {
        name: int(np.argmin(np.abs(dataset[name].data - scene[name]))) for name in names if name not in free
    }
    return _View(dataset, scene, free, held)


def _counts(view: _View) -> Figure:
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    figure = new_figure(9.6, 5.2)
    colors = ListedColormap(list(COUNT_COLORS.values()))
    for axes, name, title in zip(
        figure.subplots(1, 2),
        ("count", "count_stable"),
        ("Number of equilibria", "Number of stable equilibria"),
        strict=True,
    ):
        counts = view.data(name)
        axes.pcolormesh(
            *map(view.axis, view.axes), counts.T, cmap=colors, vmin=-0.5, vmax=6.5, shading="nearest"
        )
        handles: list[Artist] = [
            Patch(color=COUNT_COLORS[int(n)], label=f"{n} ({np.mean(counts == n):.1%})")
            for n in np.unique(counts)
        ]
        handles += _mark_unsettled(axes, view) + _mark_own(axes, view)
        axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=3)
        _label(axes, view, f"{title}{view.note}")
    return figure


def _mark_unsettled(axes: Axes, view: _View) -> list[Artist]:
    x, y = np.meshgrid(*map(view.axis, view.axes), indexing="ij")
    codes = flag_codes(view.dataset["outcome"])
    handles: list[Artist] = []
    for name, marker in UNSETTLED.items():
        where = view.data("outcome") == codes[name]
        if where.any():
            label = f"{name.replace('_', ' ')} ({np.count_nonzero(where)})"
            handles += axes.plot(x[where], y[where], marker, color="black", ms=5, label=label)
    return handles


def _mark_own(axes: Axes, view: _View) -> list[Artist]:
    point = view.own()
    if point is None:
        return []
    if len(point) == 1:
        return [axes.axvline(point[0], color="black", lw=1.0, ls=":", label="the scene")]
    return list(axes.plot(*point, "*", color="white", mec="black", ms=15, ls="none", label="the scene"))


def _angles(view: _View) -> Figure:
    ranks = range(int(view.data("count_stable").max()))
    figure = new_figure(1.6 + 4.6 * len(ranks), 7.6)
    panels = figure.subplots(2, len(ranks), squeeze=False, sharex=True, sharey=True)
    for row, (name, symbol) in enumerate((("phi", "φ"), ("theta", "θ"))):
        fields = [view.stable(rank, view.data(name)) for rank in ranks]
        look = _angle_look(fields)
        for rank, field in enumerate(fields):
            axes = panels[row, rank]
            mesh = axes.pcolormesh(*map(view.axis, view.axes), field.T, shading="nearest", **look)
            _mark_own(axes, view)
            _label(axes, view, f"{symbol} of the {_ORDER[rank]} stable equilibrium{view.note}")
        figure.colorbar(mesh, ax=panels[row, :], label=f"{symbol} [rad]")
    _own_legend(figure, panels[0, 0])
    return figure


_ORDER = ("deepest", "second", "third")


def _angle_look(fields: list[Floats]) -> dict[str, object]:
    """Colours of an angle: cyclic where its values go round."""
    known = np.concatenate([field[np.isfinite(field)] for field in fields])
    if np.ptp(known) > 1.5 * np.pi:
        return {"cmap": "twilight", "vmin": -np.pi, "vmax": np.pi}
    middle, half = 0.5 * (known.min() + known.max()), max(0.5 * np.ptp(known), LEAST_SPAN)
    return {"cmap": FIELD, "vmin": middle - half, "vmax": middle + half}


def _decay(view: _View) -> Figure:
    from matplotlib.colors import LogNorm

    ranks = range(int(view.data("count_stable").max()))
    figure = new_figure(1.6 + 4.6 * len(ranks), 4.6)
    panels = figure.subplots(1, len(ranks), squeeze=False, sharey=True)[0]
    rate = view.decay_rate()
    fields = [view.stable(rank, rate) for rank in ranks]
    known = np.concatenate([field[np.isfinite(field)] for field in fields])
    # Rates near zero are only so many decades below the others: the colours are for the others.
    norm = LogNorm(max(known.min(), known.max() * 1e-4), known.max())
    for rank, field in enumerate(fields):
        axes = panels[rank]
        mesh = axes.pcolormesh(*map(view.axis, view.axes), field.T, shading="nearest", norm=norm, cmap=FIELD)
        _mark_own(axes, view)
        _label(axes, view, f"Slowest mode of the {_ORDER[rank]} stable equilibrium{view.note}")
    figure.colorbar(mesh, ax=panels, label="decay rate [1/s]")
    _own_legend(figure, panels[0])
    return figure


def _branches(view: _View) -> Figure:
    (name,) = view.axes
    figure = new_figure(7.6, 8.4)
    panels = figure.subplots(3, 1, sharex=True)
    x = np.broadcast_to(view.axis(name)[:, None], view.data("phi").shape)
    stable = view.data("morse_index") == 0
    for axes, variable, symbol in zip(panels, ("phi", "theta"), ("φ", "θ"), strict=False):
        angle = view.data(variable)
        axes.plot(
            x[~stable], angle[~stable], "o", color=LINES[1], mfc="none", ms=3.5, mew=0.7, label="unstable"
        )
        axes.plot(x[stable], angle[stable], "o", color=LINES[0], ms=3.5, label="stable")
        axes.set(ylabel=f"angle {symbol} [rad]", ylim=(-3.4, 3.4))
        _mark_own(axes, view)
    panels[2].semilogy(x[stable], view.decay_rate()[stable], "o", color=LINES[0], ms=3.5)
    logarithmic(panels[2].yaxis)
    panels[2].set(ylabel="slowest decay\nof the stable [1/s]", xlabel=view.label(name))
    _mark_own(panels[2], view)
    panels[0].set_title(f"Equilibria over {name}{view.note}")
    legend_below(figure, panels[0], 3)
    return figure


def _label(axes: Axes, view: _View, title: str) -> None:
    axes.set(xlabel=view.label(view.axes[0]), ylabel=view.label(view.axes[1]))
    axes.label_outer()
    axes.set_title(title, fontsize=10.5)
    axes.grid(visible=False)


def _own_legend(figure: Figure, axes: Axes) -> None:
    if axes.get_legend_handles_labels()[1]:
        legend_below(figure, axes, 1)
