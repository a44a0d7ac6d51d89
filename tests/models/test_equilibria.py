"""All equilibria of mechanisms against closed forms, the paper's theory, and searches from many starts."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import scipy.optimize
import sympy as sp
from devices import (
    angle,
    cart_pendulum,
    chain,
    of_potential,
    phi,
    ranged,
    slider_pendulum,
    theta,
    truss,
    x,
    y,
    ziegler_column,
)
from proofs import newton, unlisted

import fastmech as fm
from fastmech.errors import InputError
from fastmech.models.equilibria import prove_equilibria, search_rows
from fastmech.models.mechanism import Linear
from fastmech.models.stability import assess
from fastmech.models.statics import Coordinate, Statics
from fastmech.outcome import Outcome


def missing(statics: Statics, values: Any, starts: int, seed: int = 0) -> list[Any]:
    """Zeros that Newton's method finds and the proof neither lists nor leaves open."""
    return unlisted(statics, values, prove_equilibria(statics, values), newton(statics, values, starts, seed))


def slider_metric_and_damping(scene: fm.Scene, phi: float, theta: float) -> tuple[Any, Any]:
    """The masses of three points, and a damper on the third, which slides."""
    slide = math.sin(phi) * (1 + math.cos(phi) / math.sqrt(4 - math.sin(phi) ** 2))
    a12 = scene.m2 * math.sin(phi + theta)
    metric = np.array([[scene.m1 + scene.m2 + scene.m3 * slide**2, a12], [a12, scene.m2]])
    return scene.l**2 * metric, scene.l**2 * np.diag([scene.beta * slide**2, 0.0])


def test_the_paper_s_mechanism_has_the_equilibria_of_its_theory() -> None:
    """Two hundred random scenes: positions, Morse indices, Hessians and verdicts."""
    statics = slider_pendulum()
    rng = np.random.default_rng(18)
    counts = set()
    for _ in range(200):
        scene = fm.Scene(
            m1=rng.uniform(1, 20), m2=rng.uniform(1, 20), l=rng.uniform(0.5, 2), c1=rng.uniform(0, 500),
            c2=rng.uniform(0, 500), F0=rng.choice([0.0, 1.0]) * rng.uniform(-200, 200), alpha=0.0,
        )  # fmt: skip
        known = fm.find_equilibria(scene)
        found = prove_equilibria(
            statics, [getattr(scene, name) for name in ("m1", "m2", "g", "l", "c1", "c2", "F0")]
        )
        assert found.certificate.complete
        assert known.certificate.complete
        assert len(found) == len(known)
        assert found.certificate.index_sum == found.certificate.expected_sum == 0
        counts.add(len(found))
        for item in known:
            (mine,) = [
                other
                for other in found
                if np.abs(np.angle(np.exp(1j * (other.position - [item.phi, item.theta])))).max() < 1e-9
            ]
            assert mine.morse_index == item.morse_index
            assert mine.kind == item.kind
            linear = Linear(*slider_metric_and_damping(scene, item.phi, item.theta), mine.stiffness)
            assert assess(linear, mine.morse_index).verdict == fm.classify(scene, item).verdict
            np.testing.assert_allclose(mine.stiffness, item.hessian, atol=1e-8 * np.abs(item.hessian).max())
    assert counts == {4, 6}


@pytest.mark.parametrize(("n", "indices"), [(2, [1, 3, 2]), (3, [1, 4, 5, 2]), (4, [1, 5, 10, 8, 2])])
def test_chains_of_pendulums(n: int, indices: list[int]) -> None:
    """Twelve and 26 equilibria, two of the latter beside a fold; counted by Newton from 200,000 starts."""
    found = prove_equilibria(chain(n))
    assert found.certificate.complete
    assert np.bincount([item.morse_index for item in found]).tolist() == indices
    if n == 4:
        assert min(np.abs(np.linalg.eigvalsh(item.stiffness)).min() for item in found) == pytest.approx(
            1.1e-3, rel=0.05
        )


def test_pendulums_that_do_not_know_each_other() -> None:
    """Zeros at 0, where rounding knows no bound, beside ones at pi, where it does."""
    m, g, k = sp.symbols("m g k", real=True)
    U = -2 * m * g * sp.cos(phi) - m * g * sp.cos(theta) - k * sp.cos(phi - theta)
    found = prove_equilibria(of_potential([angle(phi), angle(theta)], (m, g, k), U), [1.0, 9.81, 0.0])
    assert found.certificate.complete
    assert found.certificate.boxes < 200
    assert found.kind == ("minimum", "saddle", "saddle", "maximum")
    np.testing.assert_allclose(
        np.cos(found.position), [[1, 1], [1, -1], [-1, 1], [-1, -1]], rtol=0, atol=1e-15
    )


