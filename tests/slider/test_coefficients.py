from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from slider.draws import draws

from fastmech.scene import Scene
from fastmech.slider.coefficients import Coefficients, force, reduce

pytestmark = pytest.mark.nojit


def test_reduced_coefficients_against_exact_fractions() -> None:
    """Each within 1e-14 of the sum of the magnitudes of its terms."""
    for d in draws():
        m1, m2, m3, l, c1, c2, beta, g, F0, alpha = (Fraction(value) for value in d.params.values())
        weight = (m1 + m2) * g / (m2 * l)
        exact = [m1 / m2, m3 / m2, weight - c2 / m2, c1 / m2, g / l, F0 / (m2 * l), beta / m2, alpha]
        scale = [m1 / m2, m3 / m2, weight + c2 / m2, *exact[3:]]
        for name, value, right, size in zip(Coefficients._fields, reduce(d.scene), exact, scale, strict=True):
            assert abs(Fraction(value) - right) <= Fraction(1e-14) * abs(size), name


def test_force_decays_exponentially() -> None:
    scene = Scene(F0=-80.0, alpha=np.log(2.0))
    np.testing.assert_allclose(
        force(scene, [0.0, 1.0, 2.0, 10.0]), [-80.0, -40.0, -20.0, -80 / 1024], rtol=1e-15
    )
    np.testing.assert_array_equal(force(scene.replace(alpha=0.0), [0.0, 7.0]), [-80.0, -80.0])
