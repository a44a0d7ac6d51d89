"""Attractors found without being told what to look for: against published shares, closed forms and SciPy."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import fastmech as fm
from fastmech.attractors.flow import flow_of
from fastmech.attractors.search import recur, shrink
from fastmech.ensembles.status import Status

Floats = NDArray[np.float64]


def pendulum(t, x, x_dot, alpha, T, K):  # type: ignore[no-untyped-def]
    return x_dot, -alpha * x_dot + T - K * fm.sin(x)


def duffing(t, x, x_dot, delta, A):  # type: ignore[no-untyped-def]
    return x_dot, -delta * x_dot - x * x * x + A * fm.cos(t)


def lorenz(t, x, y, z, sigma, r, b):  # type: ignore[no-untyped-def]
    return sigma * (y - x), r * x - y - x * z, x * y - b * z


def van_der_pol(t, x, v, mu):  # type: ignore[no-untyped-def]
    return v, mu * (1.0 - x * x) * v - x


def hopf(t, x, y, m):  # type: ignore[no-untyped-def]
    g = m - x * x - y * y
    return g * x - y, g * y + x


def magnets(t, x, y, vx, vy, alpha, omega):  # type: ignore[no-untyped-def]
    ax, ay = -omega * omega * x - alpha * vx, -omega * omega * y - alpha * vy
    for k in range(3):
        dx, dy = x - np.cos(2.0 * np.pi * k / 3.0), y - np.sin(2.0 * np.pi * k / 3.0)
        cube = (dx * dx + dy * dy + 0.09) ** 1.5
        ax -= dx / cube
        ay -= dy / cube
    return vx, vy, ax, ay


PENDULUM = fm.System(pendulum, ["x", "x_dot"], {"alpha": 0.1, "T": 0.5, "K": 1.0}, angles=["x"])
DUFFING = fm.System(duffing, ["x", "x_dot"], {"delta": 0.08, "A": 0.2}, period=2.0 * math.pi)
LORENZ = fm.System(lorenz, ["x", "y", "z"], {"sigma": 0.12, "r": 0.0, "b": -0.6})
VAN_DER_POL = fm.System(van_der_pol, ["x", "v"], {"mu": 1.0})
HOPF = fm.System(hopf, ["x", "y"], {"m": 0.0})
MAGNETS = fm.System(magnets, ["x", "y", "vx", "vy"], {"alpha": 0.2, "omega": 0.5})


def near(share: float, published: float, n: int) -> bool:
    """Within four standard deviations of two samples, the published one of 4,000 starts."""
    return abs(share - published) < 4.0 * math.sqrt(published * (1.0 - published) * (1.0 / n + 1.0 / 4000))


def followed(rhs: Callable[..., Floats], start: Floats, t_end: float) -> Floats:
    """Where SciPy's DOP853 ends."""
    return np.asarray(solve_ivp(rhs, (0.0, t_end), start, "DOP853", rtol=1e-11, atol=1e-12).y[:, -1])


def test_pendulum_rests_or_turns_as_often_as_published() -> None:
    """0.152 at rest (bSTAB, Stender and Hoffmann 2022, case 1)."""
    middle = math.asin(0.5)
    ranges = {"x": (middle - math.pi, middle + math.pi), "x_dot": (-10.0, 10.0)}
    found = fm.find_attractors(PENDULUM, ranges, 4000)
    assert {one.kind for one in found} == {"fixed point", "periodic"}
    rest = next(one for one in found if one.kind == "fixed point")
    np.testing.assert_allclose(rest.points, [[middle, 0.0]], atol=1e-9)
    assert near(rest.found / 4000, 0.152, 4000)
    # The eigenvalues there: -alpha/2 +- i sqrt(cos x - alpha^2/4).
    assert rest.exponent == pytest.approx(-0.05, abs=1e-8)
    y = fm.samplers.Uniform(ranges).draw(4000, PENDULUM.state)
    for i in range(0, 4000, 250):
        end = followed(lambda t, s: np.array([s[1], -0.1 * s[1] + 0.5 - np.sin(s[0])]), y[i], 200.0)
        assert (abs(end[1]) < 0.1) == (found[int(found.label[i])].kind == "fixed point")


def test_duffing_has_its_five_attractors() -> None:
    """Shares of pybasin's tests; the product of multipliers is exp(-delta t) by Liouville's formula."""
    n = 4000
    found = fm.find_attractors(DUFFING, {"x": (-1.0, 1.0), "x_dot": (-0.5, 1.0)}, n)
    assert [one.forcing_periods for one in found] == [1, 3, 1, 2, 2]
    for one, published in zip(found, (0.4945, 0.25625, 0.1955, 0.0275, 0.02625), strict=True):
        assert near(one.found / n, published, n)
        assert one.period is not None
        assert one.multipliers is not None
        assert np.prod(one.multipliers).real == pytest.approx(math.exp(-0.08 * one.period), rel=1e-7)
        end = followed(
            lambda t, s: np.array([s[1], -0.08 * s[1] - s[0] ** 3 + 0.2 * np.cos(t)]),
            one.points[0],
            one.period,
        )
        np.testing.assert_allclose(end, one.points[0], atol=1e-8)
    assert not found.counts["unsure"]
    assert len(repr(found).splitlines()) == 6


def test_lorenz_escapes_or_ends_in_one_of_two_chaotic_attractors() -> None:
    """0.820 escape, 0.093 and 0.087 stay (bSTAB, case 3)."""
    n = 500
    found = fm.find_attractors(LORENZ, {"x": (-10.0, 10.0), "y": (-20.0, 20.0)}, n)
    assert [one.kind for one in found] == ["chaos", "chaos"]
    assert near(found.counts["escaped"] / n, 0.820, n)
    by_side = sorted(found, key=lambda one: float(one.points[:, 0].mean()))
    for one, published in zip(by_side, (0.093, 0.087), strict=True):
        assert near(one.found / n, published, n)
        assert one.exponent > 5.0 * one.exponent_error
    assert found.counts["unsure"] <= 0.01 * n
    assert found.dt > 0.02  # s: motions bound for infinity, which turn ever faster, do not ask for less


def test_a_cycle_of_a_system_without_time_is_one_attractor() -> None:
    """Period of van der Pol's equation with mu = 1: 6.66328685931 (Andersen and Geer 1982)."""
    found = fm.find_attractors(VAN_DER_POL, {"x": (-3.0, 3.0), "v": (-3.0, 3.0)}, 500)
    assert len(found) == 1
    assert found[0].found == 500
    assert found[0].period == pytest.approx(6.66328685931, abs=1e-9)
    assert found[0].forcing_periods is None


