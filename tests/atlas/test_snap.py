"""The load at which a resting position disappears."""

from __future__ import annotations

import math
import re
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.optimize
import sympy

import fastmech as fm
from fastmech.atlas.snap import find_snap
from fastmech.errors import InputError
from fastmech.models.equilibria import LIMITS
from fastmech.scene import Scene
from fastmech.slider.atlas.folds import find_folds
from fastmech.slider.atlas.snap import fold_free
from fastmech.slider.equilibria import find_equilibria

DATA = tomllib.loads((Path(__file__).parents[2] / "data" / "folds.toml").read_text())
BISTABLE = Scene(F0=85.3, c1=294.9, c2=92.85, alpha=0.0)
EXACT = next(line for line in DATA["line"] if line["name"] == "bistable")["folds"]


def test_table_1_never_snaps() -> None:
    snap = find_snap(Scene(alpha=0.0))
    assert (snap.below, snap.above) == (None, None)
    assert snap.exhaustive
    assert snap.position == pytest.approx((1.4506, -0.2326), abs=1e-3)
    low, high = snap.searched
    assert snap.sentence.endswith(
        f"does not end at any load (searched from {low:.6g} to {high:.6g} N; no end lies beyond)"
    )
    assert find_snap(Scene(alpha=0.0), parameter="m2").sentence.endswith(" kg")


@pytest.mark.parametrize("parameter", ["F0", "c1"])
def test_a_load_that_decays_is_said_to_count_as_nothing(parameter: str) -> None:
    told = find_snap(Scene(), parameter=parameter).sentence
    assert told.endswith("; the load F0 = 100 N decays (alpha = 0.7 1/s) and counts as 0 N in the end")
    for scene in (Scene(alpha=0.0), Scene(F0=0.0)):
        assert "decays" not in find_snap(scene, parameter=parameter).sentence


def test_each_well_of_a_bistable_mechanism_snaps_at_one_end() -> None:
    stable = [e for e in find_equilibria(BISTABLE) if e.kind == "minimum"]
    first, second = (find_snap(BISTABLE, e) for e in stable)
    assert first.above is None
    assert first.below == pytest.approx(float(EXACT[0]["value"]), abs=1e-9)
    assert second.below is None
    assert second.above == pytest.approx(float(EXACT[1]["value"]), abs=1e-9)
    assert find_snap(BISTABLE).below == first.below


def test_a_decaying_force_starts_from_none() -> None:
    snap = find_snap(BISTABLE.replace(alpha=0.7))
    assert snap.value == 0.0
    (load,) = (load for load in (snap.below, snap.above) if load is not None)
    assert abs(load) == pytest.approx(671.1627073982018, rel=1e-12)


def test_the_position_is_there_before_and_gone_after() -> None:
    rng = np.random.default_rng(8)
    snapped = 0
    for _ in range(40):
        scene = Scene(
            m1=rng.uniform(1, 30), m2=rng.uniform(1, 30), l=rng.uniform(0.4, 3.0), alpha=0.0,
            c1=10 ** rng.uniform(0.5, 3), c2=10 ** rng.uniform(0.5, 3), F0=rng.uniform(-200, 200),
        )  # fmt: skip
        snap = find_snap(scene)
        for load in (snap.below, snap.above):
            if load is None:
                continue
            snapped += 1
            away = 1e-4 * max(1.0, abs(load))
            counts = [
                find_equilibria(scene.replace(F0=load + d)).kind.count("minimum") for d in (-away, away)
            ]
            assert sorted(counts) == [1, 2]
    assert snapped > 3


NEARLY_PITCHFORK = [
    # Branches nearly touch where one of them ends: counts of minima change there, and nowhere else.
    (Scene(m1=2.5, m2=3.0, m3=1.5, l=0.6, c1=180.0, c2=40.0, F0=-10.0, alpha=0.0), 1, "c1", 26.8466, 1846.47),
    (
        Scene(
            m1=4.481079983350777, m2=2.4636037450624357, l=0.401192066807069,
            c1=390.71109616824447, c2=66.69623237320639, F0=-14.881119837253056, alpha=0.0,
        ), 0, "g", 5.68562, None,
    ),
]  # fmt: skip


