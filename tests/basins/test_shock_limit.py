"""The shock limit against closed forms, SciPy and brute force."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy
from devices import double_well, inverted_pendulum, plane
from numpy.typing import NDArray
from oracles import motion_rates
from own_ends import depths, ends
from scan_types.values import scipy_motion
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

import fastmech as fm
from fastmech.basins.shock_limit import Blow, ShockLimit
from fastmech.slider.atlas.folds import find_folds
from fastmech.slider.geometry import positions
from fastmech.slider.lagrange import kinetic_energy, metric, potential_energy

Floats = NDArray[np.float64]

BISTABLE = fm.Scene(F0=85.3, c1=294.9, c2=92.85, alpha=0.0)
FRICTIONLESS = BISTABLE.replace(beta=0.0)
FREE = fm.Scene(F0=0.0, alpha=0.0)
WINDOWS = fm.Scene(F0=-150.0, c1=260.0, c2=60.0, alpha=0.0)
TURN = 2.0 * np.pi


@cache
def limit(scene: fm.Scene, well: int, on: str, direction: float | None = None) -> ShockLimit:
    return fm.shock_limit(scene, fm.find_equilibria(scene)[well], on, direction)


def struck(scene: fm.Scene, well: int, on: str, impulse: Floats, angle: Floats) -> Floats:
    """States (n, 4) after impulses (n,) at angles (n,): B by differences of positions."""
    e = fm.find_equilibria(scene)[well]
    place, h, number = np.array([e.phi, e.theta]), 1e-6, on[1]
    B = np.empty((2, 2))
    for k in range(2):
        one, two = (positions(scene, [*(place + s * h * np.eye(2)[k]), 0.0, 0.0]) for s in (1.0, -1.0))
        for row, name in enumerate("xy"):
            B[row, k] = (getattr(one, name + number) - getattr(two, name + number)) / (2.0 * h)
    J = impulse[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rates = np.linalg.solve(metric(scene, place), B.T @ J.T).T
    return np.concatenate([np.tile(place, (len(J), 1)), rates], axis=1)


def stays(scene: fm.Scene, well: int, starts: Floats, t_end: float) -> NDArray[np.bool_]:
    """Whether motions by SciPy's DOP853 at 1e-12 end where they began, their energy below the way out."""
    e = fm.find_equilibria(scene)[well]
    final = scipy_motion(scene.parameters, starts, np.array([0.0, t_end]))[-1]
    energy = kinetic_energy(scene, final) + potential_energy(scene, final[:, :2], scene.F0)
    assert (energy < e.energy + depths(scene)[well]).all()
    # Below every way out the angles are nearer to their own minimum than to any other.
    others = np.array([[m.phi, m.theta] for m in fm.find_equilibria(scene) if m.kind == "minimum"])
    turns = np.stack(np.meshgrid([-2, -1, 0, 1, 2], [-2, -1, 0, 1, 2]), axis=-1).reshape(-1, 1, 2)
    copies = (others + TURN * turns).reshape(-1, 2)
    nearest = copies[np.linalg.norm(final[:, None, :2] - copies, axis=2).argmin(axis=1)]
    return np.linalg.norm(nearest - [e.phi, e.theta], axis=1) < 1e-6


def test_closed_forms_with_the_crank_upright() -> None:
    """Unforced, Table 1 rests at phi = pi/2, theta = 0; M2 turned over is 2 (m2 g l + c1 l^2) higher."""
    s = FREE
    depth = 2.0 * (s.m2 * s.g * s.l + s.c1 * s.l**2)
    for on, mass in (("M1", s.m1 + s.m3), ("M2", s.m2), ("M3", s.m1 + s.m3)):
        proved = limit(s, 0, on).proved
        assert proved.energy == pytest.approx(depth, rel=1e-10)
        assert proved.impulse == pytest.approx(np.sqrt(2.0 * mass * depth), rel=1e-10)
        assert proved.velocity == pytest.approx(np.sqrt(2.0 * depth / mass), rel=1e-10)
        assert np.sin(proved.direction) == pytest.approx(0.0, abs=1e-12)
        oblique = limit(s, 0, on, 1.0)
        assert oblique.proved.impulse == pytest.approx(proved.impulse / np.cos(1.0), rel=1e-10)
        assert oblique.proved.energy == pytest.approx(depth, rel=1e-10)
        upwards = limit(s, 0, on, 0.5 * np.pi)  # M1 along OM1, M2 along the rods, M3 across its rail
        for blow in (upwards.proved, upwards.found):
            assert np.isnan([blow.impulse, blow.velocity, blow.energy]).all()


