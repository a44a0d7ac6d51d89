"""What an impulse does, against the SymPy-derived velocities and metric of the oracle."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from oracles import oracle
from slider.draws import doubles, draws

from fastmech.scene import Scene
from fastmech.slider.coefficients import reduce
from fastmech.slider.impulse import POINTS, impulse_for, mobility, rates_after

pytestmark = pytest.mark.nojit

Floats = NDArray[np.float64]


def jacobian(params: dict[str, Any], q: Floats, on: str) -> Floats:
    """Velocities of a point per unit of phi' and theta', by the oracle; shape (2, 2)."""
    columns = [doubles(oracle().velocities(params, [*q, *rates])) for rates in ((1.0, 0.0), (0.0, 1.0))]
    first = 2 * (int(on[1]) - 1)
    return np.stack([column[first : first + 2] for column in columns], axis=1)


@pytest.mark.parametrize("on", POINTS)
def test_mobility_is_that_of_the_derived_equations(on: str) -> None:
    """B a^-1 B^T of 40 random scenes and places; a rotation of its eigenvalues, and of quadratic forms."""
    rng = np.random.default_rng(3)
    for d in draws(40):
        B, c = jacobian(d.params, d.q, on), reduce(d.scene)
        W = B @ np.linalg.solve(doubles(oracle().metric(d.params, d.q)), B.T)
        moves = mobility(d.scene.m2, c.mass, c.slider, *d.q, on)
        scale = np.abs(W).max()
        np.testing.assert_allclose([moves.least, moves.greatest], np.linalg.eigvalsh(W), atol=1e-12 * scale)
        angle = rng.uniform(-7.0, 7.0)
        u = np.array([np.cos(angle), np.sin(angle)])
        assert float(moves.along(angle)) == pytest.approx(u @ W @ u, abs=1e-12 * scale)
        assert float(moves.speed(angle)) == pytest.approx(np.linalg.norm(W @ u), abs=1e-12 * scale)
        rates = rates_after(d.scene, d.q, on, 3.0 * u)
        momenta = doubles(oracle().metric(d.params, d.q)) @ rates
        np.testing.assert_allclose(momenta, 3.0 * B.T @ u, atol=1e-11 * max(np.abs(B).max(), 1e-300))


def test_what_cannot_be_struck_has_no_mobility() -> None:
    """In closed form: m2 across the rod, the masses that a blow along it drags, and what cannot move."""
    scene = Scene()
    c = reduce(scene)

    def moves(on: str, phi: float, theta: float = 0.0) -> Any:
        return mobility(scene.m2, c.mass, c.slider, phi, theta, on)

    up = 0.5 * np.pi  # the crank upright: k = 1, and the rod hangs in line with it
    assert 1.0 / moves("M1", up).greatest == pytest.approx(scene.m1 + scene.m3, rel=1e-15)
    assert 1.0 / moves("M3", up).greatest == pytest.approx(scene.m1 + scene.m3, rel=1e-15)
    assert 1.0 / moves("M2", up).along(0.0) == pytest.approx(scene.m2, rel=1e-15)
    assert moves("M2", up).along(up) == 0.0
    assert moves("M1", up).along(up) == 0.0
    assert moves("M3", up).along(up) == 0.0
    assert 1.0 / moves("M2", 0.0).along(up) == pytest.approx(scene.m1 + scene.m2, rel=1e-15)
    for dead in (0.0, np.pi, -np.pi):
        assert moves("M3", dead).greatest == 0.0
        assert np.isnan(impulse_for(1.0, moves("M3", dead).along(0.0)))
    np.testing.assert_array_equal(impulse_for([8.0, np.nan], [0.25, 0.25]), [8.0, np.nan])
