"""Levels about places of an orbit: against the distance from a circle, and from a point modulo a turn."""

from __future__ import annotations

import numpy as np
import pytest

from fastmech.capture.levels import levels

pytestmark = pytest.mark.nojit


def test_the_level_beside_a_circle_is_the_square_of_the_distance_from_it() -> None:
    m = 32
    phase = 2.0 * np.pi * np.arange(m) / m
    places = np.stack([np.cos(phase), np.sin(phase)], axis=1)
    slopes = np.stack([-np.sin(phase), np.cos(phase)], axis=1) * (2.0 * np.pi / m)
    forms = np.zeros((m, 3, 2))
    forms[:, 0] = places  # e along the radius
    forms[:, 2] = slopes / (2.0 * np.pi / m) ** 2
    rng = np.random.default_rng(0)
    radius, angle = rng.uniform(0.9, 1.1, 200), rng.uniform(0.0, 7.0, 200)
    states = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    found, level = np.empty(200, dtype=np.int64), np.empty(200)
    levels(states, places, forms, slopes, np.zeros(2), found, level)
    # The radius at a phase lies up to half a step from that of its place, cos 0.1 = 0.995; and a cubic of
    # Hermite's between places h apart is off by up to h^4/384 (Conte and de Boor, section 6.5).
    error = (2.0 * np.pi / m) ** 4 / 384.0
    np.testing.assert_allclose(np.sqrt(level), np.abs(radius - 1.0), rtol=0.02, atol=error)
    apart = np.abs((angle - phase[found] + np.pi) % (2.0 * np.pi) - np.pi)
    assert apart.max() < 0.8 * 2.0 * np.pi / m


def test_turns_of_an_angle_do_not_count() -> None:
    places, forms = np.array([[0.1, 2.0]]), np.zeros((1, 3, 2))
    forms[0, :2] = np.diag([10.0, 0.5])
    states = np.array([[0.1, 2.0], [0.1 + 40.0 * np.pi, 2.0], [0.2, 2.0], [0.1, 2.0 + 2.0 * np.pi]])
    found, level = np.empty(4, dtype=np.int64), np.empty(4)
    levels(states, places, forms, np.zeros((1, 2)), np.array([1.0, 0.0]), found, level)
    np.testing.assert_allclose(level, [0.0, 0.0, 1.0, np.pi**2], atol=1e-20, rtol=1e-12)
    assert (found == 0).all()