@pytest.mark.parametrize("half", [1e-3, 1e-6])
def test_motions_that_leave_a_narrow_range_of_starts_and_stay_have_not_escaped(half: float) -> None:
    found = fm.find_attractors(VAN_DER_POL, {"x": (-half, half), "v": (-half, half)}, 100)
    assert found[0].found == 100
    assert found[0].period == pytest.approx(6.66328685931, abs=1e-9)  # Andersen and Geer 1982


def test_motions_that_stay_far_out_do_not_hide_those_within() -> None:
    """x' = x (x^2 - 1) (x^2 - 2.25) / (1 + x^2)^2 (1 - x^2 / K^2), K = 1e4: +-1 attracts up to +-1.5."""

    def rates(t, x):  # type: ignore[no-untyped-def]
        s = x * x
        return (x * (s - 1.0) * (s - 2.25) / (1.0 + s) ** 2 * (1.0 - s / 1e8),)

    x = np.linspace(-1.9, 1.9, 200)[:, None]
    found = fm.find_attractors(fm.System(rates, ["x"], {}), x)
    inner = np.abs(x[:, 0]) < 1.49
    assert (found.label[inner] >= 0).all()
    ends = np.array([one.points[0, 0] for one in found])[found.label[inner]]
    np.testing.assert_allclose(ends, np.sign(x[inner, 0]), atol=1e-9)


def test_a_small_window_of_starts_has_the_attractor_of_the_large_one() -> None:
    def rates(t, x, v):  # type: ignore[no-untyped-def]
        return v, -0.05 * v - x - x**3 + fm.cos(1.2 * t)

    system = fm.System(rates, ["x", "v"], {}, period=2.0 * np.pi / 1.2)
    small, large = (fm.find_attractors(system, {"x": (-h, h)}, 50) for h in (1e-4, 2e-2))
    assert small[0].found == large[0].found == 50
    np.testing.assert_allclose(small[0].points, large[0].points, atol=1e-9)


@pytest.mark.parametrize("q", [33, 40])
def test_a_phase_locked_for_many_periods_is_periodic(q: int) -> None:
    """u = q x - t obeys u' = 0.2 sin u: u = pi attracts with the exponent -0.2, so that x turns once in q."""

    def rates(t, x):  # type: ignore[no-untyped-def]
        return ((1.0 + 0.2 * fm.sin(q * x - t)) / q,)

    system = fm.System(rates, ["x"], {}, period=2.0 * np.pi, angles=["x"])
    found = fm.find_attractors(system, {"x": (-np.pi, np.pi)}, 100)
    assert found[0].found == 100
    assert (found[0].kind, found[0].forcing_periods) == ("periodic", q)
    assert found[0].exponent == pytest.approx(-0.2, abs=1e-4)


def test_motions_just_beyond_a_doubling_are_no_torus() -> None:
    """They nearly come back after half their period: SciPy's DOP853 goes once around."""
    period = 2.0 * np.pi / 0.9
    system = fm.System(driven, ["x", "v"], {"F": 0.8, "w": 0.9}, period=period, angles=["x"])
    found = fm.find_attractors(system, {"x": (-3.1, 3.1), "v": (-3.0, 3.0)}, 300)
    eights = [one for one in found if one.forcing_periods == 8]
    assert len(eights) == 2
    assert not [one for one in found if one.kind == "torus"]
    for one in eights:
        assert one.period is not None
        run = solve_ivp(
            lambda t, y: (y[1], -0.1 * y[1] - np.sin(y[0]) + 0.8 * np.cos(0.9 * t)), (0.0, one.period),
            one.points[0], method="DOP853", rtol=1e-12, atol=1e-12, dense_output=True,
        )  # fmt: skip
        away = [run.sol(share * one.period) - one.points[0] for share in (0.5, 1.0)]
        distance = [abs(np.exp(1j * a[0]) - 1.0) + abs(a[1]) for a in away]
        assert distance[0] > 1e-3
        assert distance[1] < 1e-7


@pytest.mark.slow
def test_three_magnets_share_the_plane_by_symmetry() -> None:
    n = 500
    found = fm.find_attractors(MAGNETS, {"x": (-2.0, 2.0), "y": (-2.0, 2.0)}, n)
    assert len(found) == 3
    assert all(near(one.found / n, 1.0 / 3.0, n) for one in found)
    assert all(one.exponent == pytest.approx(-0.1, abs=1e-6) for one in found)  # -alpha / 2


def test_a_torus_is_told_from_chaos() -> None:
    """A circle turned by an irrational angle at each look: its largest exponent is zero."""

    def rhs(t, x, y, z):  # type: ignore[no-untyped-def]
        s = 1.0 - x * x - y * y
        return s * x - y, s * y + x, -z + fm.cos(1.4142135623730951 * t)

    system = fm.System(rhs, ["x", "y", "z"], {}, period=math.sqrt(2.0) * math.pi)
    found = fm.find_attractors(system, {"x": (-2.0, 2.0), "y": (-2.0, 2.0)}, 300)
    assert [one.kind for one in found] == ["torus"]
    assert abs(found[0].exponent) <= 3.0 * found[0].exponent_error
    np.testing.assert_allclose(np.hypot(*found[0].points[-100:, :2].T), 1.0, atol=1e-5)


def test_labels_maps_and_refinement_agree() -> None:
    axes = {"x": np.linspace(-1.0, 1.0, 33), "x_dot": np.linspace(-0.5, 1.0, 33)}
    found = fm.map_basins(DUFFING, axes)
    starts = np.stack(np.meshgrid(*axes.values(), indexing="ij"), axis=-1).reshape(-1, 2)
    labels = fm.label_starts(DUFFING, starts)
    np.testing.assert_array_equal(labels.well, found.well.ravel())
    assert len(found.tree) == 5
    _, shares = fm.basin_fractions(found.labels[0])
    np.testing.assert_allclose(shares.fraction, [one.found / 33**2 for one in found.tree])
    coarse = fm.map_basins(DUFFING, axes, refine=4)
    computed = coarse.computed
    assert 0.2 < computed.mean() < 1.0
    for one, two in zip(coarse.tree, found.tree, strict=True):
        np.testing.assert_allclose(one.points, two.points, atol=1e-8)
    np.testing.assert_array_equal(coarse.well[computed], found.well[computed])


def test_results_do_not_depend_on_threads_or_on_other_starts() -> None:
    ranges, told = {"x": (-1.0, 1.0), "x_dot": (-0.5, 1.0)}, list[int]()
    one, two = (fm.find_attractors(DUFFING, ranges, 600, threads=k, progress=told.append) for k in (1, 2))
    assert sum(told) == 2 * 600
    assert max(told) < 300
    np.testing.assert_array_equal(one.label, two.label)
    np.testing.assert_array_equal(one.time, two.time)
    y = fm.samplers.Uniform(ranges).draw(600, DUFFING.state)
    again = one.label_starts(y[100:200])
    np.testing.assert_array_equal(again.label, one.label[100:200])
    for starts, n in ((ranges, 50), (fm.samplers.Uniform(ranges, n=50), None), (y, 50)):
        np.testing.assert_array_equal(one.label_starts(starts, n).label, one.label[:50])
    assert one.label_starts(y[7]).label.tolist() == [one.label[7]]
    assert [one.index(each) for each in one] == list(range(len(one)))
    for wrong, told in (
        ([[0.0, 1.0, 2.0]], r"must be \(n, 2\)"),
        ("abc", "numbers of shape"),
        ({"z": 1}, "z"),
    ):
        with pytest.raises(fm.InputError, match=told):
            one.label_starts(wrong)  # type: ignore[arg-type]
    with pytest.raises(fm.InputError, match="is none of these attractors"):
        one.index([0.5, 0.0])


