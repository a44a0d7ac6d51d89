from __future__ import annotations

import numpy as np
import pytest

from fastmech.scene import Scene
from fastmech.slider.geometry import reactions

pytestmark = pytest.mark.nojit


def test_hanging_at_rest() -> None:
    """phi = -pi/2, theta = 0, no force: both rods carry what hangs on them less the springs' pull.

    M2 = (0, -2 l) is pulled up by 2 c1 l, M1 = (0, -l) by 2 c2 l; the slider carries its own weight.
    """
    scene = Scene(m1=3.0, m2=2.0, m3=5.0, l=0.5, c1=4.0, c2=6.0, beta=7.0, g=10.0, F0=0.0)
    r = reactions(scene, [-np.pi / 2, 0.0, 0.0, 0.0], 0.0)
    assert r.rod_m1m2 == pytest.approx(2 * 10 - 2 * 4 * 0.5)
    assert r.rod_om1 == pytest.approx((3 + 2) * 10 - 2 * 4 * 0.5 - 2 * 6 * 0.5)
    assert r.rod_m1m3 == pytest.approx(0.0, abs=1e-13)
    assert r.slider_normal == pytest.approx(50.0)


def test_whirling_without_weight_or_springs() -> None:
    """theta' alone turns M2 about M1 at rest: with m1 huge the rod carries m2 l theta'^2."""
    scene = Scene(m1=1e12, m2=2.0, m3=0.0, l=0.5, c1=0.0, c2=0.0, beta=0.0, g=0.0, F0=0.0)
    r = reactions(scene, [0.3, 0.7, 0.0, 4.0], 0.0)
    assert r.rod_m1m2 == pytest.approx(2.0 * 0.5 * 16.0, rel=1e-10)
    assert r.slider_normal == pytest.approx(0.0, abs=1e-10)


def test_shapes_follow_the_states() -> None:
    y = np.random.default_rng(5).uniform(-2, 2, (3, 6, 4))
    t = np.linspace(0, 1, 3)[:, None]
    many = reactions(Scene(), y, t)
    one = reactions(Scene(), y[1, 4], t[1, 0])
    for component, single in zip(many, one, strict=True):
        assert component.shape == (3, 6)
        assert component[1, 4] == pytest.approx(single, rel=1e-12)
