"""Wells, labels and disturbances of any mechanism, against closed forms, floods, SciPy and ``Scene``."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import sympy
from devices import double_well, inverted_pendulum, plane
from scipy.integrate import DOP853, solve_ivp

import fastmech as fm
from fastmech.arrays import Floats
from fastmech.basins.shock_limit import impulse_start, shock_limit

TURN = 2.0 * np.pi

#: Scenes with one and two wells, a strong and a weak damper, and forces that fade.
SCENES = (
    {"F0": 85.3, "c1": 294.9, "c2": 92.85, "alpha": 0.0},
    {"F0": -150.0, "c1": 260.0, "c2": 60.0, "alpha": 0.0},
    {"F0": 85.3, "c1": 294.9, "c2": 92.85, "alpha": 0.0, "beta": 20.0},
    {"F0": 100.0, "c1": 294.9, "c2": 92.85, "alpha": 0.7},
    {},  # Table 1: its force still works when most motions are captured
)


def damped_chain(n: int) -> fm.Mechanism:
    """Pendulums of unit lengths and masses in a row, each with a damper in its joint."""
    q = [fm.angles(f"q{k + 1}") for k in range(n)]
    points, x, y = {}, 0, 0
    for k, angle in enumerate(q):
        x, y = x + sympy.sin(angle), y - sympy.cos(angle)
        points[f"M{k + 1}"] = x, y
    joints = [fm.TorsionDamper(q[0], 1), *(fm.TorsionDamper(b - a, 1) for a, b in pairwise(q))]
    masses = dict.fromkeys(points, 1)
    return fm.Mechanism(q, points=points, masses=masses, dampers=joints, gravity=9.81, name=f"damped_{n}")


@pytest.mark.parametrize("values", SCENES)
@pytest.mark.slow
def test_the_papers_mechanism_has_the_scenes_wells_barriers_and_labels(values: dict[str, float]) -> None:
    scene = fm.Scene(**values)
    mechanism = fm.mechanisms.slider_pendulum().replace(**values)
    rng = np.random.default_rng(5)
    angles, rates = rng.uniform(-np.pi, np.pi, (1500, 2)), rng.normal(0.0, 4.0, (1500, 2))
    starts = np.concatenate([angles, rates], axis=1)
    expected, found = fm.label_starts(scene, starts), fm.label_starts(mechanism, starts)
    np.testing.assert_allclose(found.tree.barrier, expected.tree.barrier, rtol=1e-10)
    np.testing.assert_allclose(found.tree.equilibria.energy, expected.tree.equilibria.energy, rtol=1e-10)
    both = (expected.well >= 0) & (found.well >= 0)
    assert (expected.well >= 0).sum() > 60
    if "beta" not in values:  # a strong damper's motions are told from their saddles with finer steps
        assert both[expected.well >= 0].all()
    assert both.sum() > 0.9 * (expected.well >= 0).sum()
    places, others = expected.tree.equilibria.position, found.tree.equilibria.position
    same = [np.abs(np.sin((others - place) / 2.0)).sum(axis=1).argmin() for place in places]
    assert (np.array(same)[expected.well] == found.well)[both].all()
    assert (expected.turns == found.turns)[both].all()


def end_of(mechanism: fm.Mechanism, start: np.ndarray, t_end: float) -> np.ndarray:
    """Where SciPy comes to."""

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate([y[len(y) // 2 :], mechanism.accelerations(t, y)])

    return np.asarray(solve_ivp(rates, (0.0, t_end), start, method="DOP853", rtol=1e-10, atol=1e-12).y[:, -1])


@pytest.mark.parametrize(
    "load",
    [
        fm.loads.Pulse(2.0, 1.0, 1.5),
        fm.loads.Decaying(3.0, 0.8),
        fm.loads.Ramp(0.2, 1.0, 4.0),
        fm.loads.Sampled([0.0, 1.0, 2.0, 5.0], [0.0, 2.0, -2.0, 0.0]),
    ],
    ids=lambda load: type(load).__name__,
)
def test_labels_under_loads_that_fade(load: object) -> None:
    mechanism = double_well(load)
    rng = np.random.default_rng(2)
    starts = rng.uniform([-2.0, -2.0], [2.0, 2.0], (300, 2))
    found = fm.label_starts(mechanism, starts)
    assert (found.well >= 0).mean() > 0.9
    places = found.tree.equilibria.position[:, 0]
    for start, well in zip(starts[:12], found.well[:12], strict=True):
        if well >= 0:
            assert abs(end_of(mechanism, start, 120.0)[0] - places[well]) < 1e-3


@pytest.mark.parametrize("n", [2, 3])
@pytest.mark.slow
def test_labels_of_chains_count_turns(n: int) -> None:
    chain = damped_chain(n)
    rng = np.random.default_rng(3)
    starts = np.concatenate([rng.uniform(-3.0, 3.0, (200, n)), rng.normal(0.0, 6.0, (200, n))], axis=1)
    found = fm.label_starts(chain, starts, 120.0)
    assert (found.well >= 0).mean() > 0.95
    assert np.abs(found.turns).max() > 0
    for start, well, turns in zip(starts[:8], found.well[:8], found.turns[:8], strict=True):
        if well >= 0:
            expected = found.tree.equilibria[int(well)].position + TURN * turns
            np.testing.assert_allclose(end_of(chain, start, 60.0)[:n], expected, atol=0.5)


def test_a_motion_that_leaves_its_range_says_so() -> None:
    found = fm.label_starts(double_well(reach=1.5), [[1.0, 3.0], [1.0, 0.1], [-1.0, -3.0]])
    assert [fm.Status(s).name for s in found.status] == ["OUT_OF_RANGE", "CAPTURED", "OUT_OF_RANGE"]
    assert found.well.tolist() == [-1, found.well[1], -1]
    assert found.counts["out_of_range"] == 2
    times = np.linspace(0.05, 5.0, 100)
    run = fm.integrate(double_well(reach=1.5), [[1.0, 3.0], [1.0, 0.1], [np.nan, 0.0]], t_eval=times)
    duffing = solve_ivp(lambda t, y: (y[1], y[0] - y[0] ** 3 - 0.2 * y[1]), (0, 5), [1, 3], t_eval=times)
    assert duffing.y[0].max() > 2.0
    assert abs(duffing.y[0, -1]) < 1.4  # back where it is described, and told all the same
    assert run.status.tolist() == [fm.Status.OUT_OF_RANGE, fm.Status.OK, fm.Status.START_NOT_FINITE]
    assert str(run).endswith("1 start_not_finite; 1 out of range")
    pushed = double_well(fm.loads.Pulse(8.0, 0.0, 2.0))  # out to 2.9 and back while the pulse acts
    assert fm.label_starts(pushed, [[1.0, 0.0]]).counts["captured"] == 1
    near = double_well(fm.loads.Pulse(8.0, 0.0, 2.0), reach=2.0)
    assert fm.label_starts(near, [[1.0, 0.0]]).counts["out_of_range"] == 1


def margins(rates: Callable[[Floats], Floats], starts: Floats, ranges: Floats, t_end: float) -> Floats:
    """By how much motions stay within their ranges by SciPy (n,), negative where they leave them."""
    n, shape = len(ranges), starts.T.shape
    step = 0.005  # in which parabolas are off by 1e-8
    run = DOP853(
        lambda t, y: rates(y.reshape(shape)).ravel(), 0.0, starts.T.ravel(), t_end, step, rtol=1e-9, atol=1e-9
    )
    least = np.full(len(starts), np.inf)
    while run.status == "running":
        q, v = run.y.reshape(shape)[:n], run.y.reshape(shape)[n:]
        run.step()
        end, now = run.y.reshape(shape)[:n], run.y.reshape(shape)[n:]
        with np.errstate(all="ignore"):
            turned = np.where(v * now < 0.0, 0.5 * (run.t - run.t_old) * v**2 / (v - now), 0.0)
        for at in (end, q + turned * (v > 0.0), q + turned * (v < 0.0)):
            least = np.minimum(least, np.minimum(at - ranges[:, :1], ranges[:, 1:] - at).min(axis=0))
    assert run.status == "finished"
    return least


def pendulum_rates(s: Floats) -> Floats:
    return np.stack([s[1], 9.81 * np.sin(s[0]) - 6.0 * (s[0] - 0.1) - 0.4 * s[1]])


def plane_rates(s: Floats) -> Floats:
    x, y, u, v = s
    return np.stack([u, v, 2 * x - 2 * x**3 - 2 * y - 0.3 * u, -2 * x - 16 * y - 0.3 * v])


@pytest.mark.parametrize(
    ("mechanism", "rates", "most"),
    [
        (inverted_pendulum(), pendulum_rates, [2.45, 5.0]),
        (inverted_pendulum(2.2), pendulum_rates, [0.1, 1.5]),  # off the saddle
        (plane(-2.0, 0.4, wells=True), plane_rates, [1.3, 0.35, 1.0, 1.5]),
        (plane(0.02, 2.0, wells=True), plane_rates, [1.6, 0.5, 1.5, 0.5]),  # to and beside the saddle
    ],
    ids=["pendulum", "off the saddle", "plane", "beside the saddle"],
)
def test_labels_see_excursions_beyond_a_range_within_a_step(
    mechanism: fm.Mechanism, rates: Callable[[Floats], Floats], most: list[float]
) -> None:
    low, high = -np.array(most), np.array(most)
    low[0] = max(low[0], mechanism.ranges[0, 0])
    starts = np.random.default_rng(8).uniform(low, high, (1500, len(high)))
    margin = margins(rates, starts, mechanism.ranges, 12.0)
    found = fm.label_starts(mechanism, starts, settle_radius=0.01)
    captured, left = found.status == fm.Status.CAPTURED, found.status == fm.Status.OUT_OF_RANGE
    known = np.abs(margin) > 1e-6
    assert (captured & known).sum() > 40
    assert (left & known).sum() > 40
    assert (captured | left).mean() > 0.99
    assert not (captured & known & (margin < 0.0)).any()
    assert not (left & known & (margin > 0.0)).any()
    assert found.settle_time is not None
    assert np.isfinite(found.settle_time[captured]).all()


def test_starts_beyond_a_range_have_no_label() -> None:
    """A range of an angle that does not turn, and one of a length: both are where they were declared."""
    truss = fm.mechanisms.von_mises_truss().replace(b=3.0, P=2.0)
    starts = np.zeros((5, 4))
    starts[:, 0] = 0.89, 0.91, -0.91, 0.0, 0.0
    starts[:, 1] = -0.5, -0.5, -0.5, 1.99, 2.01
    found = fm.label_starts(truss, starts)
    beyond = found.status == fm.Status.OUT_OF_RANGE
    assert beyond[[1, 2, 4]].all()
    assert (found.well[beyond] == -1).all()
    assert not beyond[0]


def test_disturbances_maps_and_shocks_of_a_mechanism() -> None:
    mechanism = double_well()
    equilibria = fm.find_equilibria(mechanism)
    right = next(e for e in equilibria if e.position[0] > 0.5)
    own = equilibria.index_of(right)
    ensemble = fm.disturb(mechanism, right, 500, radius=0.6, t_end=120.0)
    assert ensemble.returned.fraction + 1e-12 >= (ensemble.end_index == own).mean()
    grid = {"x": np.linspace(-2.0, 2.0, 41), "x_dot": np.linspace(-2.0, 2.0, 41)}
    basins = fm.map_basins(mechanism, grid, 120.0)
    assert basins.turns.shape == (41, 41, 1)
    mirrored = basins.well[::-1, ::-1]  # x to -x, v to -v
    known = (basins.well >= 0) & (mirrored >= 0)
    assert known.mean() > 0.95
    assert (basins.well != mirrored)[known].all()
    # A kick of the resting mass needs at least the barrier's energy, and with this damper hardly more.
    shock = fm.minimal_shock(mechanism, right, most=2.0, coordinates=(1,), directions=2)
    omega = fm.kinetic_norm(mechanism, right)[1, 1] ** -1
    speed = shock.size * omega
    assert speed > math.sqrt(0.5)

    def comes_back(v: float) -> bool:
        return bool(end_of(mechanism, np.array([1.0, -v]), 120.0)[0] > 0.0)

    assert comes_back(0.999 * speed)
    assert not comes_back(1.001 * speed)
    edge = fm.track_edge(mechanism, [1.0, 0.0], [-1.0, 0.0], t_end=40.0)
    assert edge.settled
    saddle, away = fm.nearest_saddle(mechanism, edge.state)
    assert abs(saddle.position[0]) < 1e-9
    assert away < 1e-2


@pytest.mark.slow
def test_a_blow_on_the_papers_mechanism_is_that_on_the_scene() -> None:
    values = {"F0": 100.0, "alpha": 0.0, "beta": 60.0}
    scene, mechanism = fm.Scene(**values), fm.mechanisms.slider_pendulum().replace(**values)
    one, other = fm.find_equilibria(scene)[0], fm.find_equilibria(mechanism)[0]
    for on in ("M1", "M2", "M3"):
        np.testing.assert_allclose(
            impulse_start(mechanism, other, 12.0, on, 0.4),
            impulse_start(scene, one, 12.0, on, 0.4),
            rtol=1e-9,
        )
    proved, found = (shock_limit(x, e, "M2", 1.0, t_end=1.0) for x, e in ((scene, one), (mechanism, other)))
    assert found.proved.impulse == pytest.approx(proved.proved.impulse, rel=1e-9)
    assert found.proved.energy == pytest.approx(proved.proved.energy, rel=1e-9)
    assert found.found.impulse == pytest.approx(proved.found.impulse, rel=1e-4, nan_ok=True)


def test_small_disturbances_move_as_the_linearization_says() -> None:
    chain = damped_chain(2)
    hanging = fm.find_equilibria(chain)[0]
    motion = fm.disturbed_motion(chain, hanging, [1e-4, 0.0, 0.0, 0.0], np.linspace(0.0, 2.0, 21))
    apart = np.abs(motion.nonlinear - motion.linearized).max()
    assert apart < 1e-9
    limits = fm.linear_range(chain, hanging, directions=8).limit
    assert ((limits > 1e-2) & (limits < np.pi)).all()


def test_trapped_needs_no_damper() -> None:
    found = fm.trapped(double_well(b=0.0), [[1.0, 0.0], [1.0, 0.6], [1.0, 0.8], [-0.2, 0.0]])
    assert (found.well >= 0).tolist() == [True, True, False, True]


def open_damping() -> fm.Mechanism:
    """(x - y)^2 written out: intervals do not tell that it is nowhere negative."""
    x, y = fm.lengths("x y", -1.0, 1.0)
    D = (x**2 - 2 * x * y + y**2 + sympy.Rational(1, 10**9)) * x.dot**2
    return fm.Mechanism((x, y), kinetic=x.dot**2 + y.dot**2, potential=x**2 + y**2, dissipation=D)


def held_by_friction() -> fm.Mechanism:
    """Anywhere within 1/2 m of its only equilibrium."""
    x = fm.lengths("x", -1.0, 1.0)
    return fm.Mechanism(x, kinetic=x.dot**2, potential=x**2, dissipation=sympy.Abs(x.dot))


def damped_by_a_force(**more: Any) -> fm.Mechanism:
    """A pendulum with -c q' among its generalized forces."""
    q, c = fm.angles("q"), sympy.Symbol("c")
    force = {q: -c * q.dot}
    energies = {"kinetic": q.dot**2 / 2, "potential": -sympy.cos(q)}
    return fm.Mechanism(q, {"c": 0.2}, **energies, generalized_forces=force, **more)


