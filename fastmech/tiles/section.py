"""One section of a request and its tiles, in a form that any process can compute them from."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import lru_cache

from fastmech.errors import InputError
from fastmech.scan_types.request import Request, RunContext, Scan
from fastmech.scan_types.tiling import Tiling
from fastmech.scene import Scene
from fastmech.tiles.tile_file import Tile, make_tile


@dataclass(frozen=True, eq=False)
class TiledSection:
    """A section: its name, its scan, the scene with the scan's changes and the identity of the request."""

    name: str
    scan: Scan
    scene: Scene
    identity: str

    def __eq__(self, other: object) -> bool:
        return isinstance(other, TiledSection) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)

    @property
    def _key(self) -> tuple[str, str]:
        return self.identity, self.name

    @property
    def tiling(self) -> Tiling:
        """How the section is divided; found once in a process."""
        return _tiling(self)

    def compute(self, index: int, context: RunContext, share: float = 1.0) -> Tile:
        """Compute a tile.

        Args:
            index: which.
            context: threads to use and where progress is told.
            share: part of the machine that it has to itself, for the account of the wall time.

        Raises:
            InputError: the scan refuses.
        """
        started = time.perf_counter()
        try:
            dataset = self.tiling.compute(index, context)
        except InputError as error:
            raise InputError(f"scan.{self.name}: {error}") from None
        seconds = (time.perf_counter() - started) * share
        return make_tile(self.identity, self.name, index, dataset, seconds)


@lru_cache(maxsize=64)
def _tiling(section: TiledSection) -> Tiling:
    try:
        return section.scan.tiling(section.scene)
    except InputError as error:
        raise InputError(f"scan.{section.name}: {error}") from None


def sections_of(request: Request, identity: str) -> list[TiledSection]:
    """The sections of a request, in its order."""
    return [
        TiledSection(name, scan, request.scene_of(name), identity) for name, scan in request.scans.items()
    ]