def test_the_slider_cannot_be_struck_at_its_dead_centre() -> None:
    """Springs and load such that the mechanism rests at phi = 0, theta = 0.3."""
    s, theta = fm.Scene(), 0.3
    C, b = s.c1 * s.l**2, s.m2 * s.g * s.l
    c2 = ((s.m1 + s.m2) * s.g * s.l - C * np.cos(theta)) / s.l**2
    scene = s.replace(F0=(C - b * np.tan(theta)) / s.l, c2=c2, alpha=0.0)
    e = next(e for e in fm.find_equilibria(scene) if abs(e.phi) < 1e-12)
    assert e.kind == "minimum"
    told = fm.shock_limit(scene, e, "M3")
    assert np.isnan([told.proved.impulse, told.proved.energy, told.found.impulse]).all()
    assert told.end is None
    assert "least found to leave (also by a full turn): none was found" in repr(told)
    known = replace(told, trajectories=7, tried_to=30.0, undecided_from=12.5)
    text = " ".join(repr(known).split())
    assert text.endswith(
        "7 blows followed, up to 30 N s; quote 12.5 N s: lighter ones all came back; some harder ones are "
        "open (follow single ones by fm.label_starts with a smaller dt=)"
    )
    leaves = Blow(impulse=9.0, direction=-0.25 * np.pi, velocity=0.9, energy=4.05)
    text = " ".join(repr(replace(known, found=leaves)).split())
    assert text.endswith("not all ends are known from 12.5 N s on")
    assert "9 N s at -0.785 rad (-45.0°) from +x, giving it 0.9 m/s, the mechanism 4.05 J" in text
    aside = replace(leaves, velocity=1.0)
    assert "giving it 1 m/s (at an angle to the blow), the mechanism 4.05 J" in " ".join(repr(aside).split())
    every = {"proved": aside, "found": replace(aside, impulse=99.0), "end": "out of range", "bounded": True}
    text = repr(replace(known, limited=True, undecided_from=12.345, **every))
    assert "more lines" not in text  # all that may be said has room
    assert text.endswith("limit of work")
    assert fm.shock_limit(scene, e, "M1").proved.impulse > 0.0
    atlas = fm.map_equilibria(scene, {"F0": [scene.F0]}, wells=True)
    slot = int(np.abs(atlas.phi[0]).argmin())
    assert np.isnan(atlas.shock_limit_m3[0, slot])


@pytest.mark.parametrize("on", ["M1", "M2", "M3"])
@pytest.mark.parametrize("well", [0, 1])
def test_no_blow_below_the_proved_bound_leaves(well: int, on: str) -> None:
    """Random directions, each up to its own bound, with and without damper."""
    rng = np.random.default_rng(17 + well)
    angle = rng.uniform(-np.pi, np.pi, 10)
    unit_energy = kinetic_energy(BISTABLE, struck(BISTABLE, well, on, np.ones(10), angle))
    bound = np.sqrt(depths(BISTABLE)[well] / unit_energy)
    told = np.array([limit(FRICTIONLESS, well, on, float(a)).proved.impulse for a in angle])
    assert told == pytest.approx(bound, rel=1e-8)
    assert limit(FRICTIONLESS, well, on).proved.impulse <= bound.min()
    size = bound * np.append(np.full(5, 0.999), rng.uniform(0.2, 0.999, 5))
    starts = struck(BISTABLE, well, on, size, angle)
    for scene in (BISTABLE, FRICTIONLESS):
        y = scipy_motion(scene.parameters, starts, np.linspace(0.0, 15.0, 61))
        assert (fm.trapped(scene, y.reshape(-1, 4)).well == well).all()
        assert (fm.trapped(scene, y.reshape(-1, 4)).turns == 0).all()


