"""Where disturbed trajectories end, checked where the answer is known and against SciPy."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
import sympy
from devices import double_well
from disturbance.known import center, equilibria, known, oracle_size, scipy_motion, stiff_motion
from oracles import motion_rates

from fastmech.atlas.snap import find_snap
from fastmech.basins.disturbed import DisturbedEnsemble, disturb
from fastmech.basins.label import label_starts
from fastmech.capture.select import trapped
from fastmech.disturbance.motion import disturbed_motion
from fastmech.ensembles.integrate import integrate
from fastmech.ensembles.status import ENDS, FAILURES, Status
from fastmech.errors import InputError, StepWarning
from fastmech.models.coordinates import angles, lengths
from fastmech.models.equilibria import find_equilibria as equilibria_of
from fastmech.models.mechanism import Mechanism
from fastmech.samplers import Gaussian, Sobol
from fastmech.scene import STATE, Scene
from fastmech.slider.capture.certificate import barrier_tree
from fastmech.slider.equilibria import find_equilibria
from fastmech.slider.lagrange import kinetic_energy, potential_energy

SCENE = known("table_1")[0]


def resting_place(run: DisturbedEnsemble) -> Any:
    """Angles of the equilibrium and the turns that a run names for every lane that rests."""
    angles = np.array([[e.phi, e.theta] for e in run.equilibria])
    rests = run.end_index >= 0
    return rests, angles[run.end_index] + 2 * np.pi * run.turns


def test_small_disturbances_of_the_stable_equilibrium_return() -> None:
    (stable,) = equilibria("table_1", 0)
    run = disturb(SCENE, stable, 300, radius=0.05)
    assert np.all(run.outcome == Status.RETURNED)
    assert run.share_returned == 1.0
    assert run.equilibria[run.index].kind == "minimum"
    assert np.all(run.end_index == run.index)
    assert not run.turns.any()
    assert np.all(oracle_size(SCENE, stable, run.final - center(stable)) <= 0.01)


def test_samplers_are_taken_where_starts_are() -> None:
    (stable,) = equilibria("table_1", 0)
    sampler = Gaussian({"phi": (-0.01, 0.01), "theta_dot": (-0.02, 0.02)}, n=40, seed=5)
    away = sampler.draw(40, STATE, 5)
    run = disturb(SCENE, stable, disturbances=sampler)
    np.testing.assert_array_equal(run.starts, center(stable) + away)
    part = disturb(SCENE, stable, disturbances=sampler, part=slice(8, 20))
    np.testing.assert_array_equal(part.final, run.final[8:20])
    motion, same = (disturbed_motion(SCENE, stable, given, [1.0]) for given in (sampler, away))
    np.testing.assert_array_equal(motion.linearized, same.linearized)
    near = Sobol({"phi": (1.0, 2.0), "theta_dot": (-1.0, 1.0)}, n=16, seed=2)
    about = near.draw(16, STATE, 2)
    np.testing.assert_array_equal(integrate(SCENE, near, 1.0).y, integrate(SCENE, about, 1.0).y)
    np.testing.assert_array_equal(label_starts(SCENE, near).time, label_starts(SCENE, about).time)
    np.testing.assert_array_equal(trapped(SCENE, near).well, trapped(SCENE, about).well)


@pytest.mark.parametrize("morse_index", [1, 2])
def test_disturbances_of_unstable_equilibria_never_return(morse_index: int) -> None:
    """Table 1 with constant force has one minimum: all that has come to rest is there."""
    for unstable in equilibria("table_1", morse_index):
        with pytest.warns(UserWarning, match=f"^equilibrium: is a {unstable.kind}, which even the smallest"):
            run = disturb(SCENE, unstable, 200, radius=0.05, t_end=300.0)
        assert run.share_returned == 0.0
        assert np.all(np.isnan(run.time_to_return))
        assert np.mean(run.outcome == Status.ELSEWHERE) > 0.95
        rests, place = resting_place(run)
        assert {run.equilibria[i].kind for i in run.end_index[rests]} == {"minimum"}
        assert np.abs(run.final[rests, :2] - place[rests]).max() < 0.02


def test_every_outcome_agrees_with_scipy() -> None:
    """Large disturbances of a bistable scene: end, turns and outcome of eight lanes."""
    scene, angles, indices = known("bistable")
    minima = angles[[index == 0 for index in indices]]
    first = equilibria("bistable", 0)[0]
    run = disturb(scene, first, 400, radius=2.5, seed=4, t_end=40.0, dt=0.01, return_radius=0.2)
    assert {Status.RETURNED, Status.ELSEWHERE} <= set(run.outcome)
    assert np.any(run.turns != 0)
    for lane in [*range(5), *np.flatnonzero((run.turns != 0).any(axis=1))[:3]]:
        end = scipy_motion(scene, run.starts[lane], 40.0, 1e-9).y[:, -1]
        np.testing.assert_allclose(run.final[lane], end, rtol=0, atol=1e-5)
        away = end[:2] - minima
        turns = np.round(away / (2 * np.pi))
        near = np.argmin(np.abs(away - 2 * np.pi * turns).max(axis=1))
        if run.outcome[lane] == Status.UNDECIDED:
            assert run.end_index[lane] == -1
            continue
        np.testing.assert_array_equal(run.turns[lane], turns[near])
        e = run.equilibria[run.end_index[lane]]
        np.testing.assert_allclose([e.phi, e.theta], minima[near], atol=1e-12)
        home = np.allclose(minima[near], [first.phi, first.theta]) and not turns[near].any()
        assert run.outcome[lane] == (Status.RETURNED if home else Status.ELSEWHERE)


@pytest.mark.parametrize("beta", [1e3, 1e5, 1e7])
@pytest.mark.parametrize(
    "scene", [Scene(F0=-150.0, c1=260.0, c2=60.0, alpha=0.0), Scene(alpha=0.0)], ids=["two wells", "table 1"]
)
@pytest.mark.slow
def test_heavy_damping_loses_no_motion(scene: Scene, beta: float) -> None:
    """By default; ends, and the wells that hold them, by SciPy's Radau at 1e-8."""
    scene = scene.replace(beta=beta)
    first = find_equilibria(scene)[0]
    run = disturb(scene, first, 256, radius=1.2, t_end=10.0)
    assert run.failures == ""
    assert np.isfinite(run.excursion).all()
    ends = np.array([stiff_motion(scene, start, 10.0) for start in run.starts[:4]])
    np.testing.assert_allclose(run.final[:4], ends, rtol=0, atol=1e-3)
    held = trapped(scene, ends)
    proved = held.well >= 0
    assert (run.outcome != Status.UNDECIDED).any()
    np.testing.assert_array_equal(run.outcome[:4] != Status.UNDECIDED, proved)
    np.testing.assert_array_equal(run.end_index[:4][proved], held.well[proved])