def test_von_mises_truss() -> None:
    """On the symmetric path it snaps at P = 2 k L0 (1 - cos^(2/3) a)^(3/2)."""
    k, a = 100.0, 0.5
    L0 = 1.0 / math.cos(a)
    snap = 2.0 * k * L0 * (1.0 - math.cos(a) ** (2.0 / 3.0)) ** 1.5
    below, above = (prove_equilibria(truss(), [k, L0, snap * part]) for part in (1 - 1e-9, 1 + 1e-9))
    assert below.certificate.complete
    assert above.certificate.complete
    assert (len(below), len(above)) == (3, 1)
    assert below.certificate.index_sum == above.certificate.index_sum == below.certificate.expected_sum == 1
    at = prove_equilibria(truss(), [k, L0, snap])
    assert at.certificate.outcome in (Outcome.AT_FOLD, Outcome.COMPLETE)
    assert len(at) in (1, 3)
    unloaded = prove_equilibria(truss(), [k, L0, 0.0])
    np.testing.assert_allclose(sorted(unloaded.position[:, 1]), [-math.tan(a), 0.0, math.tan(a)], atol=1e-12)


def test_where_a_bar_has_no_length_it_is_said_that_forces_are_not_defined() -> None:
    found = prove_equilibria(truss(2.0), [100.0, 1.2, 5.0])
    assert found.certificate.outcome is Outcome.UNPROVED
    for place in found.certificate.places:
        assert place.reason == "forces or stiffness may not be defined everywhere here"
        np.testing.assert_allclose(np.abs(0.5 * (place.low + place.high)), [1.0, 0.0], atol=1e-7)
    assert not missing(truss(2.0), [100.0, 1.2, 5.0], 5000)


def test_a_spring_of_length_zero_along_a_line_hides_no_equilibria_elsewhere() -> None:
    """A desk lamp whose second spring is as far from the elbow at both ends; SciPy finds the smooth ones."""
    k1, k2, f1, f2, s1, h, e, A, B = sp.symbols("k1 k2 f1 f2 s1 h e A B", real=True)
    first = sp.sqrt(s1**2 + h**2 - 2 * s1 * h * sp.sin(phi))
    across = 2 * e**2 * (sp.sin(phi) * sp.cos(theta) - sp.cos(phi) * sp.sin(theta))
    second = sp.sqrt(e**2 + e**2 + across)
    U = k1 * (first - f1) ** 2 / 2 + k2 * (second - f2) ** 2 / 2 + A * sp.sin(phi) + B * sp.sin(theta)
    values = (300.0, 250.0, 0.05, 0.04, 0.12, 0.15, 0.1, 3.9239, 2.489)
    statics = of_potential([angle(phi), angle(theta)], (k1, k2, f1, f2, s1, h, e, A, B), U)
    slopes = sp.lambdify([(phi, theta), *statics.parameters], [U.diff(phi), U.diff(theta)])
    known: set[tuple[float, float]] = set()
    for start in np.random.default_rng(0).uniform(-np.pi, np.pi, (400, 2)):
        with np.errstate(all="ignore"):
            root, _, done, _ = scipy.optimize.fsolve(slopes, start, args=values, full_output=True)
        if done == 1 and np.abs(slopes(root, *values)).max() < 1e-8:
            at = np.angle(np.exp(1j * root))
            known.add((round(float(at[0]), 5) + 0.0, round(float(at[1]), 5) + 0.0))
    found = prove_equilibria(statics, values)
    assert {tuple(place + 0.0) for place in found.position.round(5)} == known
    assert len(known) == 6
    assert len(found.certificate.places) < 40
    for place in found.certificate.places:
        assert place.reason == "forces or stiffness may not be defined everywhere here, along a line"
        assert (place.high - place.low < 0.15 * 2.0 * np.pi).all()
        ends = np.array([place.low[1] - place.high[0], place.high[1] - place.low[0]])
        beyond = ends + np.array([-0.02, 0.02]) - np.pi / 2
        assert np.floor(beyond[0] / (2.0 * np.pi)) < np.floor(beyond[1] / (2.0 * np.pi))  # beside the line
    assert "everywhere here, along a line" in str(found.certificate)


