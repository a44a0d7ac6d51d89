"""Tiles so small that a short scan of any kind has many of them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from fastmech.scan_types import basins, disturbed, equilibrium_map, snapping

#: What decides the size of tiles, and what it is while they are to be small.
SIZES = (
    (equilibrium_map, "TILE_POINTS", 20),
    (basins, "TILE_POINTS", 20),
    (disturbed, "EVALUATIONS", 1),
    (disturbed, "DIRECTIONS", 3),
    (snapping, "TILE_POINTS", 6),
)


@contextmanager
def small_tiles() -> Iterator[None]:
    """Small tiles in this process while the block runs."""
    before = [getattr(module, name) for module, name, _ in SIZES]
    dask_setup()
    try:
        yield
    finally:
        for (module, name, _), size in zip(SIZES, before, strict=True):
            setattr(module, name, size)


def dask_setup(worker: object = None) -> None:
    """Small tiles from now on; so begins a Dask worker that is started with this module as its preload."""
    for module, name, size in SIZES:
        setattr(module, name, size)