def test_steps_that_heavy_damping_forbids_are_told_in_one_word() -> None:
    scene = SCENE.replace(beta=1e5)
    e = find_equilibria(scene)[0]
    with pytest.warns(StepWarning):
        run = disturb(scene, e, 64, dt=0.05, method="dop853")
    assert np.all(run.outcome == Status.STEP_TOO_LARGE)
    with pytest.warns(StepWarning):
        ends = label_starts(scene, run.starts, dt=0.05, method="dop853")
    assert ends.counts["step_too_large"] == 64


@pytest.mark.nojit
@pytest.mark.filterwarnings("ignore:equilibrium. is a")
def test_the_unstable_balance_the_undecided_and_the_exploded_are_told_apart() -> None:
    (maximum,) = equilibria("table_1", 2)
    still_there = disturb(SCENE, maximum, 3, radius=1e-6, t_end=0.5, dt=0.1)
    assert np.all(still_there.outcome == Status.AT_SADDLE)
    assert np.all(still_there.end_index == -1)
    assert (still_there.share_returned, still_there.share_returned_at_most) == (0.0, 1.0)
    moving = disturb(SCENE, maximum, 3, radius=0.5, t_end=0.1, dt=0.1)
    assert np.all(moving.outcome == Status.UNDECIDED)
    assert np.all(moving.end_index == -1)
    assert np.all(np.isnan(moving.time_to_return))


def test_a_step_too_large_is_told_in_one_word() -> None:
    (stable,) = equilibria("table_1", 0)
    run = disturb(SCENE.replace(c1=162.5), stable, 5, t_end=2000.0, dt=2.0, method="euler")
    assert np.all(run.outcome == Status.STEP_TOO_LARGE)
    assert run.share_returned == 0.0


