from __future__ import annotations

import numpy as np
import pytest
from disturbance.known import equilibria, known, oracle_size
from oracles import oracle

from fastmech.disturbance.motion import size_at
from fastmech.scene import Scene

pytestmark = pytest.mark.nojit


@pytest.mark.parametrize("scene_name", ["table_1", "bistable"])
@pytest.mark.parametrize("morse_index", [0, 1, 2])
def test_size_is_the_kinetic_energy_norm(scene_name: str, morse_index: int) -> None:
    scene = known(scene_name)[0]
    disturbances = np.random.default_rng(1).standard_normal((3, 5, 4))
    for e in equilibria(scene_name, morse_index):
        sizes = size_at(scene, e.phi, e.theta)(disturbances)
        assert sizes.shape == (3, 5)
        np.testing.assert_allclose(sizes, oracle_size(scene, e, disturbances), rtol=1e-12)


def test_a_departure_of_theta_alone_has_its_angle_as_size() -> None:
    size = size_at(known("table_1")[0], 1.45, -0.23)
    np.testing.assert_allclose(size(np.array([[0, 0.3, 0, 0], [0, -2.0, 0, 0]])), [0.3, 2.0], rtol=1e-15)


def test_size_measures_kinetic_energy() -> None:
    """size^2 omega^2 m2 l^2 / 2 is T of the rates, and of the angles turned to rates."""
    scene = known("table_1")[0]
    (e,) = equilibria("table_1", 0)
    size = size_at(scene, e.phi, e.theta)
    rates = np.array([0.4, -0.9])
    energy = float(oracle().kinetic_energy(scene.parameters, (e.phi, e.theta, *rates)))
    for disturbance in (np.array([0, 0, *rates]), np.array([*rates / size.omega, 0, 0])):
        assert size(disturbance) ** 2 * size.omega**2 * 12 * 1.25**2 / 2 == pytest.approx(energy, rel=1e-12)


def test_ball_keeps_lengths() -> None:
    size = size_at(known("table_1")[0], 1.45, -0.23)
    points = np.random.default_rng(2).standard_normal((50, 4))
    np.testing.assert_allclose(size(size.from_ball(points)), np.linalg.norm(points, axis=1), rtol=1e-13)


def test_without_stiffness_the_norm_is_still_defined() -> None:
    scene = Scene(c1=0.0, c2=0.0, g=0.0, F0=0.0)
    assert size_at(scene, 0.3, 0.2).omega == 1.0