@pytest.mark.parametrize("on", ["M1", "M2", "M3"])
@pytest.mark.parametrize(("scene", "well"), [(BISTABLE, 0), (BISTABLE, 1), (FREE, 0)])
@pytest.mark.slow
def test_a_blow_one_percent_above_the_one_found_leaves(scene: fm.Scene, well: int, on: str) -> None:
    told = limit(scene, well, on)
    found = told.found
    assert found.impulse > told.proved.impulse
    assert found.energy > told.proved.energy
    start = struck(scene, well, on, np.array([found.impulse]), np.array([found.direction]))
    assert kinetic_energy(scene, start[0]) == pytest.approx(found.energy, rel=1e-8)
    np.testing.assert_allclose(
        fm.impulse_start(scene, fm.find_equilibria(scene)[well], found.impulse, on, found.direction),
        start[0], rtol=1e-8, atol=1e-8,
    )  # fmt: skip
    both = struck(scene, well, on, found.impulse * np.array([1.01, 0.99]), np.full(2, found.direction))
    np.testing.assert_array_equal(stays(scene, well, both, 60.0 if scene is FREE else 150.0), [False, True])


@pytest.mark.parametrize("well", [0, 1])
def test_brute_force_finds_nothing_smaller(well: int) -> None:
    """1,000 blows of random directions and sizes, from the proved bound to 2 % below the one found."""
    told, rng = limit(BISTABLE, well, "M2"), np.random.default_rng(2)
    size = np.exp(rng.uniform(*np.log([told.proved.impulse, 0.98 * told.found.impulse]), 1000))
    starts = struck(BISTABLE, well, "M2", size, rng.uniform(-np.pi, np.pi, 1000))
    label, turns, _ = ends(BISTABLE, starts, 600.0)
    known = label >= 0
    assert known.sum() > 950
    assert (label[known] == well).all()
    assert not turns[known].any()
    assert (fm.trapped(BISTABLE, starts).well != well).sum() > 300  # the energy of so many would do


@pytest.mark.slow
def test_a_flat_well_beside_a_fold() -> None:
    """A newton before the fold: less than a thousandth of the other well's depth, and slow to settle."""
    fold = find_folds(BISTABLE, "F0", np.linspace(600.0, 750.0, 16))[0]
    scene = BISTABLE.replace(F0=fold.value - 1.0)
    depth = depths(scene)[1]
    assert depth < 0.03
    told = limit(scene, 1, "M2")
    assert told.proved.impulse == pytest.approx(np.sqrt(2.0 * scene.m2 * depth), rel=1e-6)
    assert told.proved.impulse < told.found.impulse
    assert told.end == (0, (0, 0))
    size = told.found.impulse * np.array([1.01, 0.99])
    label, turns, _ = ends(scene, struck(scene, 1, "M2", size, np.full(2, told.found.direction)), 1200.0)
    assert label.tolist() == [0, 1]
    assert not turns.any()


@pytest.mark.parametrize(("on", "least"), [("M1", 45.606), ("M2", 39.729), ("M3", 213.55)])
def test_narrow_windows_are_seen(on: str, least: float) -> None:
    """The least of brute force; of M1 and M3 all but a narrow window leave only from 47.4 and 222 N s on."""
    told = limit(WINDOWS, 1, on)
    assert told.found.impulse <= least * (1.0 + 1e-4)
    above = np.array([told.found.impulse * (1.0 + 1e-4)])
    start = struck(WINDOWS, 1, on, above, np.array([told.found.direction]))
    assert not stays(WINDOWS, 1, start, 150.0).any()
    assert told.impulses_apart <= (0.005 if on == "M2" else 1e-4)
    assert (told.directions_apart == 0.0) is (on != "M2")
    rng = np.random.default_rng(5)
    size = rng.uniform(told.proved.impulse, told.found.impulse * (1.0 - 1e-3), 1500)
    along = np.full(1500, told.found.direction) if on != "M2" else rng.uniform(-np.pi, np.pi, 1500)
    label, turns, _ = ends(WINDOWS, struck(WINDOWS, 1, on, size, along), 200.0)
    assert ((label == 1) & ~turns.any(axis=1)).all()


@pytest.mark.slow
def test_a_millinewton_beside_a_fold_the_work_is_bounded() -> None:
    """Motions creep for minutes there; what was tried is told, and what was found leaves."""
    fold = find_folds(BISTABLE, "F0", np.linspace(600.0, 750.0, 16))[0]
    scene = BISTABLE.replace(F0=fold.value - 1e-3)
    told = limit(scene, 1, "M2")
    assert told.found.impulse == pytest.approx(0.2003, rel=2e-3)  # where finer grids came to
    assert told.end == (0, (0, 0))
    assert told.trajectories < 20_000
    assert told.impulses_apart == 0.04
    assert np.isnan(told.undecided_from)  # 42 blows that the first steps leave open are followed again