def test_what_a_start_does_is_told_apart() -> None:
    """x' = x^3 - x escapes in finite time from |x| > 1; a stopping condition is escape too."""

    def cubic(t, x):  # type: ignore[no-untyped-def]
        return (x * x * x - x,)

    y = np.array([[0.5], [-0.9], [1.5], [-2.0], [np.nan], [0.0]])
    found = fm.find_attractors(fm.System(cubic, ["x"], {}), y)
    assert len(found) == 1
    expected = ["CAPTURED", "CAPTURED", "ESCAPED", "ESCAPED", "START_NOT_FINITE", "CAPTURED"]
    assert [Status(s).name for s in found.status] == expected
    nowhere = fm.find_attractors(fm.System(lambda t, x: (-x / (x - x),), ["x"], {}), {"x": (-1.0, 1.0)}, 30)
    assert nowhere.counts["not_finite"] == 30
    bounded = fm.System(cubic, ["x"], {}, stop=lambda t, x: 1.0 if x > 1.2 else 0.0)
    assert fm.find_attractors(bounded, y).status[2] == Status.ESCAPED
    short = fm.find_attractors(PENDULUM, {"x": (-3.0, 3.0), "x_dot": (-10.0, 10.0)}, 200, t_end=6.0)
    assert short.counts["undecided"] > 50


def test_a_mechanism_under_a_load_that_repeats_is_labelled_by_its_attractors() -> None:
    """A hanging pendulum with a weak torque: one periodic motion, of the linear amplitude nearly."""
    import sympy

    q = fm.angles("q")
    mechanism = fm.Mechanism(
        q,
        points={"M": (sympy.sin(q), -sympy.cos(q))},
        masses={"M": 1.0},
        dampers=[fm.TorsionDamper(q, 0.5)],
        forces=[fm.Torque(q, fm.loads.Harmonic(0.01, 2.0))],
        gravity=9.81,
        name="shaken",
    )
    found = fm.find_attractors(mechanism, {"q": (-3.0, 3.0), "q_dot": (-2.0, 2.0)}, 300)
    assert [one.forcing_periods for one in found] == [1]
    labels = fm.label_starts(mechanism, [[0.1, 0.0], [2.0, -1.0]])
    assert labels.counts["captured"] == 2
    # x = Re(A e^(i 2 t)) with A = -0.01 i / (9.81 - 4 + i), at t = 0.
    assert found[0].points[0, 0] == pytest.approx((-0.01j / (9.81 - 4.0 + 1.0j)).real, rel=1e-4)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"period": None}, "period: missing"),
        ({"period": -1.0}, "period"),
        ({"period": lambda omega: omega}, "'omega', which is no parameter"),
        ({"angles": ["z"]}, "angles: 'z' is no state"),
        ({"angles": "x"}, "angles = 'x': must be a list of different Python names$"),
    ],
)
def test_wrong_systems_get_one_line(change: dict[str, object], message: str) -> None:
    given: dict[str, object] = {"period": 1.0, "angles": (), **change}

    def call() -> None:
        system: Any = fm.System(duffing, ["x", "x_dot"], {"delta": 0.1, "A": 0.1}, **given)  # type: ignore
        fm.find_attractors(system, {"x": (-1.0, 1.0)}, 10)

    with pytest.raises(fm.InputError, match=message) as error:
        call()
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("starts", "message"),
    [
        ({"y": (0.0, 1.0)}, "ranges.y: unknown name"),
        ({"x": (1.0, 0.0)}, "must be"),
        ([[0.0, 1.0, 2.0]], "must be"),
        ([[np.nan, 0.0]], "none is finite"),
        ({}, "starts: all 10,000 are the same; give a range"),
        ({"x": 1.0}, "starts: all 10,000 are the same; give a range"),
    ],
)
def test_wrong_starts_get_one_line(starts: object, message: str) -> None:
    with pytest.raises(fm.InputError, match=message):
        fm.find_attractors(DUFFING, starts)  # type: ignore[arg-type]


def test_chaos_that_fills_cells_slowly_is_found() -> None:
    """Lorenz's attractor of 1963 has the largest exponent 0.9056 (Sprott 2003)."""
    system = LORENZ.replace(sigma=10.0, r=28.0, b=8.0 / 3.0)
    found = fm.find_attractors(system, {"x": (-15.0, 15.0), "y": (-15.0, 15.0), "z": (5.0, 40.0)}, 100)
    assert [one.kind for one in found] == ["chaos"]
    assert abs(found[0].exponent - 0.9056) < 3.0 * found[0].exponent_error


def test_what_nothing_attracts_is_refused() -> None:
    swing = fm.System(lambda t, x, v: (v, -fm.sin(x)), ["x", "v"], {}, angles=["x"])
    with pytest.raises(fm.InputError, match="preserves volume"):
        fm.find_attractors(swing, {"x": (-3.0, 3.0), "v": (-1.0, 1.0)}, 50)


def test_a_place_that_is_approached_ever_more_slowly_is_a_fixed_point() -> None:
    """x' = -x^3 comes to rest like t^(-1/2)."""
    slow = fm.System(lambda t, x: (-x * x * x,), ["x"], {})
    for reach, n in ((3.0, 200), (2.0, 1000)):
        found = fm.find_attractors(slow, {"x": (-reach, reach)}, n, seed=1)
        assert [one.kind for one in found] == ["fixed point"]
        assert found.counts["captured"] == n


def beside_a_pitchfork(t, x, y, mu):  # type: ignore[no-untyped-def]
    return mu * x - x * x * x, -y + fm.cos(t)


@pytest.mark.parametrize("mu", [3e-3, 1e-3, 1e-5])
def test_attractors_that_lie_close_and_attract_slowly_are_told_apart(mu: float) -> None:
    """mu x - x^3 keeps x's sign and is zero at -+ sqrt(mu); y, which settles fast, hides nothing of it."""
    system = fm.System(beside_a_pitchfork, ["x", "y"], {"mu": mu}, period=2.0 * math.pi)
    starts = fm.samplers.Uniform({"x": (-2.0, 2.0), "y": (-1.0, 1.0)}).draw(100, ("x", "y"), seed=1)
    found = fm.find_attractors(system, starts)
    assert [(one.kind, one.forcing_periods) for one in found] == [("periodic", 1)] * 2
    places = np.array([one.points[0, 0] for one in found])
    np.testing.assert_allclose(np.sort(places), [-math.sqrt(mu), math.sqrt(mu)], rtol=1e-3)
    assert (found.label >= 0).all()
    np.testing.assert_array_equal(np.sign(places[found.label]), np.sign(starts[:, 0]))


