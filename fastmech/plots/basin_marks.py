"""What decides in a slice of a basin map, drawn on top: equilibria, and where the energy is a barrier's."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastmech.mechanism.lagrange import kinetic_energy, potential_energy
from fastmech.plots.labels import ANGLES, coordinates_of
from fastmech.results import Dataset
from fastmech.scene import Scene

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

#: Points along each side on which energies are evaluated for their contours.
GRID = 401

#: An equilibrium so near to the slice [rad, rad/s] counts as in it: held values are typed with some digits.
IN_SLICE = 1e-3

MARKERS = {0: ("o", "well"), 1: ("D", "saddle"), 2: ("^", "maximum")}
DASHES = ["-", "--", ":"]


class Slice:
    """The first two axes that vary; further ones are held at their middle value."""

    def __init__(self, dataset: Dataset, scene: Scene | None) -> None:
        self.dataset, self.scene = dataset, scene
        self.coordinates = coordinates_of(dataset)
        self.turning = ANGLES if scene is not None else tuple(dataset.attrs.get("turning_names", ()))
        self.states = (*self.coordinates, *(f"{name}_dot" for name in self.coordinates))
        names = tuple(dataset.attrs["axes"])
        self.axes = (*[n for n in names if dataset.sizes[n] > 1], *names)[:2]
        if self.axes[0] == self.axes[1]:
            self.axes = (self.axes[0], next(n for n in names if n != self.axes[0]))
        self.index = tuple(slice(None) if n in self.axes else dataset.sizes[n] // 2 for n in names)
        self.swapped = names.index(self.axes[0]) > names.index(self.axes[1])
        self.held = {
            name: float(dataset.attrs[f"fixed_{name}"])
            for name in self.states
            if f"fixed_{name}" in dataset.attrs
        }
        self.held |= {
            n: float(dataset[n].data[i]) for n, i in zip(names, self.index, strict=True) if n not in self.axes
        }

    def data(self, name: str) -> NDArray[np.generic]:
        """A variable over the two axes, the first one first."""
        values = np.asarray(self.dataset[name].data[self.index])
        return values.T if self.swapped else values

    def axis(self, number: int) -> Floats:
        """Values along one of the two axes."""
        return np.asarray(self.dataset[self.axes[number]].data, dtype=np.float64)

    def energy(self, scene: Scene) -> tuple[Floats, Floats, Floats]:
        """Values along both axes and T + U over them [J], U with the force that the wells hold for."""
        x, y = (np.linspace(self.axis(k)[0], self.axis(k)[-1], GRID) for k in (0, 1))
        grids = dict(zip(self.axes, np.meshgrid(x, y, indexing="ij"), strict=True))
        states = np.stack(
            [grids[n] if n in grids else np.full((GRID, GRID), self.held[n]) for n in self.states], axis=-1
        )
        force = float(self.dataset["force"].data)
        return x, y, kinetic_energy(scene, states) + potential_energy(scene, states[..., :2], force)


def mark(marker: str, text: str, face: str = "white") -> Artist:
    """What a marker in a legend means."""
    from matplotlib.lines import Line2D

    return Line2D([], [], marker=marker, color="black", mfc=face, ms=8, ls="none", label=text)


def decisive(axes: Axes, view: Slice) -> list[Artist]:
    """Equilibria in the slice, and where the energy is that of each well's barrier."""
    from matplotlib.lines import Line2D

    handles: list[Artist] = []
    data = view.dataset
    wells = np.flatnonzero(data["equilibrium_morse_index"].data == 0)
    barriers = data["barrier"].data[wells]
    levels = np.unique(barriers[: None if view.scene is not None else 0])
    x, y, energy = view.energy(view.scene) if view.scene is not None else (np.zeros(0),) * 3
    for number, level in enumerate(levels):
        if energy.min() < level < energy.max():
            look = DASHES[number % len(DASHES)]
            axes.contour(x, y, energy.T, levels=[level], colors="black", linewidths=1.6, linestyles=look)
            which = " and ".join(str(i + 1) for i in np.flatnonzero(barriers == level))
            of = f" of well{'s' * (' ' in which)} {which}" if wells.size > 1 else ""
            handles.append(
                Line2D([], [], color="black", lw=1.6, ls=look, label=f"barrier energy{of}, {level:.4g} J")
            )
    for index, (marker, name) in MARKERS.items():
        for inside in (True, False):
            places = _places(view, index, inside)
            if len(places):
                face = "white" if inside else "none"
                axes.plot(*places.T, marker, mfc=face, mec="black", mew=1.4, ms=8, ls="none", zorder=5)
                text = name if inside else f"{name}, outside of this slice"
                handles.append(mark(marker, text, face))
    if wells.size > 1:
        for number, well in enumerate(wells):
            for place in _places(view, 0, True, int(well)):
                axes.annotate(
                    str(number + 1), place, xytext=(6, 5), textcoords="offset points", weight="bold", zorder=6
                )
    return handles


def _places(view: Slice, index: int, inside: bool, only: int | None = None) -> Floats:
    """Copies of equilibria of a Morse index within the picture (n, 2): those in the slice, or those outside.

    Those outside are seen along the held coordinates, if an angle is an axis; over two rates they would all
    lie at the origin.
    """
    data, found = view.dataset, []
    if not inside and not set(view.coordinates) & set(view.axes):
        return np.zeros((0, 2))
    reach = [(view.axis(k)[0], view.axis(k)[-1]) for k in (0, 1)]
    for i in np.flatnonzero(data["equilibrium_morse_index"].data == index):
        if only is not None and i != only:
            continue
        place = {name: data[f"equilibrium_{name}"].data[i] for name in view.coordinates}
        away = [
            (held - place[n] + np.pi) % (2.0 * np.pi) - np.pi
            if n in view.turning
            else held - place.get(n, 0.0)
            for n, held in view.held.items()
        ]
        if bool(np.abs(away).max(initial=0.0) <= IN_SLICE) != inside:
            continue
        copies = []
        for name, (low, high) in zip(view.axes, reach, strict=True):
            at = place.get(name, 0.0)
            turns = np.arange(
                np.ceil((low - at) / (2.0 * np.pi)), np.floor((high - at) / (2.0 * np.pi)) + 1.0
            )
            copies.append(
                at + 2.0 * np.pi * turns
                if name in view.turning
                else np.array([at] if low <= at <= high else [])
            )
        found += [(a, b) for a in copies[0] for b in copies[1]]
    return np.array(found).reshape(-1, 2)