def test_what_the_limit_leaves_open_is_searched_for_equilibria_all_the_same() -> None:
    """Two masses in a row of three springs: SciPy's roots are proved, and nothing that is none."""
    q = fm.lengths("x1 y1 x2 y2", -1.2, 2.2)
    at = {"A": (0, 0), "B": (1, 0), "M": q[:2], "N": q[2:]}
    springs = [("A", "M", 50.0, 0.8), ("M", "N", 40.0, 0.7), ("N", "B", 60.0, 0.6)]
    row = fm.Mechanism(
        q,
        points=at,
        masses={"M": 1.0, "N": 1.5},
        springs=[fm.Spring(*each) for each in springs],
        gravity=9.81,
    )
    U = 9.81 * (q[1] + 1.5 * q[3])
    for start, end, k, free in springs:
        long = sp.sqrt(sum((sp.sympify(a) - b) ** 2 for a, b in zip(at[start], at[end], strict=True)))
        U += k * (long - free) ** 2 / 2
    slopes, hessian = (
        sp.lambdify([q], each, cse=True) for each in ([U.diff(a) for a in q], sp.hessian(U, q))
    )
    known: set[tuple[float, ...]] = set()
    for place in np.random.default_rng(0).uniform(-1.2, 2.2, (700, 4)):
        root = scipy.optimize.root(slopes, place, jac=hessian)
        if root.success and np.abs(slopes(root.x)).max() < 1e-9 and (np.abs(root.x - 0.5) <= 1.7).all():
            known.add(tuple(root.x.round(6)))
    found = prove_equilibria(row.statics(), limit=100_000)
    assert not found.certificate.complete
    assert found.certificate.places
    assert len(known) == 8
    assert {tuple(item.position.round(6)) for item in found} == known
    for item in found:
        assert item.radius < 1e-12
        assert item.morse_index == (np.linalg.eigvalsh(hessian(item.position)) < 0.0).sum()


def test_only_a_spring_of_length_zero_is_said_to_have_it() -> None:
    """A bead on a line through a spring's foot, or beside it; there its charge has no force at x = 1."""
    across, q = sp.Symbol("across"), fm.lengths("x", -2.0, 2.5)
    bead = fm.Mechanism(
        q, {"across": 0.0}, kinetic=q.dot**2 / 2, potential=0.01 / sp.Abs(q - 1) + q**2 / 9,
        points={"B": (q, across), "F": (0.3, 0)}, springs=[fm.Spring("F", "B", 5.0, 0.7)],
    )  # fmt: skip
    for beside, told in ((0.0, {0.3: ": a spring has length zero", 1.0: ""}), (0.2, {1.0: ""})):
        places = fm.find_equilibria(bead.replace(across=beside)).certificate.places
        reasons = {round(0.5 * float(p.low[0] + p.high[0]), 3): p.reason for p in places}
        assert reasons == {
            x: f"forces or stiffness may not be defined everywhere here{why}" for x, why in told.items()
        }


def test_inverted_pendulum_on_a_cart() -> None:
    """Springs k and w in series hold it upright where k w / (k + w) > g."""
    k, g = 50.0, 9.81
    critical = g * k / (k - g)
    for part, count in ((1 - 1e-9, 2), (1 - 1e-12, 2), (1 + 1e-12, 4), (1 + 1e-9, 4), (2.0, 4)):
        found = prove_equilibria(cart_pendulum(), [k, critical * part, g])
        assert found.certificate.complete
        assert len(found) == count
        assert found.certificate.index_sum == found.certificate.expected_sum == 0
        upright = min(found, key=lambda item: float(np.abs(item.position).max()))
        assert upright.kind == ("minimum" if part > 1 else "saddle")
    at = prove_equilibria(cart_pendulum(), [k, critical, g]).certificate
    assert at.outcome is Outcome.AT_FOLD
    assert "merge" in at.sentence


@pytest.mark.parametrize("shift", [0.0, 0.3])
def test_where_stiffness_vanishes_equilibria_merge(shift: float) -> None:
    """2 cos q + cos(2 q) / 2 is of fourth order at pi: forces are defined there."""
    U = 2 * sp.cos(theta - shift) + sp.cos(2 * (theta - shift)) / 2
    found = prove_equilibria(of_potential([angle(theta)], (), U)).certificate
    assert found.outcome is Outcome.AT_FOLD
    assert "merge" in found.sentence
    assert "defined" not in found.sentence


def test_the_column_under_a_following_force_stays_straight() -> None:
    """No other equilibrium: k (theta - phi) = 0 leaves only the straight column, which flutters."""
    found = prove_equilibria(ziegler_column(), [1.0, 2.2])
    assert found.certificate.complete
    assert len(found) == 1
    assert found[0].morse_index is None
    assert found[0].orientation == 1
    np.testing.assert_allclose(found[0].stiffness, [[2.0 - 2.2, 2.2 - 1.0], [-1.0, 1.0]], atol=1e-12)
    mass = np.array([[3.0, 1.0], [1.0, 1.0]])
    stability = assess(Linear(mass, np.zeros((2, 2)), found[0].stiffness), None)
    assert stability.instability == "flutter"