@pytest.mark.slow
def test_a_saddle_that_motions_leave_ever_so_slowly_is_no_attractor() -> None:
    """x' = 1e-5 (x - x^3) keeps its sign and leaves 0, beside a y that settles at once."""
    system = fm.System(lambda t, x, y: (1e-5 * (x - x**3), -10.0 * y), ["x", "y"], {})
    starts = np.random.default_rng(1).uniform(-1.0, 1.0, (60, 2))
    found = fm.find_attractors(system, starts)
    places = np.array([one.points[0, 0] for one in found])
    np.testing.assert_allclose(np.sort(places), [-1.0, 1.0], rtol=1e-9)
    ended = found.label >= 0
    assert ended.mean() > 0.5  # the others are undecided
    np.testing.assert_array_equal(np.sign(places[found.label[ended]]), np.sign(starts[ended, 0]))


def test_places_of_rest_that_motions_creep_to_are_not_listed_twice() -> None:
    """x' = 1e-6 x - x^3: two places, each of half the starts by symmetry."""
    system = fm.System(lambda t, x: (1e-6 * x - x * x * x,), ["x"], {})
    starts = np.linspace(-2.0, 2.0, 50)[:, None]
    found = fm.find_attractors(system, starts)
    assert [one.proof is not None for one in found] == [True, True]
    places = np.array([one.points[0, 0] for one in found])
    assert (found.label >= 0).all()
    np.testing.assert_array_equal(np.sign(places[found.label]), np.sign(starts[:, 0]))


@pytest.mark.slow
def test_places_to_which_motions_creep_are_told_from_places_that_they_pass() -> None:
    """-(x^4 + 1e-9) (x + 1) is zero at -1 alone: motions need 1e7 s to pass 0. y pushes u' = -u^5 aside."""
    (rest,) = found = fm.find_attractors(
        fm.System(lambda t, x: (-(x * x * x * x + 1e-9) * (x + 1.0),), ["x"], {}), [[0.9], [0.3], [-0.5]]
    )
    np.testing.assert_allclose(rest.points, [[-1.0]], atol=1e-12)
    assert set(found.label.tolist()) <= {0, -1}
    assert found.label[2] == 0

    def creeping(t, x, y):  # type: ignore[no-untyped-def]
        return -x * x * x * x * x + 0.1 * y, -y

    (rest,) = fm.find_attractors(fm.System(creeping, ["x", "y"], {}), {"x": (-1, 1), "y": (-1, 1)}, 12)
    assert (rest.kind, rest.found) == ("fixed point", 12)


@pytest.mark.parametrize("m", [0.0, -1e-6])
def test_a_spiral_that_draws_in_by_a_power_of_time_is_a_fixed_point(m: float) -> None:
    """r' = m r - r^3: r falls to half when the time is four times as long."""
    (rest,) = found = fm.find_attractors(HOPF.replace(m=m), {"x": (-2.0, 2.0), "y": (-2.0, 2.0)}, 60)
    assert (rest.kind, rest.found, bool(rest.proof)) == ("fixed point", 60, m < 0.0)
    np.testing.assert_allclose(rest.points, 0.0, atol=1e-9)
    again = found.label_starts(np.array([[1.9, -1.9], [0.01, 0.0]]))
    assert (again.label == 0).all()


def test_what_draws_in_by_a_power_of_time_is_told_from_a_torus() -> None:
    t = 200.0 * np.arange(1.0, 2.0, 1e-3)[:, None]
    angle = t + np.array([0.0, 1.0, 2.0])
    circles = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    flow = flow_of(fm.System(lambda t, x, y: (-x, -y), ["x", "y"], {}), np.eye(2), {})
    for power in (0.125, 0.25, 0.5, 1.0):
        assert shrink(flow, t[..., None] ** -power * circles)
    assert not shrink(flow, circles * (1.0 + 0.5 * np.cos(0.1 * np.sqrt(2.0) * angle))[..., None])


def relaxation(mu: float) -> float:
    """Period [s] of van der Pol's equation with a large mu, but for terms of log(mu) / mu (Dorodnitsyn)."""
    return float((3.0 - 2.0 * np.log(2.0)) * mu + 7.0143 * mu ** (-1.0 / 3.0))


def test_relaxation_takes_steps_that_its_motion_needs() -> None:
    """Beside the jumps the balls are at fault, and no shorter steps help."""
    (cycle,) = found = fm.find_attractors(VAN_DER_POL.replace(mu=100.0), {"x": (-2, 2), "v": (-2, 2)}, 20)
    assert cycle.found == 20
    assert cycle.period == pytest.approx(relaxation(100.0), abs=0.15)
    assert found.looks / found.dt < 4096


@pytest.mark.slow
def test_a_drift_whose_end_is_not_seen_is_no_attractor() -> None:
    found = fm.find_attractors(VAN_DER_POL.replace(mu=1000.0), {"x": (-2, 2), "v": (-2, 2)}, 8)
    assert all(one.period == pytest.approx(relaxation(1000.0), abs=0.15) for one in found)
    t = np.linspace(0.0, 1.0, 4001)[:, None]
    phase = 2.0 * np.pi * (100.0 * np.sqrt(2.0) * t + np.array([0.0, 0.3]))
    flow = flow_of(fm.System(lambda t, x, y: (-x, -y), ["x", "y"], {}), np.eye(2), {})
    for size in (1.0, 1e-3):
        for drift in (t, t * t, np.sqrt(t)):
            for fast in (0.0, np.sin(phase)):
                assert not recur(flow, size * np.stack([fast + 0.0 * phase, drift + 0.0 * phase], axis=-1))
        slowly = np.sin(0.02 * np.sqrt(3.0) * phase)
        assert recur(flow, size * np.stack([np.sin(phase), slowly], axis=-1))


@pytest.mark.slow
def test_motions_on_circles_of_phases() -> None:
    """x' = a - cos x goes round in 2 pi / sqrt(a^2 - 1); two phases of which neither waits fill a torus."""

    def turning(t, x, a):  # type: ignore[no-untyped-def]
        return (a - fm.cos(x),)

    for a in (2.0, 1.001):
        (cycle,) = fm.find_attractors(fm.System(turning, ["x"], {"a": a}, angles=["x"]), {"x": (-3, 3)}, 20)
        assert (cycle.kind, cycle.found) == ("periodic", 20)
        assert cycle.period == pytest.approx(2.0 * math.pi / math.sqrt(a * a - 1.0), rel=1e-8)

    def phases(t, x, y):  # type: ignore[no-untyped-def]
        return 1.0 - 0.5 * fm.cos(x), 1.2 + 0.3 * fm.cos(y)

    system = fm.System(phases, ["x", "y"], {}, angles=["x", "y"])
    (torus,) = fm.find_attractors(system, {"x": (-3, 3), "y": (-3, 3)}, 20)
    assert (torus.kind, torus.found) == ("torus", 20)