@pytest.mark.parametrize(
    ("mechanism", "told"),
    [
        (lambda: double_well(b=0.0), "has no dampers: [^:]*never leave their well$"),
        (damped_by_a_force, "has no dampers: .* well; damping given as a generalized force is not known"),
        (
            lambda: damped_by_a_force(dissipation=fm.angles("q").dot ** 2),
            "potential; .* directions; damping given as a generalized force is not known as such: write it",
        ),
        (lambda: fm.mechanisms.ziegler_column().replace(b=1.0), "not known to come from a potential"),
        (open_damping, "it is not proved that its dissipation feeds no energy in, and so no label"),
        (held_by_friction, r"dry friction stops it also where forces do not balance, .* b \* sqrt\("),
    ],
    ids=["undamped", "force", "both", "follower", "open", "dry"],
)
def test_what_has_no_labels_says_why(mechanism: object, told: str) -> None:
    made = mechanism()  # type: ignore[operator]
    with pytest.raises(fm.InputError, match=told):
        fm.label_starts(made, np.zeros((1, len(made.state))))


def test_labels_say_where_damping_misses_a_mode() -> None:
    """Along y nothing damps, and nothing couples x and y."""
    x, y = fm.lengths("x y", -3.0, 3.0)
    energies = {"kinetic": x.dot**2 + y.dot**2, "potential": (x**2 - 1) ** 2 + y**2}
    missed, reached = (
        fm.Mechanism((x, y), **energies, dissipation=damped) for damped in (x.dot**2, x.dot**2 + y.dot**2)
    )
    starts = [[0.9, 0.1, 0.0, 0.0]]
    assert "(100.0%); a mode is not damped to first order" in str(fm.label_starts(missed, starts))
    assert "not damped" not in str(fm.label_starts(reached, starts))


