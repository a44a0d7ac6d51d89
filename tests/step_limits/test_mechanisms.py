"""Step limits of mechanisms: the scene's, and what a run shows."""

from __future__ import annotations

import math

import numpy as np
import pytest

import fastmech as fm


@pytest.mark.parametrize("method", ["rk4", "dop853", "abm8"])
def test_the_papers_mechanism_has_the_scene_s_limits(method: str) -> None:
    scene = fm.Scene(alpha=0.0, beta=4000.0)
    mechanism = fm.mechanisms.slider_pendulum().replace(alpha=0.0, beta=4000.0)
    for place, own in zip(fm.find_equilibria(scene), fm.find_equilibria(mechanism), strict=True):
        expected = fm.largest_stable_step(scene, place, method)
        assert fm.largest_stable_step(mechanism, own, method) == pytest.approx(expected, rel=1e-9)


def test_an_undamped_swing_has_the_method_s_imaginary_limit() -> None:
    """rk4 is stable on the imaginary axis up to 2 sqrt 2 (Hairer, Wanner, section IV.2)."""
    pendulum = fm.mechanisms.pendulum_chain(1).replace(F=0.0)
    limit = 2.0 * math.sqrt(2.0) / math.sqrt(9.81)
    hanging = fm.find_equilibria(pendulum)[0]
    assert fm.largest_stable_step(pendulum, hanging, "rk4") == pytest.approx(limit, rel=1e-4)
    assert fm.step_warning(pendulum, 0.9 * limit, "rk4") is None
    told = fm.step_warning(pendulum, 1.2 * limit, "rk4")
    assert told is not None
    assert "undamped motions would grow" in told
    small = np.array([[1e-6, 0.0]])
    sizes = [
        np.abs(fm.integrate(pendulum, small, 400 * dt, dt=dt).y[-1]).max()
        for dt in (0.9 * limit, 1.2 * limit)
    ]
    assert sizes[0] < 1e-5
    assert not sizes[1] < 1.0
    told = fm.step_warning(pendulum, 0.1, "rk4", np.array([[0.0, 30.0]]))
    assert told is not None
    assert "it would turn 3 rad a step" in told
    with pytest.raises(fm.InputError, match="has shape"):
        fm.step_warning(pendulum, 0.1, "rk4", np.zeros((3, 4)))
    with pytest.raises(fm.InputError, match="must be one of"):
        fm.largest_stable_step(pendulum, fm.find_equilibria(fm.Scene())[0], "rk4")
