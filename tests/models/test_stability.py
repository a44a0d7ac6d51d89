"""Verdicts against closed forms: Ziegler's column, pendulums, gyroscopes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import sympy
from scipy.optimize import minimize

import fastmech as fm
from fastmech.models.mechanism import Linear
from fastmech.models.stability import assess

CRITICAL_LOAD = 3.5 - math.sqrt(2.0)


def ziegler(load: float, b: float = 0.0, k: float = 1.0) -> Linear:
    """Masses 2 m at the joint and m at the tip, m = l = 1; torsion springs k and dashpots b (Ziegler)."""
    mass = np.array([[3.0, 1.0], [1.0, 1.0]])
    stiffness = np.array([[2.0 * k - load, load - k], [-k, k]])
    return Linear(mass, b * np.array([[2.0, -1.0], [-1.0, 1.0]]), stiffness)


@pytest.mark.parametrize(("part", "verdict"), [(1 - 1e-9, "critical"), (1 + 1e-9, "unstable")])
def test_ziegler_s_undamped_column_flutters_where_two_frequencies_meet(part: float, verdict: str) -> None:
    found = assess(ziegler(CRITICAL_LOAD * part), None)
    assert found.verdict == verdict
    assert found.instability == ("flutter" if verdict == "unstable" else None)
    assert found.potential is None


@pytest.mark.parametrize("b", [0.01, 0.1, 0.5])
def test_damping_destabilizes_ziegler_s_column(b: float) -> None:
    hopf = 41.0 / 28.0 + b * b / 2.0
    below, above = (assess(ziegler(hopf * part, b), None) for part in (1 - 1e-9, 1 + 1e-9))
    assert (below.verdict, below.instability) == ("asymptotically stable", None)
    assert (above.verdict, above.instability) == ("unstable", "flutter")
    assert below.hurwitz.verdict == "asymptotically stable"
    assert above.hurwitz.verdict == "unstable"
    assert assess(ziegler(hopf, b), None).verdict == "critical"


def test_a_load_beyond_buckling_makes_a_column_diverge() -> None:
    """A dead load has the stiffness (2 k - P l, -k; -k, k - P l): it buckles at (3 - sqrt 5) / 2."""
    for part, word in ((0.999, "stable"), (1.001, "unstable")):
        load = 0.5 * (3.0 - math.sqrt(5.0)) * part
        linear = Linear(
            np.array([[3.0, 1.0], [1.0, 1.0]]), np.zeros((2, 2)), np.array([[2 - load, -1], [-1, 1 - load]])
        )
        found = assess(linear, 0 if part < 1 else 1)
        assert found.verdict == word
        assert found.instability == ("divergence" if part > 1 else None)
        assert assess(linear, None).instability == found.instability


def test_spectrum_and_polynomial_are_those_of_the_equations() -> None:
    rng = np.random.default_rng(3)
    for n in (1, 2, 3, 4):
        root = rng.normal(size=(n, n))
        linear = Linear(root @ root.T + np.eye(n), rng.normal(size=(n, n)), 10.0 * rng.normal(size=(n, n)))
        found = assess(linear, None)
        for value in found.eigenvalues:
            pencil = linear.mass * value**2 + linear.damping * value + linear.stiffness
            size = np.linalg.norm(linear.stiffness) + np.linalg.norm(linear.mass) * abs(value) ** 2
            assert np.linalg.svd(pencil, compute_uv=False)[-1] < 1e-10 * size
        np.testing.assert_allclose(found.polynomial, np.poly(found.eigenvalues).real, rtol=1e-8, atol=1e-8)
        assert found.spectrum.verdict == found.hurwitz.verdict
        p = found.polynomial
        assert found.hurwitz_determinants[0] == pytest.approx(p[1], rel=1e-9)
        if n > 1:
            assert found.hurwitz_determinants[1] == pytest.approx(p[1] * p[2] - p[3], rel=1e-8)


def test_what_the_potential_decides() -> None:
    one, none = np.eye(2), np.zeros((2, 2))
    minimum, saddle = np.diag([2.0, 5.0]), np.diag([2.0, -5.0])
    assert assess(Linear(one, none, minimum), 0).verdict == "stable"
    assert assess(Linear(one, 0.1 * one, minimum), 0).verdict == "asymptotically stable"
    missed = assess(Linear(one, np.diag([0.1, 0.0]), minimum), 0)
    assert missed.verdict == "stable"
    assert "misses a mode" in missed.explanation
    for damping in (none, one, 100.0 * one):
        found = assess(Linear(one, damping, saddle), 1)
        assert (found.verdict, found.instability) == ("unstable", "divergence")
    assert assess(Linear(one, none, np.diag([2.0, 0.0])), -2).verdict == "critical"
    fed = assess(Linear(one, -0.1 * one, minimum), 0)
    assert (fed.verdict, fed.instability) == ("unstable", "flutter")


@pytest.mark.parametrize(
    "well",
    [
        lambda x, y: 1.3 * x * sympy.atan(0.7 * x + 0.3 * y),
        lambda x, y: 1.1 * sympy.log(1 + sympy.exp(3.3 * x - 1.7 * y - 0.4)),
        lambda x, y: 1.7 * (0.3 * x + 0.7 * y) * sympy.asin((0.3 * x - 0.2 * y + 0.1) / 3.1),
        lambda x, y: 1.7 * (0.3 * x + 0.7 * y) * sympy.atan2(0.3 * x - 0.2 * y + 0.1, 3.1 + 0.2 * x),
        lambda x, y: 25 * sympy.Max(0, x - 0.3, y - 0.4) ** 2 - 2 * x,
    ],
    ids=["atan", "softplus", "asin", "atan2", "stops"],
)
def test_what_a_potential_gives_has_one(well: Any) -> None:
    """Also where SymPy does not see that its mixed derivatives are the same, and with gyroscopic forces."""
    x, y = fm.lengths("x", -2.0, 2.0), fm.lengths("y", -2.0, 2.0)
    potential = 0.3 * (x**2 + y**2) + well(x, y)
    mechanism = fm.Mechanism(
        (x, y), kinetic=(x.dot**2 + y.dot**2) / 2, potential=potential,
        dissipation=(x.dot**2 + y.dot**2) / 4,
        generalized_forces={"x": 0.2 * y.dot, "y": -0.2 * x.dot},
    )  # fmt: skip
    least = minimize(lambda q: float(potential.subs({x: q[0], y: q[1]})), [0.0, 0.0], tol=1e-12)
    (found,) = fm.find_equilibria(mechanism)
    np.testing.assert_allclose(found.position, least.x, atol=1e-6)
    assert found.kind == "minimum"
    assert fm.classify(mechanism, found).verdict == "asymptotically stable"
    labels = fm.label_starts(mechanism, np.concatenate([least.x + 0.1, [0.0, 0.0]]))
    assert labels.well == 0


def test_what_no_potential_gives_is_asked_of_alone() -> None:
    """A force with a potential of its own beside one, and one without, however little of it."""
    x, y = fm.lengths("x", -2.0, 2.0), fm.lengths("y", -2.0, 2.0)
    for force, known in (({"x": y, "y": x}, True), ({"x": 1e-9 * y}, False)):
        mechanism = fm.Mechanism(
            (x, y), kinetic=x.dot**2 + y.dot**2, potential=x**2 + y**2 + x * sympy.atan(0.7 * x + 0.3 * y),
            generalized_forces=force,
        )  # fmt: skip
        assert mechanism.statics().conservative == known


def test_gyroscopic_forces_may_hold_a_maximum_but_not_with_damping() -> None:
    """Kelvin, Tait, Chetaev: q'' + (g J + d) q' - q = 0 is bounded for g > 2 and d = 0 alone."""
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    for gyro, damping, word in ((2.1, 0.0, "critical"), (1.9, 0.0, "unstable"), (2.1, 0.01, "unstable")):
        linear = Linear(np.eye(2), gyro * turn + damping * np.eye(2), -np.eye(2))
        assert assess(linear, 2).verdict == word


