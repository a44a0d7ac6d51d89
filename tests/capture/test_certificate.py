"""What the certificate says about states, against floods and energies by the oracle's formulas."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from fastmech.capture.select import trapped
from fastmech.scene import Scene
from fastmech.slider.lagrange import kinetic_energy, potential_energy

TURN = 2.0 * np.pi

#: Two neighbours of a grid may straddle a saddle; so far [J] below it none do.
COL = 0.5
CONSTANT = Scene(alpha=0.0)
BISTABLE = Scene(F0=85.3, c1=294.9, c2=92.85, alpha=0.0)


def random_states(n: int, fastest: float, seed: int = 3) -> np.ndarray:
    rng = np.random.default_rng(seed)
    angles = rng.uniform(-1.5 * np.pi, 1.5 * np.pi, (n, 2))
    return np.concatenate([angles, rng.uniform(-fastest, fastest, (n, 2))], axis=1)


@pytest.mark.parametrize(
    ("scene", "barriers"),
    # Minima [rad] and the saddle energies at which the floods of test_barriers first meet a copy [J].
    [
        (CONSTANT, {(1.4514, -0.2332): 854.139}),
        (BISTABLE, {(0.7080, 0.4990): 129.472, (-2.652, -1.706): 129.472}),
    ],
)
def test_positions_against_a_flood(scene: Scene, barriers: dict[tuple[float, float], float]) -> None:
    """Who is inside which copy's component of {U < B}, decided on a grid of three turns."""
    states = random_states(6000, 1.0)
    found = trapped(scene, states)
    points = 600
    angle = np.linspace(-2.5 * np.pi, 2.5 * np.pi, points)
    step = angle[1] - angle[0]
    potential = potential_energy(scene, np.stack(np.meshgrid(angle, angle, indexing="ij"), -1), scene.F0)
    energy = kinetic_energy(scene, states) + potential_energy(scene, states[:, :2], scene.F0)
    inside = np.zeros(len(states), dtype=bool)
    cell = np.round((states[:, :2] - angle[0]) / step).astype(int)
    for (phi, theta), barrier in barriers.items():
        number, _ = ndimage.label(potential < barrier - COL)
        for i in (-1, 0, 1):
            for j in (-1, 0, 1):
                place = np.array([phi + TURN * i, theta + TURN * j])
                if np.abs(place).max() > angle[-1]:
                    continue
                home = number[tuple(np.round((place - angle[0]) / step).astype(int))]
                here = (number[cell[:, 0], cell[:, 1]] == home) & (energy < barrier - COL)
                inside |= here
                assert (found.turns[here] == (i, j)).all()
    missed = inside & (found.well < 0)
    assert inside.sum() > 20
    assert not missed.any()
    # What the certificate has and the grid has not is within a grid step of the edge, or of the energy's.
    assert np.count_nonzero((found.well >= 0) & ~inside) <= 0.02 * len(states)


def test_captured_means_below_the_barrier() -> None:
    states = random_states(2000, 6.0)
    energy = kinetic_energy(CONSTANT, states) + potential_energy(CONSTANT, states[:, :2], 100.0)
    captured = trapped(CONSTANT, states).well >= 0
    assert 0.05 < captured.mean() < 0.95
    assert (energy[captured] < 854.1394).all()


def test_turns_are_counted_from_the_listed_well() -> None:
    states = np.array([[1.45 + TURN * 3, -0.23 - TURN * 200, 0.0, 0.0], [1.45, -0.23, 0.0, 40.0]])
    found = trapped(CONSTANT, states)
    assert found.well.tolist() == [0, -1]
    assert found.turns[0].tolist() == [3, -200]


def test_decaying_force_needs_the_work_bound_too() -> None:
    """T + Pi + |F0| (2 l - sgn(F0) x2) below 924.595125 J = Pi of the saddle at (pi/2, pi), from (10)."""
    scene = Scene(F0=-100.0)
    states = random_states(3000, 4.0)
    x2 = scene.l * (np.cos(states[:, 0]) - np.sin(states[:, 1]))
    bound = kinetic_energy(scene, states) + potential_energy(scene, states[:, :2]) + 100.0 * (2.5 + x2)
    captured = trapped(scene, states).well >= 0
    assert captured.any()
    assert (bound[captured] < 924.595125).all()
    near = np.abs(states[:, :2] - [np.pi / 2, 0.0]).max(axis=1) < 1.0
    assert captured[near & (bound < 924.5)].all()


def test_states_that_are_not_finite_are_nowhere() -> None:
    assert trapped(CONSTANT, [[np.nan, 0, 0, 0], [np.inf, 0, 0, 0], [1e9, 0, 0, 0]]).well.tolist() == [-1] * 3
