"""One section of a request and its tiles, in a form that any process can compute them from."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

from fastmech.errors import InputError
from fastmech.results import Dataset
from fastmech.scan_types.request import Request, RunContext, Scan, Tiles, Tiling
from fastmech.scene import Scene
from fastmech.store.schema import CHANGE
from fastmech.store.write import Stream, in_memory
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


#: Bytes of streamed variables up to which a section is made in memory.
IN_MEMORY_BYTES = 64 << 20


def assembled(
    section: TiledSection, tile: Tiles, seconds: float, notes: Mapping[str, str] | None = None
) -> Dataset | Stream:
    """A section of its tiles, with the attributes that every section has.

    Args:
        section: which.
        tile: gives its tiles.
        seconds: wall time that they took [s].
        notes: further attributes.
    """
    result = section.tiling.assemble(tile)
    if isinstance(result, Stream) and result.nbytes <= IN_MEMORY_BYTES:
        result = in_memory(result)
    changes = {f"{CHANGE}{key}": float(value) for key, value in section.scan.scene.items()}
    own = {"kind": section.scan.kind, **changes, **(notes or {})}
    told = section.scan.step_warning(section.scene)
    if told is not None:
        own["step_warning"] = told
    if isinstance(result, Stream):
        attrs = {**own, **result.fixed.attrs, "wall_time_s": seconds}
        return replace(result, fixed=replace(result.fixed, attrs=attrs))
    return replace(result, attrs={**own, **result.attrs, "wall_time_s": seconds})