@pytest.mark.parametrize(("scene", "which", "parameter", "below", "above"), NEARLY_PITCHFORK)
def test_beside_a_pitchfork_the_range_searched_does_not_matter(
    scene: Scene, which: int, parameter: str, below: float, above: float | None
) -> None:
    """The ends are those of two ranges that meet at the present value, and how it ends is told rightly."""
    stable = [e for e in find_equilibria(scene) if e.kind == "minimum"]
    whole = find_snap(scene, stable[which], parameter=parameter)
    assert whole.below == pytest.approx(below, rel=1e-5)
    assert whole.above == (above if above is None else pytest.approx(above, rel=1e-5))
    assert whole.how == ("disappears", None if above is None else "disappears")
    now = getattr(scene, parameter)
    for searched in ((0.0, now), (now, whole.searched[1]), (1e-3 * now, 0.7 * whole.searched[1])):
        part = find_snap(scene, stable[which], searched, parameter=parameter)
        assert part.below == (None if searched[0] == now else pytest.approx(whole.below, rel=1e-12))
        if above is not None and searched[1] > above:
            assert part.above == pytest.approx(whole.above, rel=1e-12)
    value, h = float(whole.below or 0.0), 1e-5
    lists = [
        find_equilibria(scene.replace(**{parameter: value * (1.0 + s * h)})).morse_index for s in (1.0, -1.0)
    ]
    assert [(one == 0).sum() for one in lists] == [2, 1]


def test_beyond_twice_c1_l_there_is_no_fold() -> None:
    """The bound that makes a search exhaustive."""
    rng = np.random.default_rng(9)
    for _ in range(30):
        scene = Scene(
            m1=10 ** rng.uniform(-1, 2), m2=10 ** rng.uniform(-1, 2), l=rng.uniform(0.2, 4.0), alpha=0.0,
            c1=10 ** rng.uniform(0, 3), c2=10 ** rng.uniform(0, 4),
        )  # fmt: skip
        bound = 2.0 * scene.c1 * scene.l
        assert find_folds(scene, "F0", np.linspace(bound, 10.0 * bound, 200)) == ()


def test_how_soft_c1_may_get() -> None:
    """A symmetric mechanism falls over at a pitchfork, where the Hessian at (-pi/2, 0) is singular.

    It is [[a - C, -C], [-C, b - C]] with a = (m1 + m2) g l - c2 l^2, b = m2 g l and C = c1 l^2, paper (19).
    """
    scene = Scene(F0=0.0, c1=20.0, c2=92.85, alpha=0.0)
    a, b = 22 * 9.80665 * 1.25 - 92.85 * 1.25**2, 12 * 9.80665 * 1.25
    pitchfork = a * b / (a + b) / 1.25**2
    assert pitchfork == pytest.approx(43.1747, abs=1e-4)
    for place in (None, (-1.57, 0.0), (3 * np.pi / 2, 0.01)):
        snap = find_snap(scene, place, parameter="c1")
        assert (snap.below, snap.how[1]) == (None, "turns unstable")
        assert snap.above == pytest.approx(pitchfork, rel=1e-9)
        assert "c1 = 20 N/m turns unstable above 43.1747 N/m" in snap.sentence
    tilted = scene.replace(c1=60.0)
    for e in find_equilibria(tilted):
        if e.kind == "minimum":  # the tilted ones straighten up there and stay
            assert find_snap(tilted, e, (20.0, 80.0), parameter="c1").below is None


