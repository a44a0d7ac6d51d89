"""The three traps of the degree-6 polynomial, and the one degenerate case."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest

from fastmech.outcome import Outcome
from fastmech.scene import Scene
from fastmech.slider.atlas.map import Coincidence, map_equilibria

PAPER = Scene(c2=1100 / 3, alpha=0.0)
WEIGHT = 9.80665


def test_no_force_gives_six_with_double_projections() -> None:
    one = map_equilibria(PAPER, {"F0": [0.0]})
    assert one.outcome[0] == Outcome.COMPLETE
    assert one.count[0] == 6
    assert one.coincidence[0] == Coincidence.DOUBLE_PROJECTION
    for phi in (0.5 * np.pi, -0.5 * np.pi):
        assert np.count_nonzero(np.abs(one.phi[0] - phi) < 1e-14) == 2


def test_c2_equal_to_m1_g_over_l() -> None:
    """a = b: pairs share phi for every force, without a fold."""
    scene = Scene(m1=10.0, m2=12.0, g=9.8125, l=1.0, c2=10 * 9.8125, alpha=0.0)
    forces = np.linspace(-300.0, 300.0, 61)
    line = map_equilibria(scene, {"F0": forces[forces != 0.0]})
    assert (line.outcome == Outcome.COMPLETE).all()
    assert np.isin(line.count, (4, 6)).all()
    assert (line.coincidence == Coincidence.DOUBLE_PROJECTION).any()


@pytest.mark.parametrize("force", [0.0, 90.0, -250.0])
def test_a_unit_root_that_is_no_equilibrium(force: float) -> None:
    """c1 l = sqrt(F0^2 + (m2 g)^2): z = (f - ib)/C is a double unit root of no equilibrium."""
    c1 = math.hypot(force, 12 * 10.0) / 1.25
    scene = PAPER.replace(g=10.0, F0=force)
    line = map_equilibria(scene, {"c1": [c1 * (1.0 - 1e-9), c1, c1 * (1.0 + 1e-9)]})
    assert (line.outcome == Outcome.COMPLETE).all()
    assert len(set(line.count)) == 1
    trap = math.atan2(-12 * 10.0, force)
    near = np.abs(np.angle(np.exp(1j * (line.phi[1] - trap)))) < 1e-6
    gradient_free = np.isfinite(line.radius[1]) & near
    assert np.count_nonzero(gradient_free) in (0, 1, 2)
    assert (line.radius[1][np.isfinite(line.phi[1])] < 1e-10).all()


#: Equilibria at Table 1 without the spring c2, from paper (17) with theta eliminated, by bisection in mpmath.
NO_C2 = (
    (-0.61233601, 1.5567908),
    (-0.54596372, 1.4064046),
    (2.0776361, 2.5494874),
    (-1.8229393, -2.0538151),
    (-0.94092814, -0.40004833),
    (1.8477708, -0.46112042),
)


def test_without_c2_there_are_six() -> None:
    """Six balance to 45 digits and differ, and no more exist: the polynomial keeps its degree six."""
    with mpmath.workdps(50):
        a, b = 22 * mpmath.mpf("9.80665") * 1.25, 12 * mpmath.mpf("9.80665") * 1.25
        C, f = mpmath.mpf("162.5") * mpmath.mpf("1.25") ** 2, mpmath.mpf(125)

        def gradient(phi: mpmath.mpf, theta: mpmath.mpf) -> list[mpmath.mpf]:
            pull = C * mpmath.cos(phi + theta)
            return [
                a * mpmath.cos(phi) + f * mpmath.sin(phi) - pull,
                b * mpmath.sin(theta) + f * mpmath.cos(theta) - pull,
            ]

        exact = [mpmath.findroot(gradient, start) for start in NO_C2]
        for place, start in zip(exact, NO_C2, strict=True):
            assert mpmath.norm(mpmath.matrix(gradient(*place))) < mpmath.mpf(10) ** -45
            assert mpmath.norm(place - mpmath.matrix(start)) < 1e-6
        leading = -C * mpmath.mpc(f, b) * mpmath.mpc(a, -f) ** 2
        assert abs(leading) > 1e6
        places = np.array([[float(x) for x in place] for place in exact])
    one = map_equilibria(Scene(c2=0.0, alpha=0.0), {"F0": [100.0]})
    assert (one.outcome[0], one.count[0]) == (Outcome.COMPLETE, 6)
    found = np.stack([one.phi[0], one.theta[0]], axis=-1)
    nearest = np.abs(found[:, None] - places).max(axis=-1)
    assert nearest.min(axis=0).max() < 1e-12
    assert sorted(nearest.argmin(axis=0)) == list(range(6))


def test_only_the_triple_case_is_degenerate() -> None:
    balanced = 22 * WEIGHT / 1.25
    for changes in ({"c1": 0.0}, {"c2": 0.0, "F0": 100.0, "c1": 0.0}, {"F0": 0.0, "c2": balanced}):
        one = map_equilibria(PAPER.replace(**changes), {"l": [1.25]})
        assert (one.outcome[0], one.count[0]) == (Outcome.COMPLETE, 4), changes
    triple = map_equilibria(PAPER.replace(F0=0.0, c1=0.0, c2=balanced), {"l": [1.25]})
    assert (triple.outcome[0], triple.count[0]) == (Outcome.DEGENERATE, 0)
