"""The least speed of M2 that can leave a well, against blows that are integrated."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from fastmech.atlas.map import EquilibriumMap, map_equilibria
from fastmech.ensembles.integrate import integrate
from fastmech.mechanism.geometry import positions, velocities
from fastmech.mechanism.lagrange import kinetic_energy, potential_energy
from fastmech.scene import Scene

Floats = NDArray[np.float64]

BISTABLE = Scene(F0=85.3, c1=294.9, c2=92.85, alpha=0.0)
LIGHT = Scene(m1=0.5, m2=0.2, l=0.4, c1=12.0, c2=9.0, F0=1.5, alpha=0.0)

POINTS = 360
STEP = 2.0 * np.pi / POINTS
HALF = 3 * POINTS // 2


def atlas_of(scene: Scene) -> EquilibriumMap:
    return map_equilibria(scene, {"F0": [scene.F0]}, wells=True, threads=1)


def states(scene: Scene, place: Floats, blows: Floats) -> Floats:
    """States (n, 4) at rest's position in which M2 has the velocities (n, 2), by differences of x2, y2."""
    h = 1e-6
    jacobian = np.empty((2, 2))
    for k in range(2):
        ends = [np.concatenate([place + sign * h * np.eye(2)[k], [0.0, 0.0]]) for sign in (1.0, -1.0)]
        one, two = (positions(scene, end) for end in ends)
        jacobian[:, k] = (one.x2 - two.x2) / (2.0 * h), (one.y2 - two.y2) / (2.0 * h)
    rates = np.linalg.solve(jacobian, blows.T).T
    return np.concatenate([np.tile(place, (len(blows), 1)), rates], axis=1)


def leave(scene: Scene, atlas: EquilibriumMap, slot: int, starts: Floats, t_end: float) -> NDArray[np.bool_]:
    """Whether motions ever leave the component of {U < barrier} on the unwrapped plane."""
    place = starts[0, :2]
    grid = [place[k] + STEP * (np.arange(2 * HALF) - HALF) for k in range(2)]
    energy = potential_energy(scene, np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1), scene.F0)
    number, _ = ndimage.label(energy < atlas.energy[0, slot] + atlas.depth[0, slot])
    well = ndimage.binary_dilation(number == number[HALF, HALF], iterations=2)
    times = np.arange(0.0, t_end, 0.2)
    motion = integrate(scene, starts, t_end, dt=0.04, method="dop853", t_eval=times, threads=1)
    index = np.rint((motion.y[..., :2] - place) / STEP).astype(int) + HALF
    on_grid = ((index >= 0) & (index < 2 * HALF)).all(axis=-1)
    index = np.clip(index, 0, 2 * HALF - 1)
    return ~(well[index[..., 0], index[..., 1]] & on_grid).all(axis=0)


def test_bistable_scene() -> None:
    """Figures of an independent computation of sqrt(2 depth lambda_min(J M^-1 J^T))."""
    speed = atlas_of(BISTABLE).escape_speed[0]
    assert speed[:2] == pytest.approx([0.672, 0.350], abs=5e-4)
    assert np.isnan(speed[2:]).all()


@pytest.mark.parametrize("scene", [BISTABLE, LIGHT, Scene(alpha=0.0)], ids=["bistable", "light", "Table 1"])
def test_no_slower_motion_of_m2_has_the_energy(scene: Scene) -> None:
    atlas = atlas_of(scene)
    rng = np.random.default_rng(11)
    for slot in np.flatnonzero(atlas.morse_index[0] == 0):
        place = np.array([atlas.phi[0, slot], atlas.theta[0, slot]])
        y = np.concatenate([np.tile(place, (20_000, 1)), rng.normal(size=(20_000, 2))], axis=1)
        # Every motion scaled until its kinetic energy is the depth.
        y[:, 2:] *= np.sqrt(atlas.depth[0, slot] / kinetic_energy(scene, y))[:, None]
        velocity = velocities(scene, y)
        speed = np.hypot(velocity.x2, velocity.y2)
        bound = atlas.escape_speed[0, slot]
        assert speed.min() >= bound * (1.0 - 1e-12)
        assert speed.min() <= bound * (1.0 + 1e-3)


def test_slower_blows_stay_and_faster_ones_can_leave() -> None:
    atlas = atlas_of(BISTABLE)
    angle = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    every = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    for slot in (0, 1):
        place = np.array([atlas.phi[0, slot], atlas.theta[0, slot]])
        bound = atlas.escape_speed[0, slot]
        rod = np.array([np.sin(place[1]), np.cos(place[1])])
        free = BISTABLE.replace(beta=0.0)
        slow = states(BISTABLE, place, 0.99 * bound * every)
        assert not leave(free, atlas, slot, slow, 60.0).any()
        assert not leave(BISTABLE, atlas, slot, slow, 60.0).any()
        # Without damping a blow along the rod that is one part in a hundred above the bound gets out,
        # with damping it takes more.
        fast = states(BISTABLE, place, 1.01 * bound * np.array([rod, -rod]))
        assert leave(free, atlas, slot, fast, 150.0).any()
        assert not leave(BISTABLE, atlas, slot, fast, 150.0).any()


def test_in_line_the_speed_tells_nothing() -> None:
    """Unforced, crank and rod are in line (phi + theta = pi/2): M1 can move while M2 rests."""
    atlas = atlas_of(Scene(F0=0.0, alpha=0.0))
    assert atlas.depth[0, 0] > 100.0
    assert atlas.escape_speed[0, 0] < 1e-12