@pytest.mark.parametrize("parameter", ["c1", "c2", "m1", "m2", "l", "g"])
def test_other_parameters_against_a_walk(parameter: str) -> None:
    """Of all equilibria at neighbouring values the nearest minimum goes on up to there and no further."""
    ended = 0
    for start in (e for e in find_equilibria(BISTABLE) if e.kind == "minimum"):
        snap = find_snap(BISTABLE, start, parameter=parameter)
        for value, end in zip((snap.below, snap.above), snap.searched, strict=True):
            goal = value if value is not None else min(max(end, 0.5 * snap.value), 2.0 * snap.value)
            beyond = [] if value is None else [value + 1e-4 * (value - snap.value)]
            at = np.array([start.phi, start.theta])
            for here in [*(goal - (goal - snap.value) * np.linspace(1.0, 1e-3, 100) ** 2), *beyond]:
                found = find_equilibria(BISTABLE.replace(**{parameter: float(here)}))
                places = np.array([[e.phi, e.theta] for e in found if e.kind == "minimum"])
                away = np.linalg.norm(2.0 * np.sin((places - at) / 2.0), axis=1)
                assert (away.min() > 0.3) == (here in beyond)
                at = places[away.argmin()]
            ended += len(beyond)
    assert ended >= 1


@pytest.mark.parametrize("parameter", ["c1", "c2", "m1", "m2", "l", "g"])
def test_beyond_the_bound_there_is_no_fold(parameter: str) -> None:
    rng = np.random.default_rng(10)
    for _ in range(20):
        scene = Scene(
            m1=10 ** rng.uniform(-1, 2), m2=10 ** rng.uniform(-1, 2), l=rng.uniform(0.2, 4.0), alpha=0.0,
            c1=10 ** rng.uniform(0, 3), c2=10 ** rng.uniform(0, 4), F0=rng.uniform(-500, 500),
        )  # fmt: skip
        bound = max(fold_free(scene, parameter)[1], 1e-3)
        assert find_folds(scene, parameter, np.geomspace(bound * (1 + 1e-9), 100.0 * bound, 200)) == ()


def test_wrong_requests_are_refused() -> None:
    saddle = next(e for e in find_equilibria(BISTABLE) if e.kind == "saddle")
    with pytest.raises(InputError, match=r"^equilibrium = \(.*\): must be a stable one$"):
        find_snap(BISTABLE, saddle)
    with pytest.raises(InputError, match=r"^equilibrium = 3: must be one of .*, or its coordinates$"):
        find_snap(BISTABLE, 3)  # type: ignore[arg-type]
    with pytest.raises(
        InputError, match=r"^equilibrium = \[0.0, 0.0\]: is near no stable one; they are at \(0\.70"
    ):
        find_snap(BISTABLE, (0.0, 0.0))
    for parameter in ("beta", "m3", "alpha", 3):
        with pytest.raises(
            InputError, match=rf"^parameter = {parameter!r}: must be one that moves equilibria"
        ):
            find_snap(BISTABLE, parameter=parameter)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"^scene\.c1 = -1"):
        find_snap(BISTABLE, searched=(-1.0, 500.0), parameter="c1")
    for searched in ((100.0, 200.0), (1.0,), 5, (None, None), ("-500", "500"), (np.nan, 500.0)):
        message = f"searched = {searched!r}: must be a range of F0 that holds 85.3 N"
        with pytest.raises(InputError, match=f"^{re.escape(message)}$"):
            find_snap(BISTABLE, searched=searched)  # type: ignore[arg-type]


def test_searched_range_is_kept_to() -> None:
    snap = find_snap(BISTABLE, searched=(-600.0, 600.0))
    assert (snap.below, snap.above, snap.exhaustive) == (None, None, False)
    assert snap.sentence.endswith("does not end at any load from -600 to 600 N")


