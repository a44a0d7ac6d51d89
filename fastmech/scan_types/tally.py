"""Counts and exact quantiles of ensembles that come in blocks and are never in memory together."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fastmech.results import Dataset, Variable

Floats = NDArray[np.float64]

_FAILED = "failed_"


@dataclass
class Tally:
    """How many trajectories have returned, and when: times are ends of steps, so few differ.

    Attributes:
        total: trajectories.
        failed: those that failed, by the name of their outcome.
        times, counts: the times to return that occur [s], rising, and how often.
    """

    total: int = 0
    failed: Counter[str] = field(default_factory=Counter)
    times: Floats = field(default_factory=lambda: np.zeros(0))
    counts: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @classmethod
    def of(cls, time_to_return: Floats, failed: Mapping[str, int]) -> Tally:
        """The tally of a block; NaN stands for no return."""
        times, counts = np.unique(time_to_return[np.isfinite(time_to_return)], return_counts=True)
        return cls(len(time_to_return), Counter(failed), times, counts.astype(np.int64))

    def variables(self) -> dict[str, Variable]:
        """The times and counts as a tile keeps them."""
        each = ("returned",)
        return {"returned_time": Variable(each, self.times), "returned_count": Variable(each, self.counts)}

    def attrs(self) -> dict[str, int]:
        """The rest of what a tile keeps."""
        return {"total": self.total} | {f"{_FAILED}{name}": count for name, count in self.failed.items()}

    def add(self, tile: Dataset) -> None:
        """Count a tile's trajectories too."""
        self.total += int(tile.attrs["total"])
        for name, count in tile.attrs.items():
            if name.startswith(_FAILED):
                self.failed[name.removeprefix(_FAILED)] += int(count)
        both = np.concatenate([self.times, tile["returned_time"].data])
        counts = np.concatenate([self.counts, tile["returned_count"].data])
        self.times, place = np.unique(both, return_inverse=True)
        self.counts = np.bincount(place, counts, self.times.size).astype(np.int64)

    @property
    def share(self) -> float:
        """Share of the trajectories that returned; NaN of none."""
        return float(self.counts.sum() / self.total) if self.total else float("nan")

    def quantiles(self, wanted: Sequence[float]) -> Floats:
        """Quantiles of the time to return [s], linear between neighbours; NaN where none returned."""
        if not self.times.size:
            return np.full(len(wanted), np.nan)
        upto = np.cumsum(self.counts)
        place = np.asarray(wanted) * (upto[-1] - 1)
        low = np.floor(place)
        at_low, at_high = (self.times[np.searchsorted(upto, k, side="right")] for k in (low, np.ceil(place)))
        return np.asarray(at_low + (place - low) * (at_high - at_low))
