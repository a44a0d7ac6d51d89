"""Importing this makes the tiles of equilibrium maps so small that a short scan has many of them."""

from __future__ import annotations

from fastmech.scan_types import map_tiling

map_tiling.TILE_POINTS = 20
