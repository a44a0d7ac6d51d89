"""Tiles of equilibrium maps so small that a short scan has many of them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from fastmech.scan_types import map_tiling

#: Points of a tile.
POINTS = 20


@contextmanager
def small_tiles() -> Iterator[None]:
    """Small tiles in this process while the block runs."""
    before, map_tiling.TILE_POINTS = map_tiling.TILE_POINTS, POINTS
    try:
        yield
    finally:
        map_tiling.TILE_POINTS = before


def dask_setup(worker: object) -> None:
    """Small tiles in a Dask worker that is started with this module as its preload."""
    map_tiling.TILE_POINTS = POINTS