@pytest.mark.slow
def test_any_mechanism_snaps() -> None:
    """The truss at its closed-form load; the cart's pendulum at kt = m g l; Ziegler's column flutters."""
    truss = fm.mechanisms.von_mises_truss()
    k, span, rise = (truss.parameters[name] for name in ("k", "span", "rise"))
    length = math.hypot(span / 2, rise)
    load = 2.0 * k * length * (1.0 - (span / 2 / length) ** (2.0 / 3.0)) ** 1.5
    up = fm.find_snap(truss, (0.0, rise), (-200.0, 200.0), parameter="P")
    assert up.above == pytest.approx(load, rel=1e-12)
    assert (up.below, up.how[1]) == (None, "disappears")
    down = fm.find_snap(truss, (0.0, -rise), (-200.0, 200.0), parameter="P")
    assert (down.above, down.below) == (None, pytest.approx(-load, rel=1e-12))
    assert "disappears below" in down.sentence
    bare = replace(up, unit="1")
    assert bare.sentence == up.sentence.replace(f" {up.unit}", "")
    assert "at P = 0 disappears above 42.9143 (searched from -200 to 200)" in bare.sentence
    both = replace(bare, below=-3.5, how=("disappears", "disappears"))
    assert "at P = 0 disappears below -3.5 and above 42.9143 (searched" in both.sentence
    other = replace(both, how=("turns unstable", "disappears"))
    assert "at P = 0 turns unstable below -3.5 and disappears above 42.9143 (searched" in other.sentence

    cart = fm.mechanisms.cart_pendulum()
    upright = fm.find_snap(cart, (0.0, 0.0), (1.0, 30.0), parameter="kt")
    assert (upright.below, upright.how[0]) == (pytest.approx(9.81, rel=1e-10), "turns unstable")
    assert upright.above is None

    column = fm.mechanisms.ziegler_column()
    flutter = fm.find_snap(column, None, (0.0, 3.0), parameter="P")
    assert (flutter.above, flutter.how[1]) == (
        pytest.approx(3.5 - math.sqrt(2.0), rel=1e-12),
        "begins to flutter",
    )
    damped = fm.find_snap(column.replace(b=0.2), (0.0, 0.0), (0.0, 3.0), parameter="P")
    assert damped.above == pytest.approx(41.0 / 28.0 + 0.02, rel=1e-12)
    # Pulled, it never ends, and the farther the shorter are the steps that follow it.
    damped = fm.find_snap(column.replace(b=0.2), (0.0, 0.0), parameter="P")
    assert (damped.below, damped.above) == (None, pytest.approx(41.0 / 28.0 + 0.02, rel=1e-12))
    with pytest.raises(fm.InputError, match="too many steps"):
        fm.find_snap(column, (0.0, 0.0), (-1e4, 1.0), parameter="P")


@pytest.mark.parametrize("parameter", ["F0", "c1", "m2"])
def test_the_papers_mechanism_snaps_as_its_scene(parameter: str) -> None:
    mechanism = fm.mechanisms.slider_pendulum().replace(alpha=0.0, F0=85.3, c1=294.9, c2=92.85)
    searched = {"F0": (-900.0, 900.0), "c1": (1.0, 900.0), "m2": (1.0, 60.0)}[parameter]
    number = 0
    for place in find_equilibria(BISTABLE):
        if place.kind == "minimum":
            number += 1
            expected = find_snap(BISTABLE, place, searched, parameter=parameter)
            found = fm.find_snap(mechanism, (place.phi, place.theta), searched, parameter=parameter)
            assert (found.below is None, found.above is None) == (
                expected.below is None,
                expected.above is None,
            )
            for one, other in ((found.below, expected.below), (found.above, expected.above)):
                assert one is None or one == pytest.approx(other, rel=1e-10)
            assert found.how == expected.how
    assert number == 2


def test_a_position_may_leave_its_range() -> None:
    x = fm.lengths("x", -1.0, 1.0)
    k, F = sympy.symbols("k F")
    hung = fm.Mechanism(x, {"k": 10.0, "F": 1.0}, kinetic=x.dot**2 / 2, potential=k * x**2 / 2 - F * x)
    found = fm.find_snap(hung, None, (-5.0, 50.0), parameter="F")
    assert (found.below, found.above, found.how[1]) == (None, pytest.approx(10.0), "leaves its range")


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"parameter": "nothing"}, "parameter = .nothing.: must be one that moves equilibria: k, span"),
        ({"parameter": None}, "parameter: missing; must be one that moves equilibria: k, span"),
        ({"searched": "P"}, r"searched = 'P': must be \(low, high\); a name is for parameter="),
        ({"searched": (1.0, 2.0)}, "must be a range of P that holds 0 N"),
        ({"equilibrium": (0.0, 0.0)}, "is near no stable one"),
        ({"equilibrium": (0.0,)}, "or its coordinates"),
    ],
)
def test_what_is_wrong_about_a_mechanism_s_snap_gets_a_line(changes: dict[str, Any], expected: str) -> None:
    """A range by itself is as far as its loads go, ten times the present one, or more until they end it."""
    snap = find_snap(fm.mechanisms.von_mises_truss(), parameter="P")
    assert snap.below is not None or snap.above is not None
    assert (snap.searched[0], snap.value) == (-snap.searched[1], 0.0)
    given = {"equilibrium": None, "searched": (-1.0, 1.0), "parameter": "P"} | changes
    with pytest.raises(InputError, match=expected):
        find_snap(fm.mechanisms.von_mises_truss(), **given)


