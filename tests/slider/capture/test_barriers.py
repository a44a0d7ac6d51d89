"""The barrier tree against floods of the potential on grids of the unwrapped plane."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from fastmech.errors import InputError
from fastmech.scene import Scene
from fastmech.slider.capture.certificate import barrier_tree
from fastmech.slider.lagrange import potential_energy

TURN = 2.0 * np.pi
TILES, POINTS = 5, 160

SCENES = {
    "Table 1": Scene(alpha=0.0),
    "unforced": Scene(alpha=0.0, F0=0.0),
    "decaying": Scene(),
    "bistable": Scene(F0=85.3, c1=294.9, c2=92.85, alpha=0.0),
    "bistable, soft": Scene(F0=30.0, c1=294.9, c2=70.0, alpha=0.0),
}


def flood(scene: Scene, force: float, level: float) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the components of {U < level} on TILES x TILES turns, and the angles of the grid."""
    angle = (np.arange(TILES * POINTS) - TILES * POINTS // 2) * TURN / POINTS
    q = np.stack(np.meshgrid(angle, angle, indexing="ij"), axis=-1)
    return ndimage.label(potential_energy(scene, q, force) < level)[0], angle


@pytest.mark.parametrize("name", SCENES)
def test_barriers_are_where_a_flood_first_meets_another_well_or_copy(name: str) -> None:
    scene = SCENES[name]
    tree = barrier_tree(scene)
    span = np.ptp(tree.equilibria.energy)
    for well, barrier, saddle in zip(tree.wells, tree.barrier, tree.passes, strict=True):
        assert barrier == tree.equilibria[saddle].energy
        for level in (barrier - 4e-3 * span, barrier + 4e-3 * span):
            if np.abs(tree.equilibria.energy - level).min() < 3e-3 * span:
                continue  # another saddle is nearer than the grid can see
            number, angle = flood(scene, tree.equilibria.force, level)

            def at(one: int, turns: tuple[int, int], number=number, angle=angle) -> int:
                e = tree.equilibria[one]
                place = (e.phi + TURN * turns[0], e.theta + TURN * turns[1])
                return int(number[tuple(int(np.argmin(np.abs(angle - x))) for x in place)])

            assert at(well, (0, 0)) > 0
            met = {
                (one, i, j)
                for one in tree.wells
                for i in range(-1, 2)
                for j in range(-1, 2)
                if at(one, (i, j)) == at(well, (0, 0))
            }
            assert (met > {(well, 0, 0)}) == (level > barrier)


def test_table_1_is_left_over_the_lower_saddle() -> None:
    tree = barrier_tree(Scene(alpha=0.0))
    saddles = [e.energy for e in tree.equilibria if e.morse_index == 1]
    assert tree.barrier == pytest.approx([min(saddles)])
    assert "over equilibrium 1" in tree.told()


def test_scenes_without_certain_wells_are_refused() -> None:
    with pytest.raises(InputError, match=r"scene: its wells are not certain"):
        barrier_tree(Scene(g=0.0, F0=0.0, c1=0.0))
