from __future__ import annotations

import numpy as np
import pytest
from slider.draws import draws

from fastmech.scene import Scene
from fastmech.slider import geometry

pytestmark = pytest.mark.nojit


def test_positions_satisfy_the_constraints() -> None:
    """Paper (2)-(5), to 1e-12 of l^2."""
    for d in draws():
        residuals = geometry.constraints(d.scene, geometry.positions(d.scene, d.y))
        assert residuals.shape == (4,)
        assert np.max(np.abs(residuals)) <= 1e-12 * d.scene.l**2


def test_velocities_satisfy_the_differentiated_constraints() -> None:
    """d/dt of (2), (3), (5): every rod is perpendicular to the relative velocity of its ends."""
    for d in draws():
        r, v = geometry.positions(d.scene, d.y), geometry.velocities(d.scene, d.y)
        rods = (
            r.x1 * v.x1 + r.y1 * v.y1,
            (r.x2 - r.x1) * (v.x2 - v.x1) + (r.y2 - r.y1) * (v.y2 - v.y1),
            (r.x3 - r.x1) * (v.x3 - v.x1) + (r.y3 - r.y1) * (v.y3 - v.y1),
        )
        assert np.max(np.abs(rods)) <= 1e-12 * d.scene.l**2 * np.abs(d.rates).sum()
        assert v.y3 == 0


@pytest.mark.parametrize(
    ("index", "point", "change", "residual"),
    [
        (0, "x1", 0.5, 0.25),
        (1, "y2", -0.5, 1.25),
        (2, "y3", 0.25, 0.25),
        (3, "x3", 1.0, 2 * np.sqrt(3.0) + 1.0),
    ],
)
def test_a_point_out_of_place_leaves_a_residual(
    index: int, point: str, change: float, residual: float
) -> None:
    """l = 1, phi = pi/2, theta = 0: M1 = (0, 1), M2 = (0, 0), M3 = (sqrt 3, 0)."""
    scene = Scene(l=1.0)
    r = geometry.positions(scene, [np.pi / 2, 0.0, 0.0, 0.0])
    moved = r._replace(**{point: getattr(r, point) + change})
    assert geometry.constraints(scene, moved)[index] == pytest.approx(residual, abs=1e-14)


def test_dead_centres_and_turns() -> None:
    """Closed forms: phi = 0 and pi stretch the slider to 3 l and l; M2 hangs below M1 at theta = 0."""
    scene = Scene(l=2.0)
    y = np.array([[0.0, 0.0, 0, 0], [np.pi, 0.0, 0, 0], [np.pi / 2, np.pi / 2, 0, 0]])
    r = geometry.positions(scene, y)
    np.testing.assert_allclose(r.x3, [6.0, 2.0, 2.0 * np.sqrt(3.0)], rtol=1e-15)
    np.testing.assert_allclose([r.x2, r.y2], [[2.0, -2.0, -2.0], [-2.0, -2.0, 2.0]], atol=1e-15)


def test_shapes_broadcast_over_states() -> None:
    y = np.random.default_rng(3).uniform(-2, 2, (5, 7, 4))
    many = geometry.velocities(Scene(), y)
    one = geometry.velocities(Scene(), y[2, 3])
    for component, single in zip(many, one, strict=True):
        assert component.shape == (5, 7)
        assert component[2, 3] == pytest.approx(single, rel=1e-15, abs=1e-300)