def test_time_to_return_and_excursions_against_dense_solutions() -> None:
    """The first step inside for good, and the largest departures, also between steps."""
    (stable,) = equilibria("table_1", 0)
    dt, t_end = 0.05, 120.0
    run = disturb(SCENE, stable, 40, radius=0.6, seed=8, t_end=t_end, dt=dt)
    times = dt * np.arange(2401)
    for lane in range(3):
        assert run.outcome[lane] == Status.RETURNED
        motion = scipy_motion(SCENE, run.starts[lane], t_end, 1e-10).sol
        departures = motion(times).T - center(stable)
        outside = np.flatnonzero(oracle_size(SCENE, stable, departures) > 0.01)
        assert run.time_to_return[lane] == pytest.approx(times[outside[-1] + 1], abs=1e-9)
        between = np.abs(motion(np.linspace(0.0, t_end, 1_000_001))[:2].T - center(stable)[:2])
        np.testing.assert_allclose(run.excursion[lane], between.max(axis=0), rtol=1e-4)  # Hermite's cubic


def test_a_run_that_ends_inside_by_chance_has_not_returned() -> None:
    """At t_end some are in the ball and will leave it again: only who cannot leave it is back."""
    (stable,) = equilibria("table_1", 0)
    early = disturb(SCENE, stable, 2000, radius=0.5, t_end=25.0, dt=0.05)
    late = disturb(SCENE, stable, 2000, radius=0.5, t_end=60.0, dt=0.05)
    back = np.isfinite(early.time_to_return)
    assert 0 < back.sum() < 2000
    np.testing.assert_array_equal(early.time_to_return[back], late.time_to_return[back])


def test_what_is_proved_to_return_need_not_be_back() -> None:
    """A well deep enough to hold nearly all, a damper that takes minutes to bring them to rest.

    98.4 % return by ``label_starts``. SciPy brings the first eight, and two that end elsewhere, to t = 300 s:
    they are beside the well that they are said to end in, and too low to leave any.
    """
    scene = Scene(F0=-150.0, c1=260.0, c2=60.0, alpha=0.0)
    first = find_equilibria(scene)[0]
    run = disturb(scene, first, 512, radius=1.2, t_end=300.0)
    labels = label_starts(scene, run.starts, 300.0)
    home = (labels.well == 0) & ~labels.turns.any(axis=1)
    np.testing.assert_array_equal(run.outcome == Status.RETURNED, home)
    assert np.all(labels.well >= 0)
    assert run.share_returned == run.share_returned_at_most == pytest.approx(0.984, abs=5e-4)
    assert run.failures == ""
    assert np.isnan(run.time_to_return).all()
    lanes = [*range(8), *np.flatnonzero(run.outcome == Status.ELSEWHERE)[:2]]
    barrier = barrier_tree(scene).barrier.min()
    for lane in lanes:
        end = scipy_motion(scene, run.starts[lane], 300.0, 1e-9).y[:, -1]
        assert kinetic_energy(scene, end) + potential_energy(scene, end[:2], scene.F0) < barrier
        e = run.equilibria[run.end_index[lane]]
        place = np.array([e.phi, e.theta]) + 2 * np.pi * run.turns[lane]
        assert np.abs(end[:2] - place).max() < 1.5


def test_shares_cover_what_is_not_decided() -> None:
    """Undecided starts are none at the lower end and all at the upper end, by Wilson's formula itself."""
    scene = known("bistable")[0]
    run = disturb(scene, equilibria("bistable", 0)[1], 300, radius=1.0, t_end=20.0)
    ends = {name: int(np.sum(run.outcome == Status[name.upper()])) for name in ("returned", "undecided")}
    assert min(ends.values()) > 10
    at_most = 300 - int(np.sum(run.outcome == Status.ELSEWHERE))
    assert at_most >= sum(ends.values())
    assert (run.share_returned, run.share_returned_at_most) == (ends["returned"] / 300, at_most / 300)
    z = 1.959963984540054
    ends_of = {
        sign: (k + z * z / 2 + sign * z * np.sqrt(k * (300 - k) / 300 + z * z / 4)) / (300 + z * z)
        for sign, k in ((-1, ends["returned"]), (1, at_most))
    }
    assert run.returned.lower == pytest.approx(ends_of[-1], rel=1e-12)
    assert run.returned.upper == pytest.approx(ends_of[1], rel=1e-12)


