"""Critical values of mechanisms against closed forms and the scene's folds."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
import sympy

import fastmech as fm


def test_ziegler_s_column() -> None:
    """P l / k = 7/2 -+ sqrt 2 where nothing damps; 41/28 + b^2 / (2 k m l^2) with equal dashpots.

    Flutter becomes divergence at the double root of the characteristic polynomial that is positive.
    """
    column, loads = fm.mechanisms.ziegler_column(), np.linspace(0.1, 7.0, 13)
    first, second = fm.critical_values(column, "P", loads)
    assert (first.kind, first.growing, first.swinging) == ("coalescence", (0, 2), (0, 2))
    assert (second.kind, second.growing, second.swinging) == ("flutter-divergence", (2, 2), (2, 0))
    assert first.value == pytest.approx(3.5 - math.sqrt(2.0), rel=1e-13)
    assert second.value == pytest.approx(3.5 + math.sqrt(2.0), rel=1e-13)
    assert str(second).endswith("(0, 0), eigenvalues that grow 2 -> 2, that swing 2 -> 0")
    P, x = sympy.symbols("P x")
    for b in (0.1, 0.4):
        first, second = fm.critical_values(column.replace(b=b), "P", loads)
        assert (first.kind, second.kind) == ("Hopf", "flutter-divergence")
        assert first.value == pytest.approx(41.0 / 28.0 + b * b / 2.0, rel=1e-13)
        assert first.width < 1e-12
        rods = (
            sympy.Matrix([[3, 1], [1, 1]]) * x**2 + sympy.Matrix([[2, -1], [-1, 1]]) * sympy.Rational(b) * x
        )
        own = (rods + sympy.Matrix([[2 - P, P - 1], [-1, 1]])).det()
        limits = [z for z in sympy.Poly(sympy.discriminant(own, x), P).nroots(20) if z.is_real]
        assert second.value == pytest.approx(float(max(limits)), rel=1e-13)


def test_mirror_images_change_at_one_value_each_in_its_place() -> None:
    """U' = x ((x^2 - 1)^2 - p): at p = 0 a pair comes at x = -1 and at x = 1; at p = 1 two meet the third."""
    x, p = fm.lengths("x", -2.0, 2.0), sympy.Symbol("p")
    device = fm.Mechanism(
        x, {"p": 0.5}, kinetic=x.dot**2 / 2, potential=x**6 / 6 - x**4 / 2 + (1 - p) * x**2 / 2
    )
    left, right, middle = fm.critical_values(device, "p", [-0.7, 0.4, 1.8])
    assert [one.kind for one in (left, right, middle)] == ["fold", "fold", "pitchfork"]
    assert sorted(one.position[0] for one in (left, right)) == pytest.approx([-1.0, 1.0], abs=1e-13)
    assert left.value == right.value == pytest.approx(0.0, abs=1e-13)
    assert middle.value == pytest.approx(1.0, rel=1e-13)