def test_a_curve_of_equilibria_ends_and_says_so() -> None:
    found = prove_equilibria(slider_pendulum(), [10.0, 12.0, 10.0, 1.0, 0.0, 220.0, 0.0])
    assert found.certificate.outcome is Outcome.DEGENERATE
    assert "curve" in found.certificate.sentence
    assert not found.certificate.complete


def test_the_end_of_a_range_and_the_limit_are_told() -> None:
    spring = of_potential([ranged(x, 0.0, 1.0)], (), (x - 1) ** 2)
    found = prove_equilibria(spring)
    assert "end of a range" in found.certificate.sentence
    inside = prove_equilibria(of_potential([ranged(x, 0.0, 1.0)], (), (x - sp.Rational(1, 3)) ** 2))
    assert inside.position.tolist() == [[pytest.approx(1 / 3, abs=1e-15)]]
    assert inside.certificate.index_sum == inside.certificate.expected_sum == 1
    outside = prove_equilibria(of_potential([ranged(x, 0.0, 1.0)], (), (x - 2) ** 2))
    assert (len(outside), outside.certificate.expected_sum) == (0, 0)
    few = prove_equilibria(chain(3), limit=100)
    assert few.certificate.outcome is Outcome.UNPROVED
    assert "limit" in few.certificate.sentence


def test_indices_sum_to_the_turns_of_the_force_along_the_ends() -> None:
    """By hand: saddles where no force keeps its sign on an end, a ring, a zero on the boundary."""
    saddle = of_potential([ranged(x, -1.0, 1.0), ranged(y, -1.0, 1.0)], (), x * y + x**3 / 9)
    certificate = prove_equilibria(saddle).certificate
    assert (certificate.expected_sum, certificate.index_sum) == (-1, -1)
    monkey = of_potential([ranged(x, -1.0, 1.0), ranged(y, -1.1, 0.9)], (), x**3 - 3 * x * y**2 + x / 9)
    certificate = prove_equilibria(monkey).certificate
    assert (certificate.expected_sum, certificate.index_sum) == (-2, -2)
    ring = of_potential([angle(phi), ranged(x, 0.5, 2.0)], (), (x - 1) ** 2 * 5 + x * sp.cos(phi))
    certificate = prove_equilibria(ring).certificate
    assert (certificate.expected_sum, certificate.index_sum) == (0, 0)
    on_end = of_potential([ranged(x, -1.0, 1.0), ranged(y, -1.0, 1.0)], (), (x - 1) ** 2 + y**2)
    assert prove_equilibria(on_end).certificate.expected_sum is None


def random_mechanism(rng: np.random.Generator) -> tuple[Statics, list[float]]:
    """Angles, lengths or both; harmonics, springs with ratios to 1e6, couplings."""
    n = int(rng.integers(1, 4))
    symbols = sp.symbols(f"u:{n}", real=True)
    stiffness = 10.0 ** rng.uniform(-3, 3, 40)
    take = iter(stiffness.tolist())
    coordinates: list[Coordinate] = []
    U: Any = 0
    for s in symbols:
        if rng.random() < 0.6:
            coordinates.append(angle(s))
            U += sum(
                next(take) * rng.normal() * sp.cos(k * s - rng.uniform(0, 6))
                for k in (1, int(rng.integers(1, 3)))
            )
        else:
            coordinates.append(ranged(s, -2.0, 2.0))
            U += next(take) * (s - rng.normal()) ** 2 / 2 - next(take) * sp.cos(rng.uniform(1, 4) * s)
            if rng.random() < 0.3:  # a spring from a point beside the path, of free length 0 or 1
                U += (
                    next(take)
                    * (sp.sqrt((s - rng.normal()) ** 2 + rng.uniform(0.01, 1)) - rng.integers(0, 2)) ** 2
                )
    for a, b in pairwise(coordinates):
        if a.periodic and b.periodic:
            U += next(take) * sp.cos(a.symbol - b.symbol)
        else:
            left, right = (sp.sin(c.symbol) if c.periodic else c.symbol for c in (a, b))
            U += next(take) * (left + right) ** 2 / 2
    return of_potential(coordinates, (), U), []


def test_nothing_is_found_beside_the_list_in_random_mechanisms() -> None:
    rng = np.random.default_rng(7)
    outcomes = []
    for seed in range(12):
        statics, values = random_mechanism(rng)
        assert missing(statics, values, 1000, seed) == []
        certificate = prove_equilibria(statics, values).certificate
        outcomes.append(certificate.outcome)
        if certificate.complete and certificate.expected_sum is not None:
            assert certificate.index_sum == certificate.expected_sum
    assert outcomes.count(Outcome.COMPLETE) >= 10