def test_what_leaves_its_range_does_not_return() -> None:
    """One start comes back, one comes to x = 1.5 by its energy, one is far beyond, where forces overflow."""
    mechanism = double_well(reach=1.5)
    right = next(e for e in equilibria_of(mechanism) if e.position[0] > 0.5)
    run = disturb(mechanism, right, disturbances=[[0.1, 0.0], [0.0, 3.0], [1e200, 0.0]])
    assert run.outcome.tolist() == [Status.RETURNED, Status.OUT_OF_RANGE, Status.OUT_OF_RANGE]
    assert run.outcome[1:].tolist() == label_starts(mechanism, run.starts[1:]).status.tolist()
    assert run.share_returned == run.share_returned_at_most == 1.0 / 3.0
    assert run.failures == ""
    assert np.isnan(run.excursion[2]).all()
    assert "ended: 1 returned, 2 out_of_range (1 of them from the start)" in repr(run)
    # The saddle at x = 0 is a metre away.
    assert "within 0.01 m for good by" in repr(run)
    with pytest.raises(InputError, match=r"^return_radius = 0.6 m: must not exceed 0.5 m, half the distance"):
        disturb(mechanism, right, 1, return_radius=0.6)
    with pytest.raises(InputError, match=r"^radius = -1: must be a finite number of m greater than 0"):
        disturb(mechanism, right, 1, radius=-1)


def test_by_default_nothing_begins_beyond_a_range_where_a_coordinate_is_a_length() -> None:
    """Of a pendulum on a slide between stops; 4,096 points of a ball come near its farthest ones."""
    x, q = lengths("x", -0.02, 0.05), angles("q")
    kinetic = (3.0 * x.dot**2 + 2.0 * 0.2 * sympy.cos(q) * x.dot * q.dot + 0.04 * q.dot**2) / 2.0
    potential = 500.0 * x**2 - 2.0 * sympy.cos(q)
    of: Any = {"kinetic": kinetic, "potential": potential, "dissipation": 5.0 * x.dot**2 + q.dot**2 / 100.0}
    device = Mechanism((x, q), name="slide", **of)
    hanging = next(e for e in equilibria_of(device) if e.kind == "minimum")
    run = disturb(device, hanging, 4096, t_end=0.01)
    assert not device.outside(run.starts).any()
    assert 0.015 < np.abs(run.starts[:, 0]).max() < 0.02
    # A ball's largest x: the norm is the kinetic energy's over that of q alone.
    radius = 0.02 / np.linalg.inv(np.array([[3.0, 0.2], [0.2, 0.04]]) / 0.04)[0, 0] ** 0.5
    assert f"disturbances of up to {radius:.2g} rad of the minimum" in str(run)
    assert run.return_radius == pytest.approx(0.02 * radius, rel=1e-9)
    near = Mechanism((lengths("x", -1e-9, 0.05), q), name="slide", **of)
    run = disturb(near, equilibria_of(near)[0], 4096, t_end=0.01)
    assert 0.75 < np.abs(run.starts[:, 0]).max() / (0.01 * 0.05) < 1.0
    angular = Mechanism(angles("q", -0.1, 0.1), kinetic=q.dot**2 / 2, potential=q**2, dissipation=q.dot**2)
    wide = disturb(angular, equilibria_of(angular)[0], 64, t_end=0.01)
    assert re.search("of up to 0.(49|5) rad of the minimum", str(wide))


@pytest.mark.filterwarnings("ignore:equilibrium. is a")
def test_default_steps_are_the_scene_s() -> None:
    """A device of 20 to 40 rad/s, where steps of 0.05 s lose half of the trajectories of its maximum."""
    scene = Scene(c1=2000.0, c2=8000.0, beta=20.0, alpha=0.0)
    found = find_equilibria(scene)
    for e in found:
        run = disturb(scene, e, 128, radius=1.0, t_end=20.0)
        assert run.failures == ""
        assert (run.dt * run.size.omega).max() < 0.7
    lost = disturb(scene, found[-1], 128, radius=1.0, t_end=20.0, dt=0.05)
    failing = np.isin(lost.outcome, FAILURES)
    assert failing.sum() > 40
    assert np.isnan(lost.excursion[failing]).all()
    assert lost.share_returned_at_most >= failing.mean()


