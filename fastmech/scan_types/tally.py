"""Counts and exact quantiles of ensembles that come in blocks and are never in memory together."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fastmech.basins.measures.fractions import wilson
from fastmech.ensembles.status import ENDS, failure_counts
from fastmech.results import Dataset, Variable

Floats = NDArray[np.float64]

_ENDED = "ended_"


@dataclass
class Tally:
    """How many trajectories end where, and when they were back: times are ends of steps, so few differ.

    Attributes:
        ended: trajectories by the name of their outcome.
        times, counts: the times to return that occur [s], rising, and how often. Who returns later than the
            end of the run is not among them.
    """

    ended: Counter[str] = field(default_factory=Counter)
    times: Floats = field(default_factory=lambda: np.zeros(0))
    counts: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @classmethod
    def of(cls, outcome: NDArray[np.int8], time_to_return: Floats) -> Tally:
        """The tally of a block; NaN stands for no return by the end of the run."""
        times, counts = np.unique(time_to_return[np.isfinite(time_to_return)], return_counts=True)
        return cls(Counter(failure_counts(outcome, ENDS)), times, counts.astype(np.int64))

    def variables(self) -> dict[str, Variable]:
        """The times and counts as a tile keeps them."""
        each = ("returned",)
        return {"returned_time": Variable(each, self.times), "returned_count": Variable(each, self.counts)}

    def attrs(self) -> dict[str, int]:
        """The rest of what a tile keeps."""
        return {f"{_ENDED}{name}": count for name, count in self.ended.items()}

    def add(self, tile: Dataset) -> None:
        """Count a tile's trajectories too."""
        for name, count in tile.attrs.items():
            if name.startswith(_ENDED):
                self.ended[name.removeprefix(_ENDED)] += int(count)
        both = np.concatenate([self.times, tile["returned_time"].data])
        counts = np.concatenate([self.counts, tile["returned_count"].data])
        self.times, place = np.unique(both, return_inverse=True)
        self.counts = np.bincount(place, counts, self.times.size).astype(np.int64)

    def shares(self) -> dict[str, float]:
        """Share that returned, if all not known did, and the 95 % Wilson interval of both; NaN of none."""
        n, returned = self.ended.total(), self.ended["returned"]
        if not n:
            return dict.fromkeys(SHARES, float("nan"))
        most = n - self.ended["elsewhere"]
        lower, upper = wilson(returned, n)[0], wilson(most, n)[1]
        return dict(zip(SHARES, (returned / n, most / n, float(lower), float(upper)), strict=True))

    def quantiles(self, wanted: Sequence[float]) -> Floats:
        """Quantiles of the time to return [s], linear between neighbours; NaN where none returned.

        Infinite where they are among those that return later than the end of the run.
        """
        returned = self.ended["returned"]
        if not returned:
            return np.full(len(wanted), np.nan)
        times = np.append(self.times, np.inf)
        upto = np.cumsum(np.append(self.counts, returned - self.counts.sum()))
        place = np.asarray(wanted) * (returned - 1)
        low = np.floor(place)
        at_low, at_high = (times[np.searchsorted(upto, k, side="right")] for k in (low, np.ceil(place)))
        with np.errstate(invalid="ignore"):  # infinite less infinite is not used
            return np.where(at_low == at_high, at_low, at_low + (place - low) * (at_high - at_low))


#: Names of the shares: of what is proved, if all that is not known returned, the interval of both.
SHARES = ("share_returned", "share_returned_at_most", "share_returned_lower", "share_returned_upper")