def test_neutral_cycles_side_by_side_are_one_attractor() -> None:
    """Two van der Pol oscillators that know nothing of each other have a torus full of cycles of 6.66328686 s
    (Andersen and Geer 1982); x'' = -x has circles of all sizes, 2 pi s long."""

    def two(t, x, v, y, w):  # type: ignore[no-untyped-def]
        return v, (1.0 - x * x) * v - x, w, (1.0 - y * y) * w - y

    def circles(t, x, v, z):  # type: ignore[no-untyped-def]
        return v, -x, -z

    for rhs, names, kind, period in (
        (two, "xvyw", "torus", 6.66328685931),
        (circles, "xvz", "continuum", 2.0 * math.pi),
    ):
        found = fm.find_attractors(fm.System(rhs, list(names), {}), dict.fromkeys(names, (-3.0, 3.0)), 80)
        assert [one.kind for one in found] == [kind]
        assert found[0].found >= 79
        assert found[0].period == pytest.approx(period, rel=1e-8)
        assert f"{kind} of cycles, period 6." in str(found)


def test_predator_and_prey_come_to_rest_without_a_warning() -> None:
    def rates(t, x, y):  # type: ignore[no-untyped-def]
        return x * (1.0 - x / 2.0) - x * y / (1.0 + x), 0.5 * y * (2.0 * x / (1.0 + x) - 1.0)

    (rest,) = fm.find_attractors(fm.System(rates, ["x", "y"], {}), {"x": (0.01, 4), "y": (0.01, 3)}, 50)
    np.testing.assert_allclose(rest.points, [[1.0, 1.0]], atol=1e-9)


@pytest.mark.slow
def test_saddles_that_motions_linger_at_are_no_attractors() -> None:
    """May and Leonard's three competitors, SIAM J. Appl. Math. 29 (1975) 243: they win in turn."""

    def competition(t, x, y, z, a, b):  # type: ignore[no-untyped-def]
        return x * (1.0 - x - a * y - b * z), y * (1.0 - b * x - y - a * z), z * (1.0 - a * x - b * y - z)

    system = fm.System(competition, ["x", "y", "z"], {"a": 0.8, "b": 1.5})
    ranges = dict.fromkeys(system.state, (0.01, 1.0))
    found = fm.find_attractors(system, ranges, 40)
    assert not len(found)
    assert found.counts["undecided"] == 40
    settled = fm.find_attractors(system.replace(b=1.1), ranges, 40)  # a + b < 2: they live together
    assert [one.kind for one in settled] == ["fixed point"]
    np.testing.assert_allclose(settled[0].points[0], 1.0 / 2.9, rtol=1e-9)


def test_a_figure_eight_about_a_saddle_is_a_saddle_cycle() -> None:
    """H = y^2/2 - x^2/2 + x^4/4 goes to 0, as H' = -H |grad H|^2 / 2: on the ways out of the saddle."""

    def eight(t, x, y):  # type: ignore[no-untyped-def]
        push = 0.5 * (0.5 * y * y - 0.5 * x * x + 0.25 * x * x * x * x)
        return y - push * (x * x * x - x), x - x * x * x - push * y

    (one,) = found = fm.find_attractors(
        fm.System(eight, ["x", "y"], {}), {"x": (-1.5, 1.5), "y": (-1.0, 1.0)}, 8
    )
    assert (one.kind, one.found) == ("saddle cycle", 8)
    x, y = one.points.T
    assert np.abs(0.5 * y**2 - 0.5 * x**2 + 0.25 * x**4).max() < 1e-3
    assert "1/s over the time looked at" in found[0].told()


def test_fixed_points_side_by_side_are_one_attractor() -> None:
    """A sliding body with friction, x_end = x + v / d; epidemics, Kermack and McKendrick's final size."""

    def sliding(t, x, v, d):  # type: ignore[no-untyped-def]
        return v, -d * v

    found = fm.find_attractors(fm.System(sliding, ["x", "v"], {"d": 1.0}), {"x": (-1, 1), "v": (-1, 1)}, 300)
    assert [one.kind for one in found] == ["continuum"]
    assert found.counts["captured"] > 295

    def epidemic(t, s, i, b, g):  # type: ignore[no-untyped-def]
        return -b * s * i, b * s * i - g * i

    system = fm.System(epidemic, ["s", "i"], {"b": 2.0, "g": 1.0})
    found = fm.find_attractors(system, {"s": (0.0, 1.0), "i": (0.0, 1.0)}, 300)
    assert [one.kind for one in found] == ["continuum"]
    assert found.counts["captured"] > 295
    assert found[0].points[:, 0].max() < 0.5  # below g / b


@pytest.mark.slow
def test_twisted_states_of_a_ring_are_told_apart() -> None:
    """Each is a continuum, as all may turn; by winding numbers (Wiley, Strogatz, Girvan, Chaos 16 (2006))."""

    def ring(t, a, b, c, d, e):  # type: ignore[no-untyped-def]
        return (
            fm.sin(b - a) + fm.sin(e - a),
            fm.sin(c - b) + fm.sin(a - b),
            fm.sin(d - c) + fm.sin(b - c),
            fm.sin(e - d) + fm.sin(c - d),
            fm.sin(a - e) + fm.sin(d - e),
        )

    system = fm.System(ring, list("abcde"), {}, angles=list("abcde"))
    starts = fm.samplers.Uniform(dict.fromkeys("abcde", (-3.14, 3.14)), n=96)
    found = fm.find_attractors(system, starts)
    end = fm.integrate(system, starts, 200.0, 0.05).y[0]
    steps = np.diff(end, axis=1, append=end[:, :1])
    turns = np.rint((steps - 2.0 * np.pi * np.rint(steps / (2.0 * np.pi))).sum(axis=1) / (2.0 * np.pi))
    assert [one.kind for one in found] == ["continuum"] * 3
    for label in range(3):
        assert np.unique(turns[found.label == label]).size == 1
    assert found.counts["captured"] > 90