def test_the_force_free_impulse_along_x() -> None:
    """The limit of fast forces at Table 1 as SciPy brackets it in tests of snapping: 158.56 N s."""
    told = limit(FREE, 0, "M2", 0.0)
    assert told.found.impulse == pytest.approx(158.558, abs=2e-3)
    assert told.found.direction == 0.0
    assert told.end is not None
    assert told.end[1] != (0, 0)
    assert limit(FREE, 0, "M2").found.impulse <= told.found.impulse * (1.0 + 1e-3)


def test_a_search_without_end_ends_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """Printed to five digits, what is found is not less than it is, and what is proved not more."""
    whole = limit(BISTABLE, 0, "M2")
    monkeypatch.setattr("fastmech.basins.shock_limit.MOST_STEPS", 10_000)
    done: list[int] = []
    told = fm.shock_limit(BISTABLE, fm.find_equilibria(BISTABLE)[0], "M2", 0.0, progress=done.append)
    assert told.limited
    assert sum(done) == told.trajectories
    text = " ".join(str(told).split())
    assert "the search ended at its limit of work" in text
    assert not whole.limited
    proved, found = map(float, re.findall(r"([0-9.]+) N s", " ".join(str(whole).split()))[:2])
    assert whole.proved.impulse * (1.0 - 1e-4) < proved <= whole.proved.impulse
    assert whole.found.impulse <= found < whole.found.impulse * (1.0 + 1e-4)


def test_without_damper_the_bound_is_all() -> None:
    told = limit(FRICTIONLESS, 0, "M2")
    assert told.proved == limit(BISTABLE, 0, "M2").proved
    assert np.isnan(told.found.impulse)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"scene": fm.Scene()}, "scene.alpha = 0.7: must be 0 1/s"),
        ({"equilibrium": fm.find_equilibria(FREE)[1]}, "equilibrium: is a saddle, must be a minimum"),
        (
            {"equilibrium": fm.find_equilibria(BISTABLE)[0]},
            "equilibrium = (0.708161, 0.498745) rad, F = 85.3 N: this scene",
        ),
        ({"on": "M4"}, "on = 'M4': must be one of M1, M2, M3"),
        ({"direction": np.inf}, "direction = inf: must be a finite number of rad"),
        ({"t_end": 0.0}, "t_end = 0.0: must be a finite number of s greater than 0"),
    ],
)
def test_wrong_arguments_are_refused(changes: dict[str, Any], message: str) -> None:
    arguments: dict[str, Any] = {"scene": FREE, "equilibrium": fm.find_equilibria(FREE)[0]}
    with pytest.raises(fm.InputError) as refusal:
        fm.shock_limit(**(arguments | changes))
    assert str(refusal.value).startswith(message)
    assert "\n" not in str(refusal.value)


@pytest.mark.slow
def test_a_search_that_finds_nothing_tells_how_far_it_went() -> None:
    """A heavy damper holds what the search tries; SciPy's Radau shows a heavier blow that leaves."""
    stiff = {"m1": 11.0034, "m2": 0.421206, "m3": 6.54221, "l": 0.535831, "c1": 24.237, "c2": 121.559}
    scene = fm.Scene(**stiff, beta=757.96, F0=133.265, alpha=0.0)
    told = limit(scene, 0, "M1", 1.178)
    assert np.isnan(told.found.impulse)
    assert told.proved.impulse < told.tried_to < 640.0
    start = struck(scene, 0, "M1", np.array([640.0]), np.array([1.178]))[0]
    rates = motion_rates(scene.parameters)
    final = solve_ivp(rates, (0.0, 200.0), start, method="Radau", rtol=1e-9, atol=1e-10).y[:, -1]
    np.testing.assert_allclose(
        final - struck(scene, 0, "M1", np.zeros(1), np.zeros(1))[0], [TURN, 0, 0, 0], atol=1e-4
    )