def latch() -> fm.Mechanism:
    """A lever that hangs or leans under a spring to a hook above it, with a small load P to one side."""
    q, parameters = (
        fm.angles("q"),
        {"m": 0.6, "r": 0.12, "k": 900.0, "L0": 0.1, "a": 0.2, "g": 9.81, "P": 0.0},
    )
    m, r, k, L0, a, g, P = sympy.symbols("m r k L0 a g P")
    tip = (r * sympy.sin(q), -r * sympy.cos(q))
    return fm.Mechanism(
        q,
        parameters,
        points={"hook": (0, a), "tip": tip},
        masses={"tip": m},
        springs=[fm.Spring("hook", "tip", k, free_length=L0)],
        forces=[fm.Force("tip", fm.loads.Constant(P), (1, 0))],
        gravity=g,
    )


def latch_s_fold(load: float) -> float:
    """Stiffness at which the position with q < 0 merges with the hanging one: torque and slope vanish."""
    m, r, L0, a, g = 0.6, 0.12, 0.1, 0.2, 9.81

    def torque(q: float, k: float) -> float:
        length = math.sqrt(r * r + a * a + 2.0 * a * r * math.cos(q))
        pull = k * (1.0 - L0 / length) * a * r - m * g * r
        return pull * math.sin(q) + load * r * math.cos(q)

    def fold(z: Any) -> list[float]:
        h = 1e-5
        return [torque(z[0], z[1]), (torque(z[0] + h, z[1]) - torque(z[0] - h, z[1])) / (2.0 * h)]

    guess = [-1.1683 * (load / 1.0) ** (1.0 / 3.0), 42.8 + 9.0 * load ** (2.0 / 3.0)]
    return float(scipy.optimize.fsolve(fold, guess, xtol=1e-13)[1])


@pytest.mark.parametrize("load", [1e-6, 1e-4, 3e-3, 5e-2])
def test_beside_a_pitchfork_one_of_two_positions_of_a_mechanism_ends(load: float) -> None:
    """The one that leans with the load goes on, though the other's end is a hundredth of a radian from it."""
    device, value = latch().replace(P=load), latch_s_fold(load)
    counts = [
        sum(e.kind == "minimum" for e in fm.find_equilibria(device.replace(k=value + d)))
        for d in (-1e-3, 1e-3)
    ]
    assert counts == [1, 2]
    for place, below in ((-2.716, pytest.approx(value, rel=1e-7)), (2.716, None)):
        snap = fm.find_snap(device, (place,), parameter="k")
        assert (snap.below, snap.above) == (below, None)
        assert snap.joins == (None, None)


def test_what_merges_while_a_stable_position_goes_on_is_told() -> None:
    """Both leaning positions straighten up at k = m g d / (a (d - L0)), where d = a + r."""
    value = 0.6 * 9.81 * 0.32 / (0.2 * 0.22)
    for place in (-2.716, 2.716):
        snap = fm.find_snap(latch(), (place,), parameter="k")
        assert snap.below is None
        assert snap.joins == (pytest.approx(value, rel=1e-9), None)
        assert "it merges with others, and one stable position goes on" in " ".join(str(snap).split())


def lid(**values: float) -> fm.Mechanism:
    """A heavy lid with its spring free where it stands upright, at a = pi/2: rounded in every program."""
    a = fm.angles("a", -0.5, 3.6)
    m, L, k, g = sympy.symbols("m L k g")
    return fm.Mechanism(
        a,
        values,
        points={"G": (L / 2 * sympy.cos(a), L / 2 * sympy.sin(a))},
        masses=[fm.Body("G", m, m * L**2 / 12, a)],
        springs=[fm.TorsionSpring(a, k, free_angle=sympy.pi / 2)],
        gravity=g,
    )


