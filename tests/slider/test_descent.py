"""Depth of wells against flooding the potential on a grid of the unwrapped plane."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from fastmech.scene import Scene
from fastmech.slider.atlas.map import EquilibriumMap, map_equilibria
from fastmech.slider.lagrange import potential_energy

TILES, POINTS = 5, 180


def flooded(scene: Scene, atlas: EquilibriumMap, slot: int, level: float) -> int:
    """Minima, copies counted, in the component of the sublevel set around a minimum."""
    step = 2.0 * np.pi / POINTS
    axis = atlas.phi[0, slot] + step * (np.arange(TILES * POINTS) - TILES * POINTS // 2)
    other = atlas.theta[0, slot] + step * (np.arange(TILES * POINTS) - TILES * POINTS // 2)
    q = np.stack(np.meshgrid(axis, other, indexing="ij"), axis=-1)
    number, _ = ndimage.label(potential_energy(scene, q, scene.F0) < level)
    home = number[TILES * POINTS // 2, TILES * POINTS // 2]
    assert home > 0
    found = 0
    for k in np.flatnonzero(atlas.morse_index[0] == 0):
        for turn1 in range(-1, 2):
            for turn2 in range(-1, 2):
                place = (
                    atlas.phi[0, k] + 2 * np.pi * turn1 - axis[0],
                    atlas.theta[0, k] + 2 * np.pi * turn2 - other[0],
                )
                i, j = (round(x / step) for x in place)
                if 0 <= i < len(axis) and 0 <= j < len(other):
                    found += number[i, j] == home
    return int(found)


SCENES = {
    "Table 1": Scene(alpha=0.0),
    "unforced": Scene(alpha=0.0, F0=0.0),
    "bistable": Scene(F0=85.3, c1=294.9, c2=92.85, alpha=0.0),
    "bistable, strong force": Scene(F0=300.0, c1=294.9, c2=150.0, alpha=0.0),
    "bistable, soft": Scene(F0=30.0, c1=294.9, c2=70.0, alpha=0.0),
    "two maxima": Scene(F0=10.0, c1=100.0, alpha=0.0),
    "light": Scene(m1=0.5, m2=0.2, l=0.4, c1=12.0, c2=9.0, F0=1.5, alpha=0.0),
}


@pytest.mark.parametrize("name", SCENES)
def test_depth_is_where_the_flood_first_meets_another_minimum(name: str) -> None:
    scene = SCENES[name]
    atlas = map_equilibria(scene, {"F0": [scene.F0]}, wells=True)
    span = np.nanmax(atlas.energy) - np.nanmin(atlas.energy)
    for slot in np.flatnonzero(atlas.morse_index[0] == 0):
        barrier = atlas.energy[0, slot] + atlas.depth[0, slot]
        # The grid sees a saddle to a part in a thousand of the span of energies.
        assert atlas.depth[0, slot] > 0.0
        assert flooded(scene, atlas, slot, barrier - min(1e-3 * span, 0.5 * atlas.depth[0, slot])) == 1
        assert flooded(scene, atlas, slot, barrier + 3e-3 * span) > 1


def test_table_1_leaves_over_the_lower_of_two_saddles() -> None:
    """Between 27.3 and 146.3 J (the design's figures) the sublevel set is an endless strip in theta."""
    atlas = map_equilibria(Scene(c2=1100 / 3, alpha=0.0), {"F0": [100.0]}, wells=True)
    saddles = np.sort(atlas.energy[0][atlas.morse_index[0] == 1])
    barrier = atlas.energy[0, 0] + atlas.depth[0, 0]
    assert barrier == pytest.approx(saddles[0])
    assert saddles[1] - saddles[0] == pytest.approx(146.3 - 27.3, abs=0.15)


def test_depths_are_left_out_unless_asked_for() -> None:
    assert np.isnan(map_equilibria(Scene(alpha=0.0), {"F0": [100.0]}).depth).all()
