"""The three traps of the degree-6 polynomial, and the one degenerate case."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fastmech.atlas.coincidence import Coincidence
from fastmech.atlas.map import map_equilibria
from fastmech.equilibria.outcome import Outcome
from fastmech.scene import Scene

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


def test_only_the_triple_case_is_degenerate() -> None:
    balanced = 22 * WEIGHT / 1.25
    for changes in ({"c1": 0.0}, {"c2": 0.0, "F0": 100.0, "c1": 0.0}, {"F0": 0.0, "c2": balanced}):
        one = map_equilibria(PAPER.replace(**changes), {"l": [1.25]})
        assert (one.outcome[0], one.count[0]) == (Outcome.COMPLETE, 4), changes
    assert map_equilibria(PAPER.replace(c2=0.0), {"l": [1.25]}).outcome[0] == Outcome.COMPLETE
    triple = map_equilibria(PAPER.replace(F0=0.0, c1=0.0, c2=balanced), {"l": [1.25]})
    assert (triple.outcome[0], triple.count[0]) == (Outcome.DEGENERATE, 0)