def test_the_smallest_shock_out_of_a_place_of_rest_reaches_the_saddle_s_manifold() -> None:
    """Measures take attractors for labels; the boundary is the stable manifold of the saddle, by SciPy."""
    found = fm.find_attractors(PENDULUM, {"x": (-2.6, 3.6), "x_dot": (-10.0, 10.0)}, 500)
    rest, saddle = np.array([math.pi / 6.0, 0.0]), np.array([5.0 * math.pi / 6.0, 0.0])
    shock = fm.minimal_shock(found, rest, np.eye(2), most=3.0)
    slow = np.roots([1.0, 0.1, -math.cos(math.pi / 6.0)]).min()  # x'' = -0.1 x' + cos(pi / 6) x
    distance = np.inf
    for side in (1e-6, -1e-6):
        back = solve_ivp(
            lambda t, y: -np.array(pendulum(t, *y, 0.1, 0.5, 1.0)), (0.0, 25.0),
            saddle + side * np.array([1.0, slow]), rtol=1e-10, atol=1e-12, max_step=0.002,
        )  # fmt: skip
        away = back.y.T - rest
        away[:, 0] -= 2.0 * math.pi * np.round(away[:, 0] / (2.0 * math.pi))
        distance = min(distance, float(np.linalg.norm(away, axis=1).min()))
    assert shock.size == pytest.approx(distance, abs=2e-3)


def test_escape_is_an_end_as_attractors_are() -> None:
    """x'' = -0.2 x' - x + x^3: beyond the stable manifolds of the saddles at +-1, by SciPy, they escape."""
    well = fm.System(lambda t, x, v: (v, -0.2 * v - x + x * x * x), ["x", "v"], {})
    region = {"x": (-1.5, 1.5), "v": (-1.0, 1.0)}
    found = fm.find_attractors(well, region, 300)
    assert found.counts["escaped"] > 100
    _, shares = fm.basin_fractions(found)
    assert shares.missing == 0
    np.testing.assert_allclose(shares.at_most, found.fractions)
    slow = np.roots([1.0, 0.2, -2.0]).min()
    back = solve_ivp(
        lambda t, y: [-y[1], 0.2 * y[1] + y[0] - y[0] ** 3], (0.0, 25.0),
        np.array([1.0, 0.0]) - 1e-6 * np.array([1.0, slow]), rtol=1e-10, atol=1e-12, max_step=0.002,
    )  # fmt: skip
    shock = fm.minimal_shock(found, np.zeros(2), np.eye(2), most=3.0)
    assert shock.size == pytest.approx(float(np.linalg.norm(back.y, axis=0).min()), abs=2e-3)
    assert "gone for good" in str(shock)
    edge = fm.track_edge(well, [0.0, 0.0], [1.5, 1.0], found, np.eye(2), t_end=40.0, dt=0.02)
    np.testing.assert_allclose(edge.state, [1.0, 0.0], atol=1e-6)
    axes = {name: np.linspace(*ends, 65) for name, ends in region.items()}
    assert fm.boundary_dimension(fm.map_basins(well, axes)).dimension == pytest.approx(1.0, abs=0.1)


def driven(t, x, v, F, w):  # type: ignore[no-untyped-def]
    return v, -0.1 * v - fm.sin(x) + F * fm.cos(w * t)


def test_chaos_that_passes_with_one_end_leaves_nothing_unsure() -> None:
    """Runs with different steps part in transient chaos; Runge and Kutta's method shows where all end."""
    period, n = 2.0 * np.pi / 0.7, 100
    system = fm.System(driven, ["x", "v"], {"F": 0.5, "w": 0.7}, period=period, angles=["x"])
    starts = fm.samplers.Uniform({"x": (-np.pi, np.pi), "v": (-3.0, 3.0)}).draw(n, ("x", "v"))
    found = fm.find_attractors(system, starts)
    assert found.counts["captured"] == n
    assert np.isfinite(found.time).all()
    again = found.label_starts(starts)
    assert (again.status == found.status).all()
    np.testing.assert_array_equal(again.time, found.time)
    few = fm.find_attractors(system, starts[:12])  # of which not many come apart
    assert (few.label_starts(starts).label == 0).all()

    def rates(t: float, y: Any) -> Any:
        return np.array([y[1], -0.1 * y[1] - np.sin(y[0]) + 0.5 * np.cos(0.7 * t)])

    y, dt = starts.T.copy(), period / 60
    for k in range(60 * 600):
        t = k * dt
        a = rates(t, y)
        b = rates(t + dt / 2, y + dt / 2 * a)
        c = rates(t + dt / 2, y + dt / 2 * b)
        y += dt / 6 * (a + 2 * b + 2 * c + rates(t + dt, y + dt * c))
    away = y - found[0].points.T
    away[0] -= 2.0 * np.pi * np.round(away[0] / (2.0 * np.pi))
    assert (np.abs(away).max(axis=0) < 1e-3).mean() > 0.9  # the rest is still in chaos


@pytest.mark.slow
def test_intervals_of_shares_count_the_unsure_as_none_and_as_all() -> None:
    """Transient chaos that may end in any well of a driven pendulum whose turns are counted."""
    system = fm.System(driven, ["x", "v"], {"F": 0.5, "w": 0.7}, period=2.0 * np.pi / 0.7)
    found = fm.find_attractors(system, {"x": (-np.pi, np.pi), "v": (-3.0, 3.0)}, n=100)
    unsure = found.counts["unsure"] + found.counts["undecided"]
    assert unsure > 10
    low, high = fm.wilson(found[0].found, 100)[0], fm.wilson(found[0].found + unsure, 100)[1]
    assert f"({float(low):.4f} to {float(high):.4f})" in str(found)
    assert fm.basin_fractions(found)[1].missing == 100 - sum(one.found for one in found)


@pytest.mark.parametrize("damping", [7.0, 50.0])
def test_motions_that_begin_at_rest_and_creep_have_not_escaped(damping: float) -> None:
    """Rates stay near nothing: what goes far is judged by what motions went through, in all states."""

    def creeping(t, x, v, b):  # type: ignore[no-untyped-def]
        return v, -b * v + x - x * x * x

    starts = np.stack([np.linspace(-2.0, 2.0, 20), np.zeros(20)], axis=1)
    found = fm.find_attractors(fm.System(creeping, ["x", "v"], {"b": damping}), starts)
    own = np.array([found[label].points[0, 0] for label in found.label])
    np.testing.assert_allclose(own, np.sign(starts[:, 0]), atol=1e-9)


def test_a_start_far_away_does_not_change_its_neighbours_label() -> None:
    damped = fm.System(lambda t, x, v: (v, -0.3 * v - fm.sin(x)), ["x", "v"], {}, angles=["x"])
    for starts in ([[0.3, 0.0]], [[0.3, 0.0], [25.0, 0.0]]):
        found = fm.find_attractors(damped, np.array(starts))
        assert (found.status == Status.CAPTURED).all()