def test_rows_do_not_depend_on_their_company() -> None:
    rng = np.random.default_rng(5)
    rows = np.column_stack(
        [rng.uniform(1, 20, (20, 2)), np.full((20, 2), [9.8, 1.0]), rng.uniform(0, 300, (20, 3))]
    )
    statics = slider_pendulum()
    together = search_rows(statics, rows)
    for k in (0, 7, 19):
        alone = search_rows(statics, rows[k : k + 1])
        assert (alone.count[0] == together.count[k]).all()
        count = alone.count[0, 0]
        assert (alone.zeros[0, :count] == together.zeros[k, :count]).all()


def test_printed_lists_maps_and_verdicts_tell_that_a_load_changes() -> None:
    device = fm.Scene(load=fm.loads.Harmonic(80.0, 4.0))
    found, told = fm.find_equilibria(device), "loads that change are held: Harmonic at its mean"
    assert len(found) == 6
    assert told in repr(found)
    assert told in " ".join(repr(found.certificate).split())
    assert len(repr(found).splitlines()) <= 6
    assert told in " ".join(repr(fm.classify(device, found[0])).split())
    assert told in repr(fm.map_equilibria(device, {"c1": [100.0]}))
    assert "load" not in repr(fm.find_equilibria(fm.mechanisms.cart_pendulum()))


def test_public_names_take_a_mechanism() -> None:
    device = fm.mechanisms.cart_pendulum()
    found = fm.find_equilibria(device)
    assert fm.classify(device, found[0]).verdict == "stable"
    assert "angle" in repr(found)
    with pytest.raises(InputError, match="another mechanism"):
        fm.classify(device.replace(kt=11.0), found[0])
    with pytest.raises(InputError, match=r"must be one of fm\.find_equilibria"):
        fm.classify(device, (0.0, 0.0))
    with pytest.raises(InputError, match="at = 1: is for a Scene"):
        fm.find_equilibria(device, at=1)


@pytest.mark.parametrize(
    ("force", "line"),
    [
        (sp.erf(x) - 1, "'erf' has no proved bounds; known are sums, .* by inequalities"),
        (sp.Piecewise((1, sp.Eq(x, 0)), (sp.sin(x) / x, True)), r"'Eq\(x, 0\)' has no proved bounds"),
        (phi * x, "phi"),
    ],
)
def test_what_has_no_bounds_is_refused(force: Any, line: str) -> None:
    with pytest.raises(InputError, match=line):
        prove_equilibria(Statics((ranged(x, -1.0, 1.0),), (), (force,), False))


def test_an_endless_range_is_refused() -> None:
    with pytest.raises(InputError, match=r"x: -inf \.\. 1 must be a finite range"):
        prove_equilibria(Statics((ranged(x, -math.inf, 1.0),), (), (x,), False))


def test_functions_of_forces_hold_their_values() -> None:
    """Every function that forces may have, against SciPy's root."""
    third = sp.Rational(1, 3)
    waves = [sp.tan(x / 2) - third, sp.atan(3 * x) - third, sp.sqrt(2) * x - sp.pi / 5]
    powers = [(x + 3) ** sp.Rational(3, 2) - 6, 1 / (x + 3) ** 2 - third / 3, x**3 - 2]
    powers += [
        (x + 3) ** third - sp.Rational(7, 5),
        (x + 3) ** -1.7 - 0.2,
        2**x - 2 * third,
        (x + 3) ** x - 2,
    ]
    arcs = [sp.asin(x / 3) - third, sp.acos(x / 3) - 1, sp.atan2(x + 2, -x - 2.5) - 2.5, sp.atan2(-2, x) + 2]
    hyperbolic = [sp.tanh(x) - third, sp.sinh(x) - 2, sp.cosh(x + 1) - 2, x + sp.sinh(x) / sp.cosh(x) - third]
    hyperbolic += [sp.asinh(x) - third, sp.acosh(x + 2 + third) - 1, sp.atanh(x / 3) - third]
    contacts = [sp.Max(0, x - third) + sp.Min(0, x) - 1, x * sp.Heaviside(x - third) - third * 2]
    pieces = [sp.Piecewise((x, x < third), (3 * x - 2 * third, x < 1), (x + 4 * third, True)) - 1]
    modules = [{"Heaviside": lambda u, _: float(u > 0.0)}, "math"]
    for force in [
        *waves, *powers, *arcs, *hyperbolic, *contacts, *pieces, sp.exp(x) - 2, sp.log(x + 3) - 1
    ]:  # fmt: skip
        found = prove_equilibria(Statics((ranged(x, -1.0, 2.0),), (), (force,), True))
        expected = scipy.optimize.brentq(sp.lambdify(x, force, modules), -1.0, 2.0, xtol=1e-15)
        assert found.certificate.complete
        assert found.position[:, 0] == pytest.approx([expected], abs=1e-13)