@pytest.mark.slow
def test_first_steps_too_long_for_a_damper_are_no_end_of_the_search() -> None:
    """SciPy's Radau shows that a blow 1 % above the one found leaves, and one 1 % below does not."""
    masses = {"m1": 12.672938325877112, "m2": 6.681754059270018}
    springs = {"F0": -12.199235134378881, "c1": 99.95186532796019, "c2": 142.61250706229998}
    scene = fm.Scene(**masses, **springs, beta=3613.0, alpha=0.0)
    told = limit(scene, 0, "M2", 0.0)
    assert told.found.impulse < 80.41  # the least of 800 blows between the bound and the largest
    rest = struck(scene, 0, "M2", np.zeros(1), np.zeros(1))[0]
    starts = struck(scene, 0, "M2", told.found.impulse * np.array([1.01, 0.99]), np.zeros(2))
    rates = motion_rates(scene.parameters)
    turns = []
    for start in starts:
        run = solve_ivp(rates, (0.0, 20.0), start, method="Radau", rtol=1e-6, atol=1e-6)
        turns.append(np.rint((run.y[:2, -1] - rest[:2]) / TURN).tolist())
    assert turns == [[0.0, -1.0], [0.0, 0.0]]


def test_where_no_blow_leaves_none_is_left_undecided_that_finer_steps_decide() -> None:
    """A damper holds them all; SciPy's Radau agrees about three."""
    springs = {"F0": 3.2666653399599, "c1": 320.96966646469696, "c2": 63.66752572559305}
    scene = fm.Scene(m1=14.3, m2=16.17, **springs, beta=2876.6, alpha=0.0)
    told = limit(scene, 0, "M3", 0.0)
    assert np.isnan([told.found.impulse, told.undecided_from]).all()
    rest = struck(scene, 0, "M3", np.zeros(1), np.zeros(1))[0]
    rates = motion_rates(scene.parameters)
    for start in struck(scene, 0, "M3", told.tried_to * np.array([0.62, 0.8, 0.95]), np.zeros(3)):
        run = solve_ivp(rates, (0.0, 20.0), start, method="Radau", rtol=1e-6, atol=1e-6)
        np.testing.assert_array_equal(np.rint((run.y[:2, -1] - rest[:2]) / TURN), [0.0, 0.0])


@pytest.mark.slow
def test_blows_that_few_steps_do_not_decide_are_decided_below_one_that_leaves() -> None:
    """A slow mode leaves many blows open at first, a whole window of leaving ones among them."""
    masses = {"m1": 0.26960322012359694, "m2": 2.390972870305129, "m3": 26.40382911789746}
    springs = {"F0": 1.2881306963016803, "c1": 65.03040404003984, "c2": 3.4791283954754517}
    scene = fm.Scene(**masses, **springs, l=0.3769942645975386, beta=84.66179041445628, alpha=0.0)
    told = limit(scene, 1, "M1")
    starts = struck(scene, 1, "M1", np.array([35.41, 35.43, 38.2]), np.full(3, told.proved.direction))
    rates = motion_rates(scene.parameters)
    runs = [solve_ivp(rates, (0.0, 300.0), y, method="DOP853", rtol=1e-11, atol=1e-11) for y in starts]
    other, own = (fm.find_equilibria(scene)[k].phi for k in (0, 1))
    leaves = [abs(run.y[0, -1] - other) < abs(run.y[0, -1] - own) for run in runs]
    assert leaves == [False, True, True]
    assert 35.41 < told.found.impulse < 35.43


def test_a_direction_in_degrees_is_refused() -> None:
    with pytest.raises(fm.InputError, match=r"direction = 90\.0: must lie within"):
        fm.shock_limit(FREE, fm.find_equilibria(FREE)[0], "M2", 90.0)
    with pytest.raises(fm.InputError, match=r"direction = 90\.0: must lie within"):
        fm.impulse_start(FREE, fm.find_equilibria(FREE)[0], 1.0, "M2", 90.0)