@pytest.mark.parametrize("omega", [0.02, 0.1])
def test_steps_too_long_for_a_slow_load_send_nothing_away(omega: float) -> None:
    """A damped oscillator in two wells is bounded; ends of some starts as SciPy has them."""

    def slow(t, x, v, w):  # type: ignore[no-untyped-def]
        return v, -0.2 * v + x - x * x * x + 0.3 * fm.cos(w * t)

    system = fm.System(slow, ["x", "v"], {"w": omega}, period=lambda w: 2.0 * math.pi / w)
    starts = fm.samplers.Uniform({"x": (-3.0, 3.0), "v": (-3.0, 3.0)}).draw(20, ("x", "v"))
    found = fm.find_attractors(system, starts)
    assert (found.status == Status.CAPTURED).all()
    for k in range(3):
        run = solve_ivp(
            lambda t, y: [y[1], -0.2 * y[1] + y[0] - y[0] ** 3 + 0.3 * np.cos(omega * t)],
            (0.0, 5.0 * 2.0 * math.pi / omega), starts[k], method="DOP853", rtol=1e-11, atol=1e-12,
        )  # fmt: skip
        np.testing.assert_allclose(found[found.label[k]].points[0], run.y[:, -1], atol=1e-6)


@pytest.mark.slow
def test_a_chaotic_transient_is_no_chaos() -> None:
    """Below r = 24.06 all motions come to rest, after a thousand seconds at 23.5 (Yorke and Yorke 1979)."""
    system = LORENZ.replace(sigma=10.0, r=23.5, b=8.0 / 3.0)
    found = fm.find_attractors(system, {"x": (-20.0, 20.0), "y": (-25.0, 25.0), "z": (0.0, 45.0)}, 100)
    assert {one.kind for one in found} == {"fixed point"}


@pytest.mark.parametrize("m", [1e-3, 3e-3])
def test_a_cycle_that_attracts_slowly_is_no_torus(m: float) -> None:
    """Of r' = m r - r^3: radius sqrt(m), multiplier exp(-4 pi m)."""
    (cycle,) = fm.find_attractors(HOPF.replace(m=m), {"x": (-1.5, 1.5), "y": (-1.5, 1.5)}, 50)
    assert cycle.period == pytest.approx(2.0 * math.pi, rel=1e-9)
    assert cycle.multipliers == pytest.approx(math.exp(-4.0 * math.pi * m), rel=1e-6)
    assert cycle.exponent == cycle.exponent_error == 0.0


def test_a_cycle_of_many_turns_is_found_once() -> None:
    """Roessler's system with a = b = 0.2 after several doublings."""

    def roessler(t, x, y, z, c):  # type: ignore[no-untyped-def]
        return -y - z, x + 0.2 * y, 0.2 + z * (x - c)

    ranges = {"x": (-5.0, 5.0), "y": (-5.0, 5.0), "z": (0.0, 2.0)}
    (cycle,) = fm.find_attractors(fm.System(roessler, ["x", "y", "z"], {"c": 4.2}), ranges, 60)
    assert cycle.kind == "periodic"
    run = solve_ivp(
        lambda t, y: [-y[1] - y[2], y[0] + 0.2 * y[1], 0.2 + y[2] * (y[0] - 4.2)], (0.0, cycle.period),
        cycle.points[0], method="DOP853", rtol=1e-12, atol=1e-12,
    )  # fmt: skip
    np.testing.assert_allclose(run.y[:, -1], cycle.points[0], atol=1e-7)


def test_a_stopping_condition_ends_motions_that_leave() -> None:
    def escape(t, x, v, F):  # type: ignore[no-untyped-def]
        return v, -0.1 * v - x + x * x + F * fm.sin(0.85 * t)

    ranges, period = {"x": (-0.8, 1.2), "v": (-0.8, 0.8)}, 2.0 * math.pi / 0.85
    free = fm.find_attractors(fm.System(escape, ["x", "v"], {"F": 0.05}, period=period), ranges, 200)
    ended = fm.find_attractors(
        fm.System(escape, ["x", "v"], {"F": 0.05}, lambda t, x, v: x > 2.0, period=period), ranges, 200
    )
    np.testing.assert_array_equal(free.status, ended.status)
    np.testing.assert_array_equal(free.label, ended.label)
    assert {"captured", "escaped"} == {name for name, count in ended.counts.items() if count}


def test_plates_that_pull_each_other_in_need_an_end_before_they_touch() -> None:
    """x'' = -0.3 x' - x + V^2 / (1 - x)^2, V = 0.2 + 0.05 cos 0.9 t; who gets beyond 0.9 is SciPy's."""

    def rates(t, x, v):  # type: ignore[no-untyped-def]
        V = 0.2 + 0.05 * fm.cos(0.9 * t)
        return v, -0.3 * v - x + V * V / ((1.0 - x) * (1.0 - x))

    def touches(t, y):  # type: ignore[no-untyped-def]
        return y[0] - 0.9

    touches.terminal = True  # type: ignore[attr-defined]
    starts, period = np.random.default_rng(0).uniform((-0.3, -0.6), (0.85, 0.6), (40, 2)), 2.0 * np.pi / 0.9
    with pytest.raises(
        fm.InputError, match=r"infinite somewhere end motions before by System\(stop=\.\.\.\)$"
    ):
        fm.find_attractors(fm.System(rates, ["x", "v"], {}, period=period), starts)
    ended = fm.System(rates, ["x", "v"], {}, lambda t, x, v: x > 0.9, period=period)
    found = fm.find_attractors(ended, starts)
    ends = [solve_ivp(lambda t, y: rates(t, *y), (0.0, 60.0), y, rtol=1e-8, events=touches) for y in starts]
    pulled = np.array([one.status == 1 for one in ends])
    assert 2 < pulled.sum() < 20
    assert len(found) == 1
    np.testing.assert_array_equal(found.label, np.where(pulled, -1, 0))
    assert found.counts["escaped"] == pulled.sum()


def test_a_stop_within_a_ball_ends_motions_that_the_ball_would_attract() -> None:
    """x'' + 0.2 x' + x = 0 swings beyond 0.8 before it comes to rest, by its closed form."""
    system = fm.System(
        lambda t, x, v: (v, -x - 0.2 * v), ["x", "v"], {}, stop=lambda t, x, v: 1.0 if x > 0.8 else 0.0
    )
    starts = np.random.default_rng(0).uniform([-1.0, -1.0], [0.7, 1.0], (200, 2))
    t = np.linspace(0.0, 7.0, 7001)[:, None]
    w = math.sqrt(0.99)
    x, v = starts.T
    largest = (np.exp(-0.1 * t) * (x * np.cos(w * t) + (v + 0.1 * x) / w * np.sin(w * t))).max(axis=0)
    clear = np.abs(largest - 0.8) > 5e-3
    found = fm.find_attractors(system, starts)
    np.testing.assert_array_equal((found.status == fm.Status.ESCAPED)[clear], (largest > 0.8)[clear])