def test_a_pitchfork_of_a_saturating_force() -> None:
    """k x = F tanh(x / a): one position for F < k a, else three, by SciPy."""
    x = fm.lengths("x", -3.0, 3.0)
    k, F, a = sp.symbols("k F a")
    U = k * x**2 / 2 - F * a * sp.log(sp.cosh(x / a))
    bead = fm.Mechanism(x, {"k": 2.0, "F": 0.5, "a": 0.2}, kinetic=x.dot**2, potential=U)
    for part in (0.3, 1 - 1e-9, 1 + 1e-9, 1.25, 6.0):
        found = fm.find_equilibria(bead.replace(F=0.4 * part))
        assert found.certificate.complete
        assert found.certificate.index_sum == found.certificate.expected_sum == 1
        if part < 1.0:
            assert found.position.tolist() == [[pytest.approx(0.0, abs=1e-12)]]
            assert found[0].stiffness[0, 0] == pytest.approx(2.0 * (1.0 - part), rel=1e-6)
        else:
            low = 0.2 * math.sqrt(3.0 * (1.0 - 1.0 / part)) * 0.5
            root = scipy.optimize.brentq(lambda z, F: 2.0 * z - F * np.tanh(z / 0.2), low, 3.0, (0.4 * part,))
            assert sorted(found.position[:, 0]) == pytest.approx([-root, 0.0, root], rel=1e-6, abs=1e-12)
            assert sorted(found.kind) == ["maximum", "minimum", "minimum"]


def contact(form: str, x: Any, g: Any) -> Any:
    """Half the square of how deep a bead is in, in five forms."""
    return {
        "Max": sp.Max(0, x - g) ** 2 / 2,
        "Min": sp.Min(0, g - x) ** 2 / 2,
        "Heaviside": sp.Heaviside(x - g) * (x - g) ** 2 / 2,
        "Piecewise": sp.Piecewise((0, x < g), ((x - g) ** 2 / 2, True)),
        "Abs": (x - g + sp.Abs(x - g)) ** 2 / 8,
    }[form]


@pytest.mark.parametrize("form", ["Max", "Min", "Heaviside", "Piecewise", "Abs"])
def test_a_spring_that_touches_after_a_gap(form: str) -> None:
    """k (x - s) + K (x - g) = 0 beyond the gap, x = s before it; where it begins, stiffness has no value."""
    x = fm.lengths("x", -1.0, 1.0)
    k, K, g, s = sp.symbols("k K g s")
    U = k * (x - s) ** 2 / 2 + K * contact(form, x, g)
    bead = fm.Mechanism(x, {"k": 2.0, "K": 700.0, "g": 0.3, "s": 0.5}, kinetic=x.dot**2, potential=U)
    for free, place, stiffness in (
        (0.5, (2.0 * 0.5 + 700.0 * 0.3) / 702.0, 702.0),
        (0.3 + 1e-5, 0.3 + 2e-5 / 702.0, 702.0),
        (0.3 - 1e-8, 0.3 - 1e-8, 2.0),
        (0.2, 0.2, 2.0),
    ):
        found = fm.find_equilibria(bead.replace(s=free))
        assert found.certificate.complete
        assert found.position[:, 0] == pytest.approx([place], rel=1e-14)
        assert found[0].stiffness[0, 0] == pytest.approx(stiffness)
        assert found[0].energy == pytest.approx(
            (place - free) ** 2 + 350.0 * max(0.0, place - 0.3) ** 2, rel=1e-6
        )
    found = fm.find_equilibria(bead.replace(s=0.3))
    assert not len(found)
    (left,) = found.certificate.places
    assert left.low[0] < 0.3 < left.high[0]
    assert "stiffness jumps here, as where a contact begins" in found.certificate.sentence


def test_where_forces_jump_nothing_is_proved() -> None:
    """x - 1 right of zero, x + 1 left of it; an angle that jumps by a turn; a bead that rests on an edge."""
    x, q = fm.lengths("x", -2.0, 2.1), fm.angles("q")
    two_slopes = sp.Piecewise((x**2 / 2 - x, x > 0), (x**2 / 2 + x, True))
    around = (sp.atan2(sp.sin(q), sp.cos(q)) - 1) ** 2
    for coordinate, U, zeros, place in (
        (x, two_slopes, [-1.0, 1.0], 0.0),
        (x, x**2 + sp.Abs(x) - x / 2, [], 0.0),
        (x, sp.Max(x, -3 * x), [], 0.0),
        (q, around, [1.0], math.pi),
    ):
        bead = fm.Mechanism(coordinate, kinetic=coordinate.dot**2, potential=U)
        found = fm.find_equilibria(bead)
        assert sorted(found.position[:, 0]) == pytest.approx(zeros, abs=1e-14)
        (left,) = found.certificate.places
        assert left.low[0] <= place <= left.high[0]
        assert "not be defined everywhere" in left.reason