def test_the_only_point_that_moves_is_struck_by_default() -> None:
    """A pendulum of mass m on a rod l at rest takes the rate J / (m l) from a blow J."""
    q = fm.angles("q")
    m, l, b = sympy.symbols("m l b")
    pendulum = fm.Mechanism(
        q, {"m": 2.0, "l": 0.5, "b": 0.1}, points={"O": (0, 0), "bob": (l * sympy.sin(q), -l * sympy.cos(q))},
        masses={"bob": m}, dampers=[fm.TorsionDamper(q, b)], gravity=9.81,
    )  # fmt: skip
    rest = next(e for e in fm.find_equilibria(pendulum) if e.kind == "minimum")
    np.testing.assert_allclose(fm.impulse_start(pendulum, rest, 3.0), [0.0, 3.0], atol=1e-12)
    limit = fm.shock_limit(pendulum, rest, direction=0.0, t_end=20.0)
    assert limit.on == "bob"
    assert limit.proved.impulse == pytest.approx(2.0 * np.sqrt(2.0 * 9.81 * 2 * 0.5), rel=1e-6)


def test_a_blow_that_leaves_the_range_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """SciPy brackets the speed with which a mass at x = 1 comes to x = 1.5, the end of its range."""
    words = list[str]()

    @contextmanager
    def working(first: str) -> Iterator[Callable[[str], None]]:
        words.append(first)
        yield words.append

    monkeypatch.setattr("fastmech.basins.shock_limit.working", working)
    mechanism = double_well(reach=1.5)
    right = next(e for e in fm.find_equilibria(mechanism) if e.position[0] > 0.5)
    low, high = 0.8, 1.2
    for _ in range(30):
        speed = 0.5 * (low + high)
        times = np.linspace(0.0, 3.0, 3001)
        run = solve_ivp(
            lambda t, y: (y[1], y[0] - y[0] ** 3 - 0.2 * y[1]), (0, 3), [1, speed], "DOP853", times, rtol=1e-9
        )
        low, high = (low, speed) if run.y[0].max() > 1.5 else (speed, high)
    told = fm.shock_limit(mechanism, right, direction=0.0)
    assert told.end == "out of range"
    assert told.found.impulse == pytest.approx(high, rel=2e-5)
    assert f"{told.found.energy:.4g} J; out of range" in " ".join(str(told).split())
    assert words[0] == f"blows on {told.on}"
    assert words[-1] == f"{told.trajectories:,} blows followed"  # a terminal sees it grow


def test_a_blow_that_leaves_the_range_within_a_step_is_found() -> None:
    """SciPy's turn of an inverted pendulum at 2.5 rad, and in a plane a linear motion in closed form."""
    pendulum = inverted_pendulum()
    rest = max(fm.find_equilibria(pendulum), key=lambda e: e.position[0])

    def beyond(speed: float) -> float:
        turn: Any = lambda t, y: y[1]  # noqa: E731
        turn.terminal = True
        rates = lambda t, y: (y[1], 9.81 * np.sin(y[0]) - 6.0 * (y[0] - 0.1) - 0.4 * y[1])  # noqa: E731
        start = [rest.position[0], speed]
        return float(solve_ivp(rates, (0.0, 3.0), start, "DOP853", events=turn, rtol=1e-12).y[0, -1]) - 2.5

    told = fm.shock_limit(pendulum, rest)
    assert told.found.impulse == pytest.approx(brentq(beyond, 2.5, 3.0), rel=2e-5)

    mechanism, step = plane(-0.5, 0.8), 1e-3
    whole = np.zeros((4, 4))
    whole[:2, 2:], whole[2:] = np.eye(2), [[-9.0, -2.0, -0.3, 0.0], [-2.0, -16.0, 0.0, -0.3]]
    path = np.array([expm(whole * step * k)[:2, 2:] for k in range(1500)])
    angles = np.linspace(0.0, TURN, 4001)
    moved = path @ np.stack([np.cos(angles), np.sin(angles)])
    by_unit = np.maximum(-moved[:, 0].min(axis=0) / 0.5, np.abs(moved[:, 1]).max(axis=0) / 0.8)
    told = fm.shock_limit(mechanism, fm.find_equilibria(mechanism)[0])
    assert told.found.impulse == pytest.approx(1.0 / by_unit.max(), rel=1e-4)


def test_a_fixed_point_cannot_be_struck() -> None:
    pendulum = fm.mechanisms.double_pendulum()
    rest = fm.find_equilibria(pendulum)[0]
    for on in ("O", "A", "M9"):
        with pytest.raises(fm.InputError, match=rf"^on = '{on}': must be a point that moves: M1, M2$"):
            fm.impulse_start(pendulum, rest, 1.0, on)