def test_no_well_holds_what_a_load_keeps_moving() -> None:
    with pytest.raises(fm.InputError, match="never fades"):
        fm.trapped(double_well(fm.loads.Harmonic(0.3, 1.2)), [[1.0, 0.0]])


@pytest.mark.slow
def test_the_papers_mechanism_under_a_pulse_ends_where_scipy_says() -> None:
    mechanism = fm.mechanisms.slider_pendulum(fm.loads.Pulse(3000.0, 0.2, 0.3)).replace(c1=294.9, c2=92.85)
    rng = np.random.default_rng(6)
    starts = np.concatenate([rng.uniform(-3.0, 3.0, (40, 2)), np.zeros((40, 2))], axis=1)
    found = fm.label_starts(mechanism, starts, 60.0)
    assert (found.well >= 0).any()
    for k in np.flatnonzero(found.well >= 0)[:4]:
        expected = found.tree.equilibria[int(found.well[k])].position + TURN * found.turns[k]
        np.testing.assert_allclose(end_of(mechanism, starts[k], 60.0)[:2], expected, atol=0.5)


def test_an_offset_of_the_potential_costs_margin_and_no_label() -> None:
    """1e6 J beneath barriers of 1/4 J: what rounding may hide is taken off, labels stay."""
    x = fm.lengths("x", -3.0, 3.0)
    well = fm.Mechanism(
        x, points={"O": (0, 0), "M": (x, 0)}, masses={"M": 1}, potential=x**4 / 4 - x**2 / 2 + 1e6,
        dampers=[fm.Damper("O", "M", 0.2, along=(1, 0))], name="raised",
    )  # fmt: skip
    starts = np.random.default_rng(2).uniform([-2.0, -2.0], [2.0, 2.0], (100, 2))
    found, plain = fm.label_starts(well, starts, 120.0), fm.label_starts(double_well(), starts, 120.0)
    assert (found.well >= 0).mean() > 0.95
    both = (found.well >= 0) & (plain.well >= 0)
    assert (found.well == plain.well)[both].all()
