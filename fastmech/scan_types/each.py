"""A scan of a few pieces, each a tile, which are joined in memory."""

from __future__ import annotations

from collections.abc import Callable

from fastmech.results import Dataset
from fastmech.scan_types.tiling import RunContext, Tiles, Tiling


class Each(Tiling):
    """Some pieces of work, one a tile.

    Args:
        what: what the pieces are, for progress.
        count: how many there are.
        compute: gives a piece by its number.
        join: makes the section of all pieces.
    """

    def __init__(
        self,
        what: str,
        count: int,
        compute: Callable[[int], Dataset],
        join: Callable[[list[Dataset]], Dataset],
    ) -> None:
        self.what, self.count = what, count
        self._compute, self._join = compute, join

    def items(self, index: int) -> int:
        """One."""
        return 1

    def compute(self, index: int, context: RunContext) -> Dataset:
        """Compute a piece."""
        return self._compute(index)

    def assemble(self, tile: Tiles) -> Dataset:
        """Join the pieces."""
        return self._join([tile(index) for index in range(self.count)])