def test_decay_time_is_that_of_the_slowest_mode() -> None:
    """m q'' + b q' + k q = 0 below critical damping falls to 1/e in 2 m / b."""
    linear = Linear(2.0 * np.eye(2), np.diag([3.0, 0.5]), np.diag([100.0, 50.0]))
    assert assess(linear, 0).decay_time == pytest.approx(8.0, rel=1e-12)
    assert "decay time 8 s\n" in repr(assess(linear, 0))
    slow = assess(linear._replace(damping=np.diag([3.0, 0.5e-3])), 0)
    assert "decay time 8000 s (2.22 h: it hardly comes to rest)" in repr(slow)
    assert assess(linear, None).decay_time == pytest.approx(8.0, rel=1e-12)
    assert assess(linear._replace(damping=np.zeros((2, 2))), 0).decay_time == math.inf
    falling = assess(linear._replace(stiffness=np.diag([100.0, -50.0])), 1)
    assert math.isnan(falling.decay_time)
    assert "decay time" not in repr(falling)


@pytest.mark.parametrize("power", [1, 3])
def test_damping_that_is_not_linear_has_no_decay_time(power: int) -> None:
    """Coulomb friction and drag take energy, but eigenvalues stay imaginary."""
    x = fm.lengths("x", -1.0, 1.0)
    still: dict[str, Any] = {"kinetic": x.dot**2 / 2, "potential": x**2 / 2}
    rubbed = fm.Mechanism(x, dissipation=sympy.Abs(x.dot) ** power, **still)
    places = fm.find_equilibria(rubbed)
    told = places.certificate.sentence.startswith("without its dry friction, which holds it at other places")
    assert told == (power == 1)
    found = fm.classify(rubbed, places[0])
    assert rubbed.powers(0.0, [0.5, 0.3]).lost > 0.0
    assert (found.verdict, math.isnan(found.decay_time)) == ("stable", True)
    assert "no linear damping: disturbances lose energy, but do not decay exponentially" in found.explanation
    free = fm.Mechanism(x, **still)
    free_found = fm.classify(free, fm.find_equilibria(free)[0])
    assert free_found.decay_time == math.inf
    assert "nothing damps: disturbances stay small but do not die out" in free_found.explanation