def test_a_light_crank_pin_loses_no_motion() -> None:
    """With crank and rod in line rates rise tenfold for an instant; by SciPy's DOP853 at 1e-10.

    A step of the user's own stays as it is.
    """
    masses = {"m1": 0.01565, "m2": 4.247, "m3": 33.69, "l": 0.3433}
    scene = Scene(**masses, c1=314.2, c2=10.69, beta=2.306, F0=26.6, alpha=0.0)
    first = find_equilibria(scene)[0]
    run = disturb(scene, first, 128, radius=1.2, t_end=1.0)
    again = np.flatnonzero(run.dt < 0.5 * run.dt.max())
    assert run.failures == ""
    assert again.size > 4
    for lane in again[:5]:
        path = scipy_motion(scene, run.starts[lane], 1.0, 1e-10)
        departures = path.sol(np.linspace(0.0, 1.0, 10_001))[:2].T - center(first)[:2]
        np.testing.assert_allclose(run.excursion[lane], np.abs(departures).max(axis=0), rtol=0, atol=5e-3)
    own = disturb(scene, first, 128, radius=1.2, t_end=1.0, dt=2e-3)
    assert np.isin(own.outcome[again], FAILURES).sum() > 4
    assert (own.dt == own.dt[0]).all()
    ends = label_starts(scene, run.starts, 30.0)
    assert ends.counts["step_too_large"] == ends.counts["not_finite"] == 0


def test_a_step_of_a_start_is_no_matter_of_its_companions() -> None:
    scene = Scene(c1=2000.0, c2=8000.0, beta=20.0, alpha=0.0)
    first = find_equilibria(scene)[0]
    whole = disturb(scene, first, 60, radius=3.0, t_end=2.0)
    assert np.unique(whole.dt).size > 1
    part = disturb(scene, first, 60, radius=3.0, t_end=2.0, part=slice(7, 20))
    for name in ("dt", "final", "outcome", "time_to_return", "excursion"):
        np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[7:20])


def test_the_ball_of_return_reaches_at_most_half_way_to_the_next_equilibrium() -> None:
    """Beside a fold, where a saddle is less than 0.02 rad away."""
    scene = known("bistable")[0]
    scene = scene.replace(F0=(1.0 - 1e-5) * find_snap(scene, find_equilibria(scene)[0]).below)
    found = find_equilibria(scene)
    distances = {
        minimum: min(
            oracle_size(scene, minimum, (center(other) - center(minimum))[None])[0]
            for other in found
            if other is not minimum
        )
        for minimum in found
        if minimum.kind == "minimum"
    }
    beside = min(distances, key=distances.__getitem__)
    run = disturb(scene, beside, 8, radius=1e-4, t_end=1.0)
    assert run.return_radius == pytest.approx(0.5 * distances[beside], rel=1e-6)
    assert run.return_radius < 0.01
    assert run.to_xarray().attrs["return_radius"] == run.return_radius


def test_balls_that_would_meet_are_refused() -> None:
    (stable,) = equilibria("table_1", 0)
    with pytest.raises(InputError, match=r"^return_radius = 5 rad: must not exceed"):
        disturb(SCENE, stable, 1, return_radius=5.0)


@pytest.mark.filterwarnings("ignore:equilibrium. is a")
def test_equilibria_and_seeds_have_streams_of_their_own() -> None:
    (first,), second = equilibria("table_1", 0), equilibria("table_1", 1)[0]
    ball = [
        run.size.to_ball.T @ (run.starts - center(e)).T
        for e, seed in ((first, 7), (second, 7), (first, 8), (second, 6))
        for run in [disturb(SCENE, e, 5, seed=seed, t_end=0.1)]
    ]
    for i in range(len(ball)):
        for j in range(i):
            assert not np.isclose(ball[i], ball[j]).any()


def test_a_disturbance_inside_the_ball_returns_at_once_or_after_it_left() -> None:
    (stable,) = equilibria("table_1", 0)
    run = disturb(SCENE, stable, 50, radius=0.001, t_end=1.0, return_radius=0.5)
    np.testing.assert_array_equal(run.time_to_return, 0.0)
    assert np.all(run.excursion >= np.abs(run.starts - center(stable))[:, :2])


def test_force_free_scene_with_a_decay_rate_is_welcome() -> None:
    scene = known("table_1_unforced")[0].replace(alpha=0.7)
    minimum = next(e for e in find_equilibria(scene) if e.kind == "minimum")
    assert disturb(scene, minimum, 50, radius=0.05).share_returned > 0.9


