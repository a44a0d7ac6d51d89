"""The barrier tree against floods of the potential on grids of the unwrapped plane."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from fastmech.errors import InputError
from fastmech.scene import Scene
from fastmech.slider.capture.barriers import Effect, _lattice, barrier_tree
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
def test_components_are_those_of_a_flood(name: str) -> None:
    """Just above and below every saddle: who is connected with the first copy of each well."""
    scene = SCENES[name]
    tree = barrier_tree(scene)
    span = np.ptp(tree.equilibria.energy)
    for opening in tree.openings:
        for level in (opening.energy - 4e-3 * span, opening.energy + 4e-3 * span):
            if np.abs(tree.equilibria.energy - level).min() < 3e-3 * span:
                continue  # another saddle is nearer than the grid can see
            number, angle = flood(scene, tree.equilibria.force, level)

            def at(well: int, turns: tuple[int, int], number=number, angle=angle) -> int:
                e = tree.equilibria[well]
                place = (e.phi + TURN * turns[0], e.theta + TURN * turns[1])
                return int(number[tuple(int(np.argmin(np.abs(angle - x))) for x in place)])

            for part in tree.components(level):
                (first, home), *others = part.members.items()
                assert at(first, (0, 0)) > 0
                for well, turns in others:
                    assert at(well, (turns[0] - home[0], turns[1] - home[1])) == at(first, (0, 0))
                reached = {
                    (i, j)
                    for i in range(-1, 2)
                    for j in range(-1, 2)
                    if at(first, (i, j)) == at(first, (0, 0))
                }
                # A component that needs a detour beyond the tiles to meet its copy looks unconnected.
                assert (0, 0) in reached
                assert (len(reached) > 1) <= (not part.bounded)
                assert part.bounded or len(reached) > 1 or max(map(abs, sum(part.periods, ()))) > 1
            others_of = {well for part in tree.components(level) for well in part.members}
            assert others_of == {w for w in tree.wells if tree.equilibria[w].energy < level}


def test_table_1_is_a_strip_in_theta_and_then_the_plane() -> None:
    tree = barrier_tree(Scene(alpha=0.0))
    assert [o.effect for o in tree.openings] == [Effect.REPEATS, Effect.REPEATS]
    low, high = (o.energy for o in tree.openings)
    assert tree.barrier == pytest.approx([low])
    (part,) = tree.components(low)
    assert part.bounded
    (part,) = tree.components(0.5 * (low + high))
    assert part.periods == [(0, 1)]
    (part,) = tree.components(high + 1.0)
    assert part.periods == [(1, 0), (0, 1)]


def test_without_force_one_saddle_only_encloses_a_maximum() -> None:
    """Mirror image: six equilibria, and the hanging saddle lies between the two maxima."""
    effects = [o.effect for o in barrier_tree(Scene(F0=0.0)).openings]
    assert effects == [Effect.REPEATS, Effect.REPEATS, Effect.ENCLOSES]


def test_scenes_without_certain_wells_are_refused() -> None:
    with pytest.raises(InputError, match=r"scene: its wells are not certain"):
        barrier_tree(Scene(g=0.0, F0=0.0, c1=0.0))


def test_lattices() -> None:
    """Hermite normal forms worked out by hand."""
    assert _lattice([(0, 0)]) == []
    assert _lattice([(0, -2), (0, 3)]) == [(0, 1)]
    assert _lattice([(2, 1), (0, 3), (4, 2)]) == [(2, 1), (0, 3)]
    assert _lattice([(-1, 1), (1, 1)]) == [(1, 1), (0, 2)]