def test_where_a_potential_jumps_nothing_is_proved() -> None:
    """Also where slopes on both sides are alike, or SymPy's derivative is smooth; by hand where U jumps."""
    x, y = fm.lengths("x y", -2.0, 2.1)
    g, h = sp.symbols("g h")
    left, half = (sp.Piecewise((x**2, x < edge), (x**2 + 1, True)) for edge in (0, 0.5))
    for U, zeros, places in (
        (half, [0.0], [0.5]),
        (left, [], [0.0]),
        (sp.Piecewise((x**2 - 3, (x > 0.5) & (x < 1)), (x**2, True)), [0.0], [0.5, 1.0]),
        (sp.Piecewise((x**2, (x < 0.5) | (x > 1)), (x**2 + 1, True)), [0.0], [0.5, 1.0]),
        (x**2 - sp.Heaviside(x - 0.5), [0.0], [0.5]),
        (x**2 + sp.sign(x - 0.5) ** 3, [0.0], [0.5]),
        (x**2 + sp.atan2(x - 0.5, -1) / 50 + (x - 0.5) / 50, None, [0.5]),
        (sp.Piecewise((x**2, x < g), (x**2 + 1, x < h), (x**2, True)), [0.0], [0.5]),
    ):
        device = fm.Mechanism(x, {"g": 0.5, "h": 3.0}, kinetic=x.dot**2, potential=U)
        found = fm.find_equilibria(device)
        assert not found.certificate.complete
        if zeros is not None:
            assert found.position[:, 0] == pytest.approx(zeros, abs=1e-14)
        assert sorted(place.high[0] for place in found.certificate.places) == pytest.approx(places, abs=1e-6)
    plane = fm.Mechanism((x, y), kinetic=x.dot**2 + y.dot**2, potential=half + (y - 0.3) ** 2)
    (place,) = fm.find_equilibria(plane).certificate.places
    assert [*place.low, *place.high] == pytest.approx([0.5, 0.3, 0.5, 0.3], abs=1e-6)


def test_pieces_that_meet_are_decided() -> None:
    """A spring that yields, with borders by parameters and by decimals; a circle; atan2 where smooth."""
    x, y = fm.lengths("x y", -2.0, 2.1)
    k, g, h = sp.symbols("k g h")

    def yielding(k: Any, g: Any, h: Any) -> Any:
        last = k * (h - g) ** 2 / 2 + k * (h - g) * (x - h)
        return sp.Piecewise((0, x < g), (k * (x - g) ** 2 / 2, x < h), (last, True))

    values, ring = {"k": 5.0, "g": 0.1, "h": 0.4}, x**2 + y**2 - 0.25
    wall = sp.Piecewise((0, ring < 0), (5 * ring**2, True))
    for coordinates, U, place in (
        ((x,), x**2 - 3.5 * x + yielding(k, g, h), [1.0]),  # 2 x + 5 (0.4 - 0.1) = 3.5
        ((x,), x**2 - 3.5 * x + yielding(5, 0.1, 0.4), [1.0]),
        ((x, y), x**2 / 2 - 0.4 * x + y**2 + wall, [0.4, 0.0]),
        ((x,), x**2 + sp.atan2(x, 1 + 0.1 * x**2) ** 2, [0.0]),
    ):
        found = fm.find_equilibria(
            fm.Mechanism(coordinates, values, kinetic=sum(c.dot**2 for c in coordinates), potential=U)
        )
        assert found.certificate.complete
        assert found[0].position == pytest.approx(place, abs=1e-13)


def test_what_is_smooth_across_a_bend_is_decided_there() -> None:
    """By hand: a gap on both sides of the middle, |x|^3, and what SymPy does not know to be real."""
    x = fm.lengths("x", -1.0, 1.2)
    gap = 50 * sp.Max(0, sp.Abs(x) - 0.2) ** 2
    root, power = sp.sqrt(x + 2), (x + 2) ** 0.3
    for U, place, stiffness in (
        (gap + x**2, 0.0, 2.0),
        (gap - 3 * x, 0.23, 100.0),
        (sp.Abs(x) ** 3 + x**2, 0.0, 2.0),
        (sp.Abs(root - 3) + x**2, None, None),
        (sp.Abs(power - 1.6) + x**2, None, None),
    ):
        found = fm.find_equilibria(fm.Mechanism(x, kinetic=x.dot**2, potential=U))
        assert found.certificate.complete
        if place is None:
            place = scipy.optimize.minimize_scalar(
                sp.lambdify(x, U), (-1.0, 0.1, 1.2), options={"xtol": 1e-9}
            ).x
            assert found.position[:, 0] == pytest.approx([place], abs=1e-7)
        else:
            assert found.position[:, 0] == pytest.approx([place], abs=1e-14)
            assert found[0].stiffness[0, 0] == pytest.approx(stiffness)


