"""Bounds over boxes hold, and branch and prune finds islands of which the answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from fastmech.atlas.continuation import finish_on_edge, inside, trace
from fastmech.scene import Scene
from fastmech.slider.atlas import cover
from fastmech.slider.atlas.cover import DefiningSystem, apart, solutions
from fastmech.slider.atlas.systems import Plane, fold

PLANE = Plane(Scene(c1=294.9, alpha=0.0), ("F0", "l"), (-400.0, 0.3), (400.0, 2.0))


def test_values_and_slopes_stay_within_their_bounds() -> None:
    system = fold(PLANE)
    rng = np.random.default_rng(5)
    centre = np.column_stack([rng.uniform(-np.pi, np.pi, (4000, 2)), rng.random((4000, 2))])
    half = rng.random((4000, 4)) * 10.0 ** rng.uniform(-4.0, -0.3, (4000, 1))
    at = system.over(centre, np.zeros_like(half))
    found = system.over(centre, half)
    known = ~np.isnan(found.value[:, 0])
    for _ in range(50):
        z = centre + half * rng.uniform(-1.0, 1.0, half.shape)
        there = system.over(z, np.zeros_like(half))
        # Boxes without bounds are those of which one equation has no zero.
        assert (np.abs(there.value[~known]).max(axis=1) > 0.0).all()
        assert (np.abs(there.slope - at.slope)[known] <= found.bend[known] + 1e-13).all()
        room = ((np.abs(at.slope) + 0.5 * found.bend) * half[:, None]).sum(axis=2)
        assert (np.abs(there.value - at.value)[known] <= room[known] + 1e-13).all()
    assert 100 < known.sum() < 3900


def test_slopes_are_derivatives() -> None:
    """Against central differences."""
    z = np.array([0.3, -1.1, 0.7, 0.2])
    slope = fold(PLANE)(z)[1]
    for k in range(4):
        step = np.zeros(4)
        step[k] = 1e-6
        central = (fold(PLANE)(z + step)[0] - fold(PLANE)(z - step)[0]) / 2e-6
        assert slope[:, k] == pytest.approx(central, abs=1e-8)


def circles(radii: list[tuple[float, float, float]]) -> DefiningSystem:
    """phi = 1, theta = -2 and circles (u, v, radius) of parameters."""

    def equations(z):
        product = 1.0
        for u, v, radius in radii:
            x, y = z[2] - u, z[3] - v
            product = (x * x + y * y - radius**2) * product
        return np.sin(0.5 * z[0] - 0.5), np.sin(0.5 * z[1] + 1.0), product

    return DefiningSystem(equations, 4)


def test_islands_of_any_size_are_found_and_nothing_else() -> None:
    wanted = [(0.5, 0.5, 0.3), (0.51, 0.52, 1e-3), (0.9, 0.1, 1e-5)]
    for radii in (wanted[:1], wanted[1:2], wanted[2:], wanted[:2]):
        system = circles(radii)
        found = solutions(system, lambda z, s=system: trace(s, z, inside, finish_on_edge(s), apart))
        assert not len(found.open)
        assert len(found.curves) == len(radii)
        for curve in found.curves:
            assert curve.closed
            away = [
                np.abs(np.hypot(curve.points[:, 2] - u, curve.points[:, 3] - v) - r).max()
                for u, v, r in radii
            ]
            assert min(away) < 1e-9


def test_where_curves_cross_there_is_no_proof(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two lines that cross are singular where they do."""
    cross = DefiningSystem(lambda z: (np.sin(0.5 * z[0]), np.sin(0.5 * z[1]), (z[2] - 0.4) * (z[3] - 0.3)), 4)
    found = solutions(cross, lambda z: trace(cross, z, inside, finish_on_edge(cross), apart))
    assert len(found.open)
    assert np.abs(found.open - [0.0, 0.0, 0.4, 0.3]).max() < 1e-3
    monkeypatch.setattr(cover, "MOST_BOXES", 100)
    assert len(solutions(circles([(0.5, 0.5, 0.3)]), lambda z: None).open)
