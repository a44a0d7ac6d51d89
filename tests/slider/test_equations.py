"""The reduced equations: what holds between them whatever the numbers are."""

from __future__ import annotations

import numpy as np
import pytest
from slider.draws import acceleration_scale, draws

from fastmech.slider import lagrange, reduced
from fastmech.slider.coefficients import reduce

pytestmark = pytest.mark.nojit


def test_momenta_and_rates_are_each_other_s_inverse() -> None:
    """To 1e-12 of |a^-1| |a| |q'|."""
    for d in draws():
        c, s12, c12 = reduce(d.scene), np.sin(d.q.sum()), np.cos(d.q.sum())
        k, _ = reduced.slider_ratio(np.sin(d.q[0]), np.cos(d.q[0]))
        p = reduced.momenta_from_rates(*d.rates, c.mass, c.slider, k, s12)
        determinant = reduced.metric_determinant(c.mass, c.slider, k, c12)
        back = reduced.rates_from_momenta(*p, s12, determinant)
        a = lagrange.metric(d.scene, d.q)
        scale = np.abs(np.linalg.inv(a)) @ np.abs(a) @ np.abs(d.rates)
        assert np.all(np.abs(np.array(back) - d.rates) <= 1e-12 * scale)


def test_determinant_is_that_of_the_metric_and_positive() -> None:
    for d in draws():
        c = reduce(d.scene)
        k, _ = reduced.slider_ratio(np.sin(d.q[0]), np.cos(d.q[0]))
        determinant = reduced.metric_determinant(c.mass, c.slider, k, np.cos(d.q.sum()))
        a = lagrange.metric(d.scene, d.q) / lagrange.unit(d.scene)
        assert determinant == pytest.approx(np.linalg.det(a), abs=1e-12 * a[0, 0])
        assert determinant > 0


def test_a_term_that_is_none_equals_a_term_that_is_zero() -> None:
    trig = (0.6, 0.8, -0.28, 0.96)
    for right_hand_side in (reduced.lagrange_accelerations, reduced.canonical_rates):
        rest = (trig, (1.5, -2.5), (0.8, 0.6, -9.0, 13.0, 8.0))
        assert right_hand_side(*rest, None, None) == right_hand_side(*rest, 0.0, 0.0)
        assert right_hand_side(*rest, 7.0, None) == right_hand_side(*rest, 7.0, 0.0)
        assert right_hand_side(*rest, None, 7.0) == right_hand_side(*rest, 0.0, 7.0)


def test_energy_of_an_undamped_unforced_scene_does_not_change() -> None:
    """dT/dt + dPi/dt = 0 with the accelerations of (13), to 1e-12 of the terms; dT/dt by metric and (12)."""
    for d in draws():
        scene = d.scene.replace(beta=0.0, F0=0.0)
        acceleration = lagrange.angular_accelerations(scene, d.y, d.t)
        metric, gamma = lagrange.metric(scene, d.q), lagrange.christoffel(scene, d.q)
        gradient, v = lagrange.potential_gradient(scene, d.q), d.rates
        power = v @ metric @ acceleration + np.einsum("kij,k,i,j", gamma, v, v, v) + gradient @ v
        scale = np.abs(v) @ np.abs(metric) @ np.abs(acceleration) + np.abs(gradient) @ np.abs(v)
        # The accelerations themselves are only known to the scale of what they are solved from.
        scale += np.abs(v) @ np.abs(metric) @ acceleration_scale(d)
        assert abs(power) <= 1e-12 * scale