@pytest.mark.parametrize(
    ("m", "L", "k"), [(14.0, 0.9, 30.0), (17.66, 1.004, 63.52), (18.7454, 0.88, 45.0), (11.43, 0.627, 24.05)]
)
def test_a_lid_straightens_up_from_both_sides_whatever_changes(m: float, L: float, k: float) -> None:
    """The torque m g L / 2 cos(a) + k (a - pi / 2) and its slope vanish at pi / 2 where m g L / 2 = k."""
    device = lid(m=m, L=L, k=k, g=9.81)
    share = k / (m * 9.81 * L / 2)
    below, above = (e for e in fm.find_equilibria(device) if e.kind == "minimum")
    assert below.position[0] + above.position[0] == pytest.approx(math.pi)
    for name in ("m", "L", "g", "k"):
        value = device.parameters[name] * (1.0 / share if name == "k" else share)
        side = int(name == "k")
        for place in (below, above):
            snap = fm.find_snap(device, place, parameter=name)
            assert (snap.below, snap.above)[side] is None
            assert snap.joins[side] == pytest.approx(value, rel=1e-12)
            assert snap.joins[1 - side] is None


BESIDE = Scene(F0=0.0, c1=180.0, c2=40.0, m1=2.5, m2=3.0, m3=1.5, l=0.6, alpha=0.0)


@pytest.mark.parametrize("size", [1e-9, 1e-8, 1e-7, 1e-6, 1e-5])
def test_beside_perfect_symmetry_one_of_two_positions_ends(size: float) -> None:
    """Beside the pitchfork of no load the position ends under a load of one sign and goes on under the other.

    In a pitchfork's unfolding the fold is apart from it by the load to the power 2/3. A load that is rounding
    beside the spring's largest force, 1722 N, breaks nothing.
    """
    pitchfork = find_folds(BESIDE, "c1", [1000.0, 4000.0])[0]
    assert pitchfork.kind == "pitchfork"
    (fold,) = find_folds(BESIDE.replace(F0=-1e-5), "c1", [1000.0, 4000.0])
    goes_on, ends = (
        find_snap(BESIDE.replace(F0=load), (-2.9412, -1.4960), parameter="c1") for load in (size, -size)
    )
    if size == 1e-9:
        for snap in (goes_on, ends):
            assert (snap.above, snap.joins[1]) == (None, pytest.approx(pitchfork.value, rel=1e-9))
        return
    apart = (pitchfork.value - fold.value) * (size / 1e-5) ** (2.0 / 3.0)
    assert goes_on.above is None
    assert ends.above is not None
    assert pitchfork.value - ends.above == pytest.approx(apart, rel=1e-3)
    assert (goes_on.joins, ends.joins, ends.how[1]) == ((None, None), (None, None), "disappears")


@pytest.mark.parametrize("load", [-1e-5, -1e-3, 1e-3])
def test_beside_a_pitchfork_the_ends_are_the_folds_of_the_search(load: float) -> None:
    """In a wide range the fold lies very near the pitchfork; branch and prune follows no position."""
    scene, searched = BESIDE.replace(F0=load), (10.0, 18000.0)
    ends = [point.value for point in find_folds(scene, "c1", searched) if load < 0.0]
    assert len(ends) == (2 if load < 0.0 else 0)
    for system in (scene, fm.mechanisms.slider_pendulum().replace(**scene.parameters)):
        found = fm.find_snap(system, (-2.9412, -1.4960), searched, parameter="c1")
        assert [found.below, found.above] == (pytest.approx(ends, rel=1e-9) if ends else [None, None])
        assert (found.how, found.joins) == (
            ("disappears", "disappears") if ends else (None, None),
            (None, None),
        )