@pytest.mark.nojit
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"n": 0}, "n = 0: must be an integer not less than 1"),
        ({"n": 2.5}, "n = 2.5: must be an integer not less than 1"),
        ({"seed": -1}, "seed = -1: must be an integer not less than 0"),
        ({"radius": 0.0}, "radius = 0.0: must be a finite number of rad greater than 0"),
        ({"return_radius": -0.1}, "return_radius = -0.1: must be a finite number of rad greater than 0"),
        ({"t_end": np.inf}, "t_end = inf: must be a finite number of s greater than 0"),
        ({"dt": "x"}, "dt = 'x': must be a finite number of s greater than 0"),
        ({"method": "rk5"}, "method = 'rk5': unknown; known: euler"),
        ({"threads": 0}, "threads = 0: must be an integer not less than 1"),
        ({"progress": 3}, "progress = 3: must be a function of the number of finished trajectories"),
    ],
)
def test_wrong_arguments_are_refused(arguments: dict[str, Any], message: str) -> None:
    (stable,) = equilibria("table_1", 0)
    with pytest.raises(InputError, match=f"^{re.escape(message)}"):
        disturb(SCENE, stable, **({"n": 1, "t_end": 0.1} | arguments))


@pytest.mark.nojit
def test_a_decaying_force_and_a_foreign_equilibrium_are_refused() -> None:
    (stable,) = equilibria("table_1", 0)
    with pytest.raises(
        InputError, match=r"^scene\.alpha = 0\.7: must be 0 1/s .*replace\(alpha=0\.0\) and find"
    ):
        disturb(SCENE.replace(alpha=0.7), stable, 1)
    with pytest.raises(
        InputError,
        match=r"^equilibrium = \(1\.45058, -0\.232575\) rad, F = 100 N: must be one of this scene's",
    ):
        disturb(Scene(F0=-100.0, alpha=0.0), stable, 1)
    with pytest.raises(InputError, match=r"^scene\.beta = 0: must be greater than 0 N s/m"):
        disturb(SCENE.replace(beta=0.0), stable, 1)


@pytest.mark.nojit
def test_every_outcome_has_its_own_advice() -> None:
    assert len({status.advice for status in ENDS}) == len(ENDS)


def test_failed_trajectories_make_no_noise() -> None:
    """A step far too large: some end infinite, and nothing but their outcome says so."""
    scene = SCENE.replace(m3=0.5, beta=30.0)
    (stable,) = [e for e in find_equilibria(scene) if e.kind == "minimum"]
    run = disturb(scene, stable, 100, radius=1.0, t_end=3.0, dt=0.5, method="rk4")
    assert {Status.NOT_FINITE, Status.STEP_TOO_LARGE} & set(run.outcome.tolist())


@pytest.mark.filterwarnings("ignore:equilibrium. is a")
def test_printed_it_says_what_became_of_them() -> None:
    (stable,) = equilibria("table_1", 0)
    run = disturb(SCENE, stable, 300, radius=0.05)
    lines = str(run).splitlines()
    assert len(lines) <= 6
    assert lines[0].startswith(
        "300 disturbances of up to 0.05 rad of the minimum at phi = 1.451, theta = -0.2326 rad"
    )
    assert lines[1] == "  ended: 300 returned"
    assert lines[2].startswith("  returned: 100.00%, at most 100.00% (95 % interval 98.7")  # 1/(1 + z^2/n)
    assert f"{np.median(run.time_to_return):.3g} s (median)" in lines[3]
    assert f"{run.excursion[:, 0].max():.3g} rad of phi" in lines[4]
    assert f"at most {run.time_to_return.max():.3g} s" in lines[3]
    saddle = next(e for e in find_equilibria(SCENE) if e.kind == "saddle")
    assert "for good" not in str(disturb(SCENE, saddle, 64, radius=0.05))  # none returns
    early = disturb(SCENE, stable, 64, radius=0.05, t_end=1.0)
    rates, place = motion_rates(SCENE.parameters), np.array([stable.phi, stable.theta, 0.0, 0.0])
    slopes = [np.subtract(rates(0.0, place + d), rates(0.0, place - d)) / 2e-6 for d in 1e-6 * np.eye(4)]
    decay = -1.0 / np.linalg.eigvals(np.transpose(slopes)).real.max()
    told = " ".join(str(early).split())
    (seconds,) = re.findall(r"only later: small swings fall to 1/e in (\S+) s", told)
    assert float(seconds) == pytest.approx(decay, rel=1e-3)


