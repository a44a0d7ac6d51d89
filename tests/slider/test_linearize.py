"""Linearized motion against the oracle's differentiated equations."""

from __future__ import annotations

import numpy as np
import pytest
from oracles import oracle

from fastmech.scene import Scene
from fastmech.slider.equilibria import find_equilibria
from fastmech.slider.linearize import jacobian, linearized, polynomial

SCENES = [
    Scene(c2=1100 / 3, alpha=0.0),
    Scene(c2=1100 / 3, alpha=0.0, F0=0.0, beta=0.0),
    Scene(m1=0.3, m2=40.0, m3=2.0, l=0.7, c1=900.0, c2=3.0, F0=-70.0, alpha=0.0),
]


@pytest.mark.parametrize("scene", SCENES)
def test_jacobian_and_polynomial_against_the_oracle(scene: Scene) -> None:
    params = scene.parameters
    for e in find_equilibria(scene):
        J = np.array(oracle().jacobian(params, (e.phi, e.theta, 0.0, 0.0), t=0.0), dtype=float)
        np.testing.assert_allclose(jacobian(scene, e), J, rtol=1e-10, atol=1e-12 * np.abs(J).max())
        expected = np.array(
            oracle().characteristic_polynomial(params, (e.phi, e.theta), F=e.force), dtype=float
        )
        got = [1.0, *polynomial(linearized(scene, e)[1])]
        scale = np.abs(np.linalg.eigvals(J)).max() ** np.arange(5)
        np.testing.assert_allclose(got, expected, atol=1e-12 * scale.max(), rtol=1e-10)


def test_frozen_force_is_the_equilibriums() -> None:
    decaying, constant = Scene(c2=1100 / 3), Scene(c2=1100 / 3, alpha=0.0)
    a, b = find_equilibria(decaying, at=0.0)[0], find_equilibria(constant)[0]
    np.testing.assert_array_equal(jacobian(decaying, a), jacobian(constant, b))