def test_starts_that_lie_close_together_in_one_state_are_labelled() -> None:
    """They move a thousand times as far within a period; where they end is SciPy's."""

    def rates(t, x, v):  # type: ignore[no-untyped-def]
        return v, -0.1 * v - x + x * x + 0.06 * fm.cos(0.85 * t)

    period = 2.0 * math.pi / 0.85
    share = np.linspace(0.0, 1.0, 7)[:, None]
    starts = np.concatenate(
        [[-0.0547, 0.5928] + share * [-4e-5, 1e-3], [-0.0783, 0.5926] + share * [-3e-4, 1e-3]]
    )
    found = fm.find_attractors(fm.System(rates, ["x", "v"], {}, period=period), starts)
    ends = [
        solve_ivp(lambda t, y: rates(t, *y), (0.0, 40.0 * period), y, "DOP853", rtol=1e-10, atol=1e-12).y[
            :, -1
        ]
        for y in starts
    ]
    places = np.array([one.points[0] for one in found])
    away = np.abs(np.array(ends)[:, None] - places).max(axis=2)
    assert away.min(axis=1).max() < 1e-3
    np.testing.assert_array_equal(found.label, np.argmin(away, axis=1))


def test_motions_of_a_mechanism_that_leave_a_range_are_out_of_range() -> None:
    """A mass on a spring under a harmonic force, by its closed form: who ever comes beyond 1."""
    import sympy

    x = fm.lengths("x", -1.0, 1.0)
    mechanism = fm.Mechanism(
        x,
        {"F": 1.0},
        points={"M": (x, 0), "O": (0, 0)},
        masses={"M": 1.0},
        potential=2.0 * x**2,
        dissipation=0.1 * x.dot**2,
        forces=[fm.Force("M", fm.loads.Harmonic(sympy.Symbol("F"), 4.0), (1, 0))],
        name="mass within walls",
    )
    starts = np.random.default_rng(0).uniform([-0.99, -3.0], [0.99, 3.0], (200, 2))
    t = np.linspace(0.0, 40.0, 40_001)

    def largest(F: float) -> Floats:
        forced = F / (4.0 - 16.0 + 0.8j)  # x'' + 0.2 x' + 4 x = F sin 4 t
        w, x, v = math.sqrt(3.99), starts[:, 0] - forced.imag, starts[:, 1] - 4.0 * forced.real
        free = x[:, None] * np.cos(w * t) + ((v + 0.1 * x) / w)[:, None] * np.sin(w * t)
        return np.abs(np.exp(-0.1 * t) * free + (forced * np.exp(4j * t)).imag).max(axis=1)

    for F, number in ((1.0, 1), (13.0, 0)):  # the amplitude is F / 12.03
        found = fm.find_attractors(mechanism.replace(F=F), starts)
        most = largest(F)
        clear = np.abs(most - 1.0) > 5e-3
        out = found.status == fm.Status.OUT_OF_RANGE
        np.testing.assert_array_equal(out[clear], (most > 1.0)[clear])
        assert len(found) == number
        assert found.counts["captured"] + found.counts["out_of_range"] == 200
    along = fm.follow_basins(mechanism, "F", [3.0, 13.0], {"x": (-0.1, 0.1)}, 20)
    (end,) = along.tipping
    assert end.kind == "dies"
    assert end.low - 1e-3 < math.hypot(12.0, 0.8) < end.high + 1e-3 < end.low + 0.01


@pytest.mark.parametrize(
    ("system", "ranges"),
    [
        (fm.System(lambda t, x, y: (x * (1.0 - y), y * (x - 1.0)), ["x", "y"], {}), (0.2, 3.0)),
        (fm.System(lambda t, x, y, z: (y, -x + y * z, 1.0 - y * y), ["x", "y", "z"], {}), (-2.0, 2.0)),
    ],
    ids=["Lotka-Volterra", "Nose-Hoover"],
)
def test_what_keeps_volume_in_the_long_run_is_refused(system: fm.System, ranges: Any) -> None:
    """These equations shrink volume here and swell it there."""
    with pytest.raises(fm.InputError, match="preserves volume"):
        fm.find_attractors(system, dict.fromkeys(system.state, ranges), 50)


def test_a_period_after_which_nothing_repeats_is_refused() -> None:
    values = {"delta": 0.2, "A": 0.3}
    system = fm.System(duffing, ["x", "x_dot"], values, period=math.pi)
    with pytest.raises(fm.InputError, match=r"period = 3\.14159: the right-hand side does not repeat"):
        fm.find_attractors(system, {"x": (-1.0, 1.0)}, 50)


def test_angles_in_degrees_get_a_line_wherever_they_are_given() -> None:
    grid = {"x": np.linspace(-180.0, 180.0, 4), "x_dot": [0.0, 1.0]}
    with pytest.raises(fm.InputError, match=r"axes\.x: reaches 180, beyond 4 turns; angles are in radians"):
        fm.map_basins(PENDULUM, grid)
    with pytest.raises(fm.InputError, match=r"fixed\.x: reaches 90, beyond 4 turns"):
        fm.map_basins(PENDULUM, {"x_dot": [0.0, 1.0]}, fixed={"x": 90.0})
    with pytest.warns(UserWarning, match="starts: reaches 90, beyond 4 turns"):
        fm.label_starts(PENDULUM, [[90.0, 0.0]])
    with pytest.warns(UserWarning, match=r"starts: reaches 1[0-9.]+, beyond 4 turns"):
        fm.find_attractors(PENDULUM, {"x": (-180.0, 180.0)}, 40)
    chain = fm.mechanisms.pendulum_chain(1)
    name = chain.state[0]
    with pytest.raises(fm.InputError, match=rf"axes\.{name}: reaches 180, beyond 4 turns"):
        fm.map_basins(chain, {name: [-180.0, 180.0]})


@pytest.mark.slow
def test_exponents_of_strongly_damped_motion() -> None:
    """Decay of exp(-63) in a period, of exp(-63) about a focus, and of x' = -x^5, which has none."""

    def driven(t, x):  # type: ignore[no-untyped-def]
        return (-10.0 * x + fm.cos(t),)

    def focus(t, x, y):  # type: ignore[no-untyped-def]
        return -x - 0.05 * y, 0.05 * x - y

    def quintic(t, x):  # type: ignore[no-untyped-def]
        return (-x * x * x * x * x,)

    cases: list[tuple[Any, tuple[str, ...], float, float | None]] = [
        (driven, ("x",), -10.0, 2.0 * math.pi),
        (focus, ("x", "y"), -1.0, None),
        (quintic, ("x",), 0.0, None),
    ]
    for rhs, names, expected, period in cases:
        region = dict.fromkeys(names, (-1.0, 1.0))
        (one,) = fm.find_attractors(fm.System(rhs, names, {}, period=period), region, 40)
        assert abs(one.exponent - expected) <= 3.0 * one.exponent_error, rhs
        assert one.exponent_error < 1e-5, rhs
        assert one.found == 40, rhs