def test_a_step_does_not_lead_over_to_a_branch_beside() -> None:
    """The position leans over at g = 10.09 beside a fold of others, a few thousandths of a radian from it.

    Of the two that lean then, one disappears at g = 10.74, as ``find_folds`` tells: not this one.
    """
    device = Scene(
        m1=1.8693817052666197, m2=5.343059262778123, l=0.7253735472355323, c1=15.487660245131154,
        c2=87.55368045555217, F0=2.014153247672946e-07, alpha=0.0,
    )  # fmt: skip
    mechanism = fm.mechanisms.slider_pendulum().replace(**device.parameters)
    for system in (device, mechanism):
        snap = find_snap(system, (1.5707962, 1.1e-8), (1.0, 29.0), parameter="g")
        assert (snap.below, snap.above, snap.joins) == (None, None, (None, None))


@pytest.mark.parametrize("h", [1e-3, 1e-2])
def test_a_jump_within_a_step_is_found(h: float) -> None:
    """The forces P - (x^3 / 3 - h^2 x) have folds at x = -h and h, a jump of 3 h at P = 2 h^3 / 3."""
    x = fm.angles("x")
    P = sympy.symbols("P")
    device = fm.Mechanism(
        x,
        {"P": -0.1},
        kinetic=x.dot**2 / 2,
        potential=sympy.sin(x) ** 4 / 12 - sympy.Float(h * h) * sympy.sin(x) ** 2 / 2 - P * sympy.sin(x),
    )
    start = [e for e in fm.find_equilibria(device) if e.kind == "minimum"]
    place = min(start, key=lambda e: abs(math.sin(e.position[0])))
    snap = fm.find_snap(device, place, (-0.2, 0.2), parameter="P")
    assert snap.above == pytest.approx(2.0 * h**3 / 3.0, rel=1e-6)
    assert snap.how[1] == "disappears"


def test_a_position_ends_where_its_discriminant_vanishes_whatever_dry_friction_does() -> None:
    """x^3 - k x + c = 0 has a double root where 4 k^3 = 27 c^2."""
    x, k = fm.lengths("x", -2.0, 2.0), sympy.Symbol("k")
    potential = x**4 / 4 - k * x**2 / 2 + x / 10
    rubbed = fm.Mechanism(x, {"k": 1.0}, kinetic=x.dot**2, potential=potential, dissipation=sympy.Abs(x.dot))
    shallow = next(e for e in fm.find_equilibria(rubbed) if e.position[0] > 0.5)
    snap = fm.find_snap(rubbed, shallow, (0.2, 3.0), parameter="k")
    assert snap.below == pytest.approx((27 * 0.1**2 / 4) ** (1 / 3), rel=1e-9)


def test_a_fold_is_listed_once_where_the_search_cannot_tell_others_from_it() -> None:
    """Places that are not proved lie together round a fold beside perfect symmetry."""
    found = find_folds(BESIDE.replace(F0=1e-9), "c1", [1000.0, 4000.0])
    assert (len(found), found.complete) == (1, False)
    assert found[0].value == pytest.approx(2841.3018, abs=1e-2)


