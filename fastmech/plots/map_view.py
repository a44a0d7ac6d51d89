"""What is drawn of an equilibrium map: up to two of its axes, and values picked by depth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastmech.results import Dataset

Floats = NDArray[np.float64]

#: Relative difference of energies that rounding may cause.
ROUNDING = 1e-10


@dataclass(frozen=True)
class View:
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

    @property
    def ranks(self) -> range:
        """Of stable equilibria, the deepest first."""
        return range(int(self.data("count_stable").max()))

    def has(self, *names: str) -> bool:
        """Whether the map kept these variables."""
        return all(name in self.dataset for name in names)


def make_view(dataset: Dataset, scene: Mapping[str, float]) -> View:
    """The first two axes that vary; the others are held where the scene is."""
    names = tuple(dataset.attrs["axes"])
    free = tuple(name for name in names if dataset.sizes[name] > 1)[:2] or names[:1]
    held = {
        name: int(np.argmin(np.abs(dataset[name].data - scene[name]))) for name in names if name not in free
    }
    return View(dataset, scene, free, held)