def counted(mass: np.ndarray, damping: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """How many eigenvalues grow, and how many of these swing (..., 2), by NumPy."""
    n, zero = len(mass), np.zeros_like(stiffness)
    right = np.concatenate([-np.linalg.solve(mass, stiffness), zero - np.linalg.solve(mass, damping)], -1)
    roots = np.linalg.eigvals(np.concatenate([np.concatenate([zero, zero + np.eye(n)], -1), right], -2))
    growing = roots.real > 1e-6
    return np.stack([growing.sum(-1), (growing & (np.abs(roots.imag) > 1e-6)).sum(-1)], -1)


@pytest.mark.parametrize("seed", range(8))
def test_changes_of_a_follower_column_are_those_of_a_dense_scan(seed: int) -> None:
    """Two rods of random sizes under a force that turns by ``share`` of the upper one's angle; upright."""
    rng, q, P = np.random.default_rng(seed), fm.angles("a b", -1.4, 1.4), sympy.Symbol("P")
    m, l, k = rng.uniform(0.5, 2.0, (3, 2))
    c, share = (seed % 2) * rng.uniform(0.05, 0.5, 2), 1.0 if seed < 4 else rng.uniform(0.3, 0.9)
    knee = l[0] * sympy.sin(q[0]), l[0] * sympy.cos(q[0])
    tip = knee[0] + l[1] * sympy.sin(q[1]), knee[1] + l[1] * sympy.cos(q[1])
    column = fm.Mechanism(
        q, {"P": 0.5}, points={"K": knee, "T": tip}, masses={"K": m[0], "T": m[1]},
        springs=[fm.TorsionSpring(q[0], k[0]), fm.TorsionSpring(q[1] - q[0], k[1])],
        dampers=[fm.TorsionDamper(q[0], c[0]), fm.TorsionDamper(q[1] - q[0], c[1])],
        forces=[fm.Force("T", P, (-sympy.sin(share * q[1]), -sympy.cos(share * q[1])))],
    )  # fmt: skip
    found = fm.critical_values(column, "P", np.linspace(0.1, 12.0, 60))
    mass = np.array([[l[0] ** 2 * m.sum(), l[0] * l[1] * m[1]], [l[0] * l[1] * m[1], l[1] ** 2 * m[1]]])
    joints = np.array([[1.0, 0.0], [-1.0, 1.0]])
    turned = np.array([[-l[0], share * l[0]], [0.0, (share - 1.0) * l[1]]])
    loads = np.linspace(0.1, 12.0, 40001)
    stiff = joints.T @ np.diag(k) @ joints + loads[:, None, None] * turned
    scan = counted(mass, joints.T @ np.diag(c) @ joints, stiff)
    jumps = np.flatnonzero((scan[1:] != scan[:-1]).any(1))
    upright = [one for one in found if np.abs(one.position).max() < 1e-3]
    np.testing.assert_allclose([one.value for one in upright], loads[jumps], atol=2.0 * loads[1] - 0.2)
    for one, jump in zip(upright, jumps, strict=True):
        if one.kind != "pitchfork":
            sides = np.array([one.growing, one.swinging]).T
            np.testing.assert_array_equal(sides, scan[jump : jump + 2])


@pytest.mark.parametrize(("span", "rise"), [(2.0, 0.4), (1.94, 0.23), (1.62, 0.41)])
def test_the_truss_snaps(span: float, rise: float) -> None:
    """2 k L0 (1 - cos(a)^(2/3))^(3/2) by mpmath, each value within the width that is told."""
    truss = fm.mechanisms.von_mises_truss().replace(span=span, rise=rise)
    with mpmath.workdps(40):
        length = mpmath.sqrt(mpmath.mpf(span) ** 2 / 4 + mpmath.mpf(rise) ** 2)
        cube = 1 - (span / 2 / length) ** (mpmath.mpf(2) / 3)
        expected = 2 * truss.parameters["k"] * length * cube ** mpmath.mpf(1.5)
    found = fm.critical_values(truss, "P", np.linspace(-1.3, 1.1, 12) * float(expected))
    assert [one.kind for one in found] == ["fold", "fold"]
    for one, sign in zip(found, (-1, 1), strict=True):
        assert abs(one.value - sign * expected) <= 0.5 * one.width < 1e-13 * expected
        assert one.direction == (0.0, 1.0)
    snap = fm.find_snap(truss, (0.0, rise), (-0.5 * found[1].value, 1.2 * found[1].value), parameter="P")
    assert snap.above == pytest.approx(float(expected), rel=2e-14)


@pytest.mark.parametrize(("span", "rise"), [(0.6, 1.0), (0.3164, 1.4803)])
@pytest.mark.parametrize("number", [21, 22])
def test_the_tall_truss_goes_sideways(span: float, rise: float, number: int) -> None:
    """Where sin(b)^2 cos(b) = cos(a): there lists of equilibria are hidden by rounding far about."""
    with mpmath.workdps(40):
        half = mpmath.mpf(span) / 2
        length = mpmath.sqrt(half**2 + mpmath.mpf(rise) ** 2)
        ends = mpmath.asin(mpmath.sqrt(mpmath.mpf(2) / 3)), mpmath.atan(rise / half)
        b = mpmath.findroot(
            lambda b: mpmath.sin(b) ** 2 * mpmath.cos(b) - half / length, ends, "anderson", tol=1e-30
        )
        expected = 2000 * (length - half / mpmath.cos(b)) * mpmath.sin(b)
        height = float(half * mpmath.tan(b))
    truss = fm.mechanisms.von_mises_truss().replace(span=span, rise=rise)
    found = fm.critical_values(truss, "P", np.linspace(0.01, 1.3, number) * float(expected))
    (one,) = [one for one in found if one.kind == "pitchfork"]
    assert abs(one.value - expected) <= 0.5 * one.width < 1e-13 * expected
    assert one.position == (0.0, pytest.approx(height, rel=1e-13))
    assert str(one) == f"{one.value:.12g}: pitchfork at (0, {height:.6g}) along (1, 0)"


def test_the_pendulum_on_a_cart() -> None:
    """Upright is stable from kt = m g l on: two leaning positions end there."""
    for number in (9, 10):
        (found,) = fm.critical_values(fm.mechanisms.cart_pendulum(), "kt", np.linspace(1.0, 30.0, number))
        assert found.kind == "pitchfork"
        assert abs(found.value - 9.81) <= 0.5 * found.width < 1e-12
    assert str(found) == "9.81: pitchfork at (0, 0) along (0, 1)"


def test_the_bead_on_a_hoop() -> None:
    """It leaves the bottom where R w^2 = g."""
    angle, (w, g, R) = fm.angles("angle"), sympy.symbols("w g R")
    hoop = fm.Mechanism(
        angle, {"w": 1.0, "g": 9.81, "R": 0.3}, kinetic=R**2 * angle.dot**2 / 2,
        potential=-g * R * sympy.cos(angle) - (R * w * sympy.sin(angle)) ** 2 / 2,
    )  # fmt: skip
    (found,) = fm.critical_values(hoop, "w", np.linspace(0.5, 9.0, 8))
    assert found.kind == "pitchfork"
    assert abs(found.value - math.sqrt(9.81 / 0.3)) <= 0.5 * found.width < 1e-13


@pytest.mark.parametrize("tilt", [1e-4, 1e-9, 1e-14])
def test_an_imperfect_pitchfork_is_a_fold(tilt: float) -> None:
    """(a - 0.3) x + x^3 + tilt = 0 is one at a = 0.3 - 3 (tilt / 2)^(2/3)."""
    mechanism = sliding((A - sympy.Float(0.3)) * X**2 / 2 + FORM + tilt * X)
    (found,) = fm.critical_values(mechanism, "a", np.linspace(-0.6, 1.1, 9))
    expected = 0.3 - 3.0 * (tilt / 2.0) ** (2.0 / 3.0)
    assert found.kind == "fold"
    assert abs(found.value - expected) <= 0.5 * found.width < 1e-13


@pytest.mark.parametrize("parameter", ["c1", "F0"])
def test_folds_of_the_papers_mechanism_are_the_scenes(parameter: str) -> None:
    values = {"c1": np.linspace(40.0, 400.0, 25), "F0": np.linspace(20.0, 900.0, 45)}[parameter]
    scene = fm.Scene(alpha=0.0, c2=92.85, F0=85.3, c1=294.9)
    mechanism = fm.mechanisms.slider_pendulum().replace(alpha=0.0, c2=92.85, F0=85.3, c1=294.9)
    expected = sorted(fold.value for fold in fm.find_folds(scene, parameter, values))
    found = [one.value for one in fm.critical_values(mechanism, parameter, values) if one.kind == "fold"]
    np.testing.assert_allclose(found, expected, rtol=1e-12)


X = fm.lengths("x", -3.0, 3.0)
A, FORM = sympy.Symbol("a"), X**4 / 4


def sliding(potential: sympy.Expr) -> fm.Mechanism:
    """A damped mass on a line, with a potential of one parameter."""
    c = sympy.Symbol("c")
    values = {"a": 1.0, "c": 0.3}
    return fm.Mechanism(X, values, kinetic=X.dot**2 / 2, potential=potential, dissipation=c * X.dot**2 / 2)


def test_equilibria_that_cross_an_end_of_the_range_meet_nothing() -> None:
    """x^2 = 5 +- sqrt(25 - 10 a): two cross +-3 at a = 0.9, and pairs meet at a = 2.5."""
    mechanism = sliding(A * X**2 / 2 - FORM + X**6 / 60)
    found = fm.critical_values(mechanism, "a", np.linspace(0.5, 3.0, 6))
    assert [one.kind for one in found] == ["end of range", "fold", "fold"]
    assert [one.value for one in found] == pytest.approx([0.9, 2.5, 2.5], rel=1e-13)
    places = sorted(one.position[0] for one in found[1:])
    assert places == pytest.approx([-math.sqrt(5.0), math.sqrt(5.0)], abs=1e-12)
    assert abs(found[0].position[0]) == pytest.approx(3.0, rel=1e-9)


@pytest.mark.parametrize("at", [0.0, 1.0])
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("grid", [np.linspace(-1.0, 1.3, 8), np.linspace(-1.0, 1.0, 9)])
def test_a_pitchfork_is_one_wherever_it_is(at: float, sign: int, grid: np.ndarray) -> None:
    mechanism = sliding((A - sympy.Float(at)) * X**2 / 2 + sign * FORM)
    (found,) = fm.critical_values(mechanism, "a", grid + at)
    assert found.kind == "pitchfork"
    assert found.value == pytest.approx(at, abs=1e-12)
    assert found.position[0] == pytest.approx(0.0, abs=1e-6)


def test_a_pitchfork_is_one_on_every_grid() -> None:
    """A bead on a rail under a spring of free length L: where L is the spring's length, within rounding."""
    d, L = 0.3, sympy.Symbol("L")
    spring = 50.0 * (sympy.sqrt(X**2 + d**2) - L) ** 2
    bead = fm.Mechanism(X, {"L": 0.5}, kinetic=X.dot**2 / 2, potential=spring)
    for number in range(5, 24, 3):
        (found,) = fm.critical_values(bead, "L", np.linspace(0.1, 1.0, number))
        assert (found.kind, found.value) == ("pitchfork", pytest.approx(d, abs=1e-12))


def test_a_pitchfork_needs_no_potential() -> None:
    """Two rods on torsion springs, P turned by 0.3 b on the tip: 0.7 P^2 - 2.1 P + 1 is the determinant."""
    (a, b), (P, m) = fm.angles("a b", -1.4, 1.4), sympy.symbols("P m")
    knee = sympy.sin(a), sympy.cos(a)
    tip = knee[0] + sympy.sin(b), knee[1] + sympy.cos(b)
    column = fm.Mechanism(
        (a, b), {"P": 0.5, "m": 1.0}, points={"K": knee, "T": tip}, masses={"K": m, "T": m},
        springs=[fm.TorsionSpring(a, 1), fm.TorsionSpring(b - a, 1)],
        forces=[fm.Force("T", P, (-sympy.sin(0.3 * b), -sympy.cos(0.3 * b)))],
    )  # fmt: skip
    assert fm.find_equilibria(column)[0].morse_index is None
    (found,) = fm.critical_values(column, "P", [0.57, 0.62])
    assert (found.kind, found.value) == ("pitchfork", pytest.approx(1.5 - math.sqrt(2.25 - 1.0 / 0.7)))
    assert found.position == pytest.approx((0.0, 0.0), abs=1e-6)


@pytest.mark.parametrize("at", [0.0, 1.0])
def test_an_exchange_is_seen(at: float) -> None:
    """x = 0 and x = at - a pass through each other; a little apart they do not, and two folds are there."""
    grid = at + np.linspace(-0.9, 0.93, 9)
    crossing = (A - sympy.Float(at)) * X**2 / 2 + X**3 / 3
    (found,) = fm.critical_values(sliding(crossing), "a", grid)
    assert found.kind == "exchange"
    assert abs(found.value - at) <= 0.5 * found.width < 1e-13
    assert found.position[0] == pytest.approx(0.0, abs=1e-13)
    assert not fm.critical_values(sliding(crossing - X / 1000), "a", grid)
    folds = fm.critical_values(sliding(crossing + X / 1000), "a", np.sort(np.append(grid, at)))
    assert [one.kind for one in folds] == ["fold", "fold"]
    assert [one.value - at for one in folds] == pytest.approx([-(0.004**0.5), 0.004**0.5], rel=1e-12)


def test_changes_are_seen_where_lists_are_not_proved_complete() -> None:
    """Springs of the tall truss can have length zero."""
    truss = fm.mechanisms.von_mises_truss().replace(span=1.0, rise=1.5)
    found = fm.critical_values(truss, "P", np.linspace(300.0, 500.0, 5))
    assert [one.kind for one in found] == ["pitchfork"]
    assert found.incomplete == found.points_of_grid == 5
    assert "; at 5 of 5 points of the grid equilibria are not proved complete" in " ".join(str(found).split())
    curves = fm.critical_curves(truss, ("P", [350.0, 450.0]), ("rise", [1.45, 1.5]))
    assert [curve.kind for curve in curves.curves] == ["pitchfork"]
    assert curves.incomplete == 4
    assert "at 4 of 4 points of the grid equilibria are not proved complete" in " ".join(str(curves).split())
    complete = fm.critical_values(fm.mechanisms.von_mises_truss(), "P", [1.0, 100.0])
    assert complete.incomplete == 0
    assert "complete" not in str(complete)


def test_a_corner_where_a_spring_has_length_zero_hides_no_fold() -> None:
    """x^2 + k x / (1 + k) = P far from that corner, which is left in many boxes."""
    x, y = fm.lengths("x y", -1.0, 1.0)
    m, c, k, s, d, P = sympy.symbols("m c k s d P")
    pair = fm.Mechanism(
        (x, y),
        {"m": (1.0, "kg"), "c": (1.0, "N/m2"), "k": (1.0, "N/m"), "s": (1.0, "N/m"), "d": (1.999999, "m"),
         "P": (0.0, "N")},
        points={"A": (0, x), "B": (0, y - d)},
        masses={"A": m, "B": m},
        springs=[fm.Spring("A", "B", s, free_length=d)],
        potential=c * x**3 / 3 + k * y**2 / 2 - P * x,
    )  # fmt: skip
    found = fm.critical_values(pair, "P", np.linspace(-0.2, 0.2, 4))
    assert [one.kind for one in found] == ["fold"]
    assert found[0].value == pytest.approx(-1.0 / 16.0, rel=1e-12)
    assert found[0].position == pytest.approx((-0.25, -0.125), rel=1e-9)
    assert (found.incomplete, found.unclear) == (4, 0)
    curves = fm.critical_curves(pair, ("P", [-0.2, 0.1]), ("k", [1.0, 2.0]))
    assert [curve.kind for curve in curves.curves] == ["fold"]
    share = curves.curves[0].y / (1.0 + curves.curves[0].y)
    np.testing.assert_allclose(curves.curves[0].x, -0.25 * share**2, rtol=1e-9)
    assert len(curves.unexplained) == 0


def test_where_no_lists_can_be_compared_it_is_said() -> None:
    """Within its play everything is at rest."""
    x, (m, k, s, gap) = fm.lengths("x", -1.0, 1.0), sympy.symbols("m k s gap")
    play = fm.Mechanism(
        (x,),
        {"m": (1.0, "kg"), "k": (1.0, "N/m"), "s": (1.0, "N/m"), "gap": (0.5, "m")},
        kinetic=m * x.dot**2 / 2,
        potential=k * sympy.Max(0, x - gap) ** 2 / 2 + s * sympy.Max(0, -x - gap) ** 2 / 2,
    )
    found = fm.critical_values(play, "k", [1.0, 2.0, 3.0])
    assert len(found) == 0
    told = " ".join(str(found).split())
    assert told == (
        "critical values of k: nothing could be compared; at 3 of 3 points of the grid equilibria are not "
        "proved complete, at 3 of these they are too unclear to be compared: more may change"
    )
    curves = fm.critical_curves(play, ("k", [1.0, 2.0]), ("s", [1.0, 2.0]))
    told = " ".join(str(curves).split())
    assert "critical curves over k and s: nothing could be compared; at 4 of 4 points" in told


def test_what_is_wrong_gets_a_line() -> None:
    chain = fm.mechanisms.pendulum_chain(1)
    with pytest.raises(fm.InputError, match="two or more rising values"):
        fm.critical_values(chain, "F", [1.0])
    with pytest.raises(fm.InputError, match="must be a Mechanism"):
        fm.critical_values(fm.Scene(), "F0", [1.0, 2.0])  # type: ignore[arg-type]
    with pytest.raises(fm.InputError, match=r"^parameter = 'nothing'"):
        fm.critical_values(chain, "nothing", [1.0, 2.0])