def test_it_tells_the_energy_beside_the_barrier() -> None:
    """At x = 1, omega^2 = 2 and m = 1, so a size s gives s^2 J; the barrier is 1/4 J."""
    mechanism = double_well(b=1.0)
    wells = [e for e in equilibria_of(mechanism) if e.kind == "minimum"]
    for s in (0.9, 0.09):
        run = disturb(mechanism, wells[0], disturbances=np.array([[s, 0.0], [0.0, -0.1 * s]]), t_end=1.0)
        assert f"; given up to {s * s:.2g} J, barrier 0.25 J\n" in str(run)


def test_it_tells_how_long_a_run_would_bring_all_back() -> None:
    """A run of that length does, and one half as long does not."""
    (stable,) = equilibria("table_1", 0)
    early = disturb(SCENE, stable, 64, t_end=10.0)
    assert np.isnan(early.time_to_return).any()
    assert f"s, t_end = {early.enough:.3g} s should do" in " ".join(str(early).split())
    assert np.isfinite(disturb(SCENE, stable, 64, t_end=early.enough).time_to_return).all()
    half = disturb(SCENE, stable, 64, t_end=0.5 * early.enough)
    late = int(np.isnan(half.time_to_return).sum())
    assert 0 < late < 64
    told = " ".join(str(half).split()).partition(" for good by ")[2].partition(" s: ")[2]
    assert told.startswith(f"{64 - late} of these 64")
    assert f", {late} only later: small swings" in told
    assert "at most" not in told  # that of those which are back is no answer


def test_printed_it_says_how_many_are_at_the_same_place_full_turns_away() -> None:
    (stable,) = equilibria("table_1", 0)
    run = disturb(SCENE, stable, 200, radius=6.0)
    turned = int(((run.end_index == run.index) & run.turns.any(axis=1)).sum())
    assert turned == int((run.outcome == Status.ELSEWHERE).sum()) > 0
    assert f"{turned} elsewhere ({turned} of them at this minimum, full turns away)" in repr(run)


def test_what_is_measured_is_the_motion_whose_end_is_proved() -> None:
    """A light M1 and long ways: the first steps lead one motion in ten elsewhere than it is proved to go."""
    scene = Scene(m1=0.3, m2=5.0, F0=60.0, c1=294.9, c2=92.85, beta=20.0, alpha=0.0)
    stable = next(e for e in find_equilibria(scene) if e.kind == "minimum")
    run = disturb(scene, stable, 160, radius=4.0, t_end=200.0)
    rests, place = resting_place(run)
    assert rests.mean() > 0.9
    assert np.linalg.norm(run.final[:, :2] - place, axis=1)[rests].max() < 0.5
    assert (run.excursion >= np.abs(place - center(stable)[:2]) - 0.5)[rests].all()


def test_excursions_of_steps_by_default_are_those_of_scipy() -> None:
    """A heavy slider and a light crank pin: some motions are near saddles before they are captured."""
    scene = Scene(m1=1.52108, m2=30.9005, m3=79.875, l=0.381443, c1=81.7035, c2=341.728, beta=40.1527)
    scene = scene.replace(F0=-587.843, alpha=0.0)
    stable = find_equilibria(scene)[0]
    run = disturb(scene, stable, 128, radius=1.0, seed=16, t_end=10.0)
    lanes = np.flatnonzero(run.outcome == Status.RETURNED)
    assert lanes.size >= 20
    error = []
    for lane in lanes:
        motion = scipy_motion(scene, run.starts[lane], 10.0, 1e-10)
        exact = np.abs(motion.sol(np.linspace(0.0, 10.0, 20_001))[:2].T - center(stable)[:2]).max(axis=0)
        error.append(np.abs(run.excursion[lane] - exact).max() / exact.max())
    # One reaches its largest long after the coarse run's largest, which is as far as half the step looks.
    assert np.mean(np.array(error) < 0.01) > 0.95
    assert max(error) < 0.1


def test_a_radius_in_degrees_gets_a_line() -> None:
    (stable,) = equilibria("table_1", 0)
    with pytest.warns(UserWarning, match="radius: reaches 30, beyond 4 turns; angles are in radians"):
        disturb(SCENE, stable, 8, radius=30.0, t_end=1.0)
