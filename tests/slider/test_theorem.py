"""The normal form of the conditions of rest and its closed-form fold."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from oracles import oracle
from scipy import optimize

from fastmech.scene import Scene
from fastmech.slider.coefficients import reduce
from fastmech.slider.theorem import corner_cosine_squared, normal_form, pulls, wrap

PAPER = Scene(c2=1100 / 3, alpha=0.0)


@pytest.mark.nojit
@given(st.floats(-1e4, 1e4))
def test_wrap_keeps_the_direction(angle: float) -> None:
    wrapped = wrap(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-11)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-11)


@pytest.mark.nojit
@pytest.mark.parametrize(("angle", "wrapped"), [(-math.pi, math.pi), (math.pi, math.pi), (0.0, 0.0)])
def test_wrap_at_the_seam(angle: float, wrapped: float) -> None:
    assert wrap(angle) == wrapped


@pytest.mark.nojit
def test_three_sinusoids_are_the_gradient() -> None:
    c = reduce(PAPER)
    p = pulls(c.mass, c.lift, c.spring, c.gravity, c.force)
    scale = c.spring / p.spring * PAPER.m2 * PAPER.l**2
    phi, theta = 0.4, -1.1
    one = p.amplitude_phi * math.cos(phi - p.phase_phi)
    two = p.amplitude_theta * math.cos(theta - p.phase_theta)
    three = p.amplitude_psi * math.cos(phi + theta)
    gradient = [float(x) for x in oracle().gradient(PAPER.parameters, (phi, theta), F=100.0)]
    np.testing.assert_allclose([scale * (one - three), scale * (two - three)], gradient, rtol=1e-13)


@pytest.mark.nojit
@given(st.floats(0.01, 1.0), st.floats(0.01, 1.0))
def test_corner_against_a_root_finder(r2: float, r3: float) -> None:
    assume(r2 + r3 > 1.0 + 1e-6)

    def slope(d: float) -> float:
        return 1.0 - sum(r * math.cos(d) / math.sqrt(1.0 - (r * math.sin(d)) ** 2) for r in (r2, r3))

    assume(max(r2, r3) < 1.0 - 1e-9)
    corner = optimize.brentq(slope, 0.0, math.pi / 2, xtol=1e-15)
    squared = corner_cosine_squared(1.0 - r2 * r2, 1.0 - r3 * r3, r2, r3)
    assert squared == pytest.approx(math.cos(corner) ** 2, rel=1e-6, abs=1e-12)


@pytest.mark.nojit
def test_fold_force_of_table_1_against_a_singular_hessian() -> None:
    """The margin vanishes where gradient and Hessian determinant vanish together, found by SciPy."""
    params = PAPER.parameters

    def singular(x: np.ndarray) -> list[float]:
        phi, theta, force = x
        g = [float(v) for v in oracle().gradient(params, (phi, theta), F=force)]
        h = np.array(oracle().hessian(params, (phi, theta), F=force), dtype=float)
        return [*g, float(np.linalg.det(h)) / 100.0]

    force = optimize.fsolve(singular, [-1.38, -0.42, 1.4], xtol=1e-13)[2]
    c = reduce(PAPER.replace(F0=float(force)))
    n = normal_form(pulls(c.mass, c.lift, c.spring, c.gravity, c.force))
    assert force == pytest.approx(1.3992, abs=1e-3)
    assert n.peak - n.distance == pytest.approx(0.0, abs=1e-10)