def test_what_is_not_decided_is_not_said_to_be_unstable(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two cranks joined by a stiff coupler: with so few boxes both stable positions are not decided."""
    monkeypatch.setitem(LIMITS, 2, 500)
    a, b = fm.angles("a b")
    k, up = sympy.Symbol("k"), sympy.sin(b) - sympy.sin(a)
    across = 1 + sympy.cos(b) - sympy.cos(a)
    stiff = fm.Mechanism(
        (a, b),
        {"k": 1e7},
        kinetic=a.dot**2 + b.dot**2,
        potential=k * (sympy.sqrt(across**2 + up**2) - 1) ** 2 + sympy.sin(a + 0.3),
        dissipation=a.dot**2 + b.dot**2,
    )
    with pytest.raises(InputError, match="none is known to be stable, and the list is not"):
        fm.find_snap(stiff, parameter="k")


def contact(kind: str, depth: sympy.Expr) -> sympy.Expr:
    """The energy of a contact of this depth, over its stiffness."""
    pressed = {"linear": 2, "Hertz": sympy.Rational(5, 2)}
    if kind in pressed:
        return sympy.Max(0, depth) ** pressed[kind]
    return sympy.Piecewise((0, depth < 0), (depth**2, True))


@pytest.mark.parametrize("kind", ["linear", "Hertz", "Piecewise"])
def test_a_contact_that_opens_or_closes_ends_no_position(kind: str) -> None:
    """Without contact (x^2 - 1)^2 - F x has its folds at |F| = 8 / sqrt(27), and x = 1.3 at F = 3.588.

    A wider gap leaves the position free, where 4 x (x^2 - 1) = F.
    """
    x, fold = fm.lengths("x", -2.0, 2.0), 8.0 / math.sqrt(27.0)
    k, gap, F = sympy.symbols("k gap F")
    pressed = fm.Mechanism(
        x,
        {"k": 200.0, "gap": 0.3, "F": 6.0},
        kinetic=x.dot**2 / 2,
        potential=(x**2 - 1) ** 2 + k * contact(kind, x - 1 - gap) - F * x,
    )
    (place,) = fm.find_equilibria(pressed)
    assert place.position[0] > 1.3
    along = fm.find_snap(pressed, place, (-3.0, 18.0), parameter="F")
    assert (along.below, along.above) == (pytest.approx(-fold, rel=1e-12), None)
    assert along.how[0] == "disappears"
    wider = fm.find_snap(pressed, place, (0.01, 0.9), parameter="gap")
    assert (wider.below, wider.above) == (None, None)
    free = pressed.replace(F=0.0)
    there = fm.find_snap(free, (1.0,), (-3.0, 18.0), parameter="F")
    assert (there.below, there.above) == (pytest.approx(-fold, rel=1e-12), None)
    listed = [point.value for point in fm.critical_values(free, "F", np.linspace(-3.0, 3.0, 31))]
    assert listed == [pytest.approx(-fold, rel=1e-9), pytest.approx(fold, rel=1e-9)]


def test_a_truss_on_a_stop_snaps_up_where_it_does_without() -> None:
    """It leaves the stop at -0.25 before its fold at 2 k L0 (1 - cos(a)^(2/3))^(3/2), tan(a) = 0.4."""
    y, rise = fm.lengths("y", -1.5, 1.5), 0.4
    k, L0, P, c, gap = sympy.symbols("k L0 P c gap")
    truss = fm.Mechanism(
        y,
        {"k": 100.0, "L0": math.hypot(1.0, rise), "P": 0.0, "c": 3000.0, "gap": 0.25},
        kinetic=y.dot**2 / 2,
        potential=k * (sympy.sqrt(1 + y**2) - L0) ** 2 + P * y + c / 2 * sympy.Max(0, -gap - y) ** 2,
    )
    length = truss.parameters["L0"]
    load = 200.0 * length * (1.0 - (1.0 / length) ** (2.0 / 3.0)) ** 1.5
    snap = fm.find_snap(truss, (-0.2507,), parameter="P")
    assert (snap.below, snap.how[0]) == (pytest.approx(-load, rel=1e-10), "disappears")
    assert snap.below == pytest.approx(
        fm.critical_values(truss, "P", np.linspace(-12.0, 12.0, 81))[0].value, rel=1e-9
    )
    assert fm.find_snap(truss, (-0.2507,), parameter="gap").above is None


def test_a_position_may_end_on_a_kink() -> None:
    """Where stiffness 1 becomes -1 in a place, it meets another; at a value of P, it turns unstable."""
    x, P = fm.lengths("x", -1.0, 1.0), sympy.Symbol("P")
    softens = x**2 / 2 - sympy.Max(0, x - 0.3) ** 2 - P * x
    tips = sympy.Piecewise((1, P < 0.3), (-1, True)) * x**2 / 2
    for potential, how in ((softens, "disappears"), (tips, "turns unstable")):
        device = fm.Mechanism(x, {"P": 0.0}, kinetic=x.dot**2 / 2, potential=potential)
        snap = fm.find_snap(device, (0.0,), (-0.9, 0.9), parameter="P")
        assert (snap.below, snap.above, snap.how[1]) == (None, pytest.approx(0.3, abs=1e-8), how)