def test_half_powers_may_be_decimal_numbers() -> None:
    x, h = fm.lengths("x", -1.0, 1.0), sp.Symbol("h")
    square = x**2 + h**2
    U = square**-1.5 / 50 + square**0.5 + square**2.0 + square**-3.0 / 900 - x
    found = fm.find_equilibria(fm.Mechanism(x, {"h": 0.6}, kinetic=x.dot**2, potential=U))
    slope = sp.lambdify(x, U.subs(h, 0.6).diff(x))
    assert found.certificate.complete
    assert found.position[:, 0] == pytest.approx([scipy.optimize.brentq(slope, -1.0, 1.0)], abs=1e-11)


def test_only_what_the_jacobian_needs_comes_after_the_forces() -> None:
    from fastmech.models.balance import source

    lines = source(of_potential([angle(theta)], (), sp.cos(theta))).splitlines()
    split = next(i for i, line in enumerate(lines) if "return False" in line)
    assert any("sin(" in line for line in lines[7:split])
    assert not any("cos(" in line for line in lines[7:split])


def test_a_spring_on_a_line_passes_length_zero() -> None:
    """By hand: 100 (x - 1) + 30 (x - 1.3) = 0 right of O, 100 (x + 1) + 30 (x - 1.3) = 0 left of it."""
    x = fm.lengths("x", -3.0, 3.0)
    k, L = sp.symbols("k L")
    bead = fm.Mechanism(
        x,
        {"k": 100.0, "L": 1.0},
        points={"O": (0, 0), "M": (x, 0), "W": (1.5, 0)},
        masses={"M": 1.0},
        springs=[fm.Spring("O", "M", k, L), fm.Spring("W", "M", 30.0, 0.2)],
    )
    found = fm.find_equilibria(bead)
    assert sorted(found.position[:, 0]) == pytest.approx([-61.0 / 130.0, 139.0 / 130.0], rel=1e-15)
    (place,) = found.certificate.places
    assert place.low[0] < 0.0 < place.high[0]
    # The left one ends where it comes to O: 100 L = 39.
    snap = fm.find_snap(bead, (-0.46,), (0.1, 2.0), parameter="L")
    assert snap.below == pytest.approx(0.39, abs=1e-6)


@pytest.mark.parametrize(("e", "a"), [(3e-3, 0.1), (1e-3, 1e-3), (1e-8, 0.0), (1e-5, -0.3)])
def test_a_soft_position_beside_a_stiff_one_is_placed(e: float, a: float) -> None:
    """U = e (x - a)^2 / 2 + (x - a)^4 / 4 + k y^2 / 2 rests at (a, 0) with the stiffness e along x."""
    x, y = fm.lengths("x y", -1.0, 1.0)
    for k in (1.0, 10.0, 1e4):
        U = e * (x - a) ** 2 / 2 + (x - a) ** 4 / 4 + k * y**2 / 2
        found = fm.find_equilibria(fm.Mechanism((x, y), kinetic=x.dot**2 + y.dot**2, potential=U))
        assert found.certificate.complete
        assert found.position == pytest.approx(np.array([[a, 0.0]]), abs=1e-7)
        assert found[0].radius <= 1e-6
        assert found[0].stiffness[0, 0] == pytest.approx(e, rel=1e-3)


def test_a_proof_does_not_depend_on_how_an_anchor_is_written() -> None:
    """A double pendulum whose second spring ends at (d / 2, 0), with one symbol or with two of its own."""
    a, b = fm.angles("a b")
    l1, l2, m, k, n, g, d, ax, ay = sp.symbols("l1 l2 m k n g d ax ay")
    elbow = (l1 * sp.sin(a), -l1 * sp.cos(a))
    hand = (elbow[0] + l2 * sp.sin(b), elbow[1] - l2 * sp.cos(b))
    values = {"l1": 0.5, "l2": 0.4, "m": 1.0, "k": 60.0, "n": 0.3, "g": 9.81}
    lists = [
        fm.find_equilibria(
            fm.Mechanism(
                (a, b), values | own, points={"E": elbow, "H": hand, "V": anchor},
                masses={"E": 1.5 * m, "H": m}, springs=[fm.Spring("V", "H", k, free_length=n)], gravity=g,
            )
        )
        for anchor, own in (((d / 2, 0), {"d": 0.8}), ((ax, ay), {"ax": 0.4, "ay": 0.0}))
    ]  # fmt: skip
    assert all(found.certificate.complete for found in lists)
    assert lists[0].position == pytest.approx(lists[1].position, abs=1e-12)
