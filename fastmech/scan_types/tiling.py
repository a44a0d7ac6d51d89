"""How a section of a result is divided into independent pieces of work, and how they become the section."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from fastmech.results import Dataset
from fastmech.store.stream import Stream

if TYPE_CHECKING:
    from fastmech.ensembles.run import Progress

#: Gives a finished tile by its index.
Tiles: TypeAlias = "Callable[[int], Dataset]"


@dataclass(frozen=True)
class RunContext:
    """What a scan may use while it runs."""

    threads: int | None = None  #: threads to use, all processors by default
    stage: Callable[[str, int], Progress] = lambda name, total: lambda finished: None
    """``stage(name, total)`` announces a piece of work; its result is told what has been finished since."""
    check: Callable[[], None] = lambda: None
    """Called now and then within a tile: raises KeyboardInterrupt where the work is to end."""


class Tiling(ABC):
    """A section as tiles: pieces of work that need nothing of each other and give the same bits anywhere.

    How a scan is divided depends on its request alone, never on threads or workers. A tile should take
    seconds: it is what an interruption costs, and its result (some 100 MB at most) is held in memory.

    Attributes:
        what: what the items of work are, for progress, such as ``"disturbed trajectories"``.
        count: number of tiles.
    """

    what: str
    count: int

    @abstractmethod
    def items(self, index: int) -> int:
        """How many items of work (points, trajectories) a tile has."""

    @abstractmethod
    def compute(self, index: int, context: RunContext) -> Dataset:
        """Compute a tile."""

    @abstractmethod
    def assemble(self, tile: Tiles) -> Dataset | Stream:
        """The section of all its tiles; a stream takes one tile at a time into memory."""

    def missing(self, index: int) -> Dataset | None:
        """What stands for a tile that is not there yet in a look at a running scan, if that can be."""
        return None


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
