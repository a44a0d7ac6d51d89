"""Parameters of the trajectories of an ensemble, of which most are shared by all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.ensembles.lanes import lie_together

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Parameters:
    """Columns of parameters, each a number that all trajectories share, or one of each.

    Rows are made for those who run: all of ten million trajectories would take 640 MB.
    """

    columns: tuple[Floats, ...]  #: each of shape () or (n,)

    @classmethod
    def of(cls, values: ArrayLike | Parameters) -> Parameters:
        """From those of all (count,) or of each (n, count)."""
        if isinstance(values, Parameters):
            return values
        given = np.asarray(values, dtype=np.float64)
        return cls(tuple(np.asarray(column) for column in given.T))

    @property
    def shared(self) -> bool:
        """Whether all trajectories have the same ones."""
        return not any(column.ndim for column in self.columns)

    def at(self, members: NDArray[np.int64], precision: Any = np.float64) -> Floats:
        """Those of trajectories whose indices rise, shape (members, count), or of all (count,)."""
        with np.errstate(over="ignore"):  # trajectories of which one is too large for float32 have a status
            if self.shared:
                return np.array(self.columns, dtype=precision)
            rows = np.empty((members.size, len(self.columns)), dtype=precision)
            together = slice(members[0], members[-1] + 1) if lie_together(members) else None
            for k, column in enumerate(self.columns):
                if not column.ndim:
                    rows[:, k] = column
                else:
                    rows[:, k] = column.take(members) if together is None else column[together]
        return rows

    def block(self, n: int) -> Floats:
        """Those of n trajectories, which are all, as kernels are given them: shape (count, n)."""
        rows = np.empty((len(self.columns), n))
        for row, column in zip(rows, self.columns, strict=True):
            row[:] = column
        return rows

    def part(self, members: NDArray[np.int64]) -> Parameters:
        """Those of some trajectories."""
        return Parameters(tuple(column[members] if column.ndim else column for column in self.columns))
