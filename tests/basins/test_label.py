"""Labels against integration to rest by SciPy, symmetry, statuses, independence of steps and threads."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
import sympy
from disturbance.known import stiff_motion
from scan_types.values import scipy_motion
from scipy.integrate import solve_ivp

import fastmech as fm
from fastmech.basins.label import How, label_states, well_numbers, well_of_number
from fastmech.ensembles.status import Status
from fastmech.slider.atlas.folds import find_folds
from fastmech.slider.lagrange import metric

TURN = 2.0 * np.pi
CONSTANT = fm.Scene(alpha=0.0)
BISTABLE = fm.Scene(F0=85.3, c1=294.9, c2=92.85, alpha=0.0)


def random_starts(n: int, fastest: float = 0.0, seed: int = 5) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.concatenate(
        [rng.uniform(-np.pi, np.pi, (n, 2)), fastest * rng.uniform(-1.0, 1.0, (n, 2))], axis=1
    )


@pytest.mark.parametrize(
    ("scene", "well"),
    [(CONSTANT, (1.45143, -0.23315)), (fm.Scene(), (np.pi / 2, 0.0))],
    ids=["constant", "decaying"],
)
def test_every_label_of_a_map_is_where_scipy_comes_to_rest(
    scene: fm.Scene, well: tuple[float, float]
) -> None:
    """DOP853 at 1e-12 from equations typed in the tests; 12 x 12 starts at rest, off any symmetry."""
    angle = -np.pi + (np.arange(12) + 0.37) * TURN / 12
    found = fm.map_basins(scene, {"phi": angle, "theta": angle})
    starts = np.zeros((144, 4))
    starts[:, :2] = np.stack(np.meshgrid(angle, angle, indexing="ij"), -1).reshape(-1, 2)
    final = scipy_motion(scene.parameters, starts, np.array([0.0, 25.0]))[-1]
    turns = np.round((final[:, :2] - well) / TURN)
    assert np.abs(final[:, :2] - TURN * turns - well).max() < 0.7
    assert (found.status == Status.CAPTURED).all()
    np.testing.assert_array_equal(found.turns.reshape(-1, 2), turns)
    assert len(np.unique(turns, axis=0)) >= 4


def test_mirror_image() -> None:
    """Without force and slider (pi - phi, -theta) has the energies of (phi, theta): both are trapped or none.

    The slider is on one side, so with it, or with its damper, motions are no mirror images.
    """
    scene = fm.Scene(F0=0.0, m3=0.0, alpha=0.0)
    starts = random_starts(2000, 4.0)
    mirrored = np.column_stack([np.pi - starts[:, 0], -starts[:, 1], -starts[:, 2:]])
    one, two = fm.trapped(scene, starts), fm.trapped(scene, mirrored)
    assert 0.1 < (one.well >= 0).mean() < 0.9
    np.testing.assert_array_equal(one.well, two.well)
    np.testing.assert_array_equal(one.turns, -two.turns)


def test_a_start_turned_by_full_turns_ends_so_many_turns_further() -> None:
    starts = random_starts(200, 3.0)
    turned = starts + np.array([2 * TURN, -3 * TURN, 0.0, 0.0])
    one, two = fm.label_starts(CONSTANT, starts), fm.label_starts(CONSTANT, turned)
    np.testing.assert_array_equal(one.well, two.well)
    np.testing.assert_array_equal(one.turns + np.array([2, -3]), two.turns)


@pytest.mark.parametrize(("scene", "t_end"), [(CONSTANT, 30.0), (BISTABLE, 60.0)])
def test_same_for_any_threads_and_company(scene: fm.Scene, t_end: float) -> None:
    starts = random_starts(700, 3.0)
    one = fm.label_starts(scene, starts, t_end, threads=1)
    two = fm.label_starts(scene, starts, t_end, threads=3)
    few = fm.label_starts(scene, starts[300:309], t_end)
    for name in ("well", "turns", "time", "status"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
        np.testing.assert_array_equal(getattr(one, name)[300:309], getattr(few, name))


def test_steps_do_not_matter() -> None:
    starts = random_starts(500, 6.0)
    usual, small = fm.label_starts(CONSTANT, starts), fm.label_starts(CONSTANT, starts, dt=0.02)
    np.testing.assert_array_equal(usual.well, small.well)
    np.testing.assert_array_equal(usual.turns, small.turns)
    large = fm.label_starts(CONSTANT, starts, dt=0.4)  # useless at first: what counts is that they agree
    known = large.well >= 0
    np.testing.assert_array_equal(large.turns[known], usual.turns[known])


@pytest.mark.parametrize(("F0", "alpha"), [(1e5, 1e9), (1e7, 1e6), (-1e5, 1e4)])
def test_a_force_that_dies_out_at_once_is_a_blow(F0: float, alpha: float) -> None:
    """SciPy after the impulse F0/alpha on M2 along x, in the limit: 1e-4, 10 and -10 N s."""
    scene = fm.Scene(F0=F0, alpha=alpha)
    starts = random_starts(400, 2.0)
    found = fm.label_starts(scene, starts)
    assert found.counts["captured"] >= 398
    some = starts[:60]
    B = np.zeros((60, 2))
    B[:, 0], B[:, 1] = -scene.l * np.sin(some[:, 0]), -scene.l * np.cos(some[:, 1])
    jump = np.linalg.solve(metric(scene, some[:, :2]), (F0 / alpha * B)[..., None])[..., 0]
    kicked = some + np.concatenate([np.zeros((60, 2)), jump], axis=1)
    free = scene.replace(F0=0.0, alpha=0.0)
    final = scipy_motion(free.parameters, kicked, np.array([0.0, 30.0]))[-1]
    turns = np.round((final[:, :2] - [np.pi / 2, 0.0]) / TURN)
    same = (found.turns[:60] == turns).all(axis=1)
    # What the position moves while the force acts is of order 1/alpha: only beside a boundary does it matter.
    assert same.mean() > (0.97 if alpha < 1e5 else 0.999)
    # The same motions with steps of the user's own, and capture times that count from the start.
    own = fm.label_starts(scene, some, dt=0.05)
    np.testing.assert_array_equal(own.turns, found.turns[:60])
    assert (found.time > 0.0).all()


def test_a_start_many_turns_away_is_brought_back_exactly() -> None:
    """5e5 turns: pi to 50 digits says where in its turn the start is."""
    turns = (500_000, -300_000, 2**26)
    with mpmath.workdps(50):
        away = [float(2 * mpmath.pi * n) for n in turns]
        beside = [float(x - 2 * mpmath.pi * n) for x, n in zip(away, turns, strict=True)]
    starts = random_starts(200, 3.0)
    # Doubles this large are multiples of 2^-32: with places that are, too, sums are exact.
    starts[:, :2] = np.round(starts[:, :2] * 2.0**20) / 2.0**20
    moved = starts + np.array([away[0], away[1], 0.0, 0.0])
    near = fm.label_starts(CONSTANT, starts + np.array([beside[0], beside[1], 0.0, 0.0]))
    far = fm.label_starts(CONSTANT, moved)
    assert far.counts["captured"] == 200
    np.testing.assert_array_equal(far.turns - near.turns, np.tile([500_000, -300_000], (200, 1)))
    lone = fm.label_starts(CONSTANT, [[away[2] + 1.0, 0.0, 0.0, 0.0], [1e300, 0.0, 0.0, 0.0]])
    assert lone.status.tolist() == [Status.CAPTURED, Status.START_NOT_FINITE]
    assert lone.turns[0, 0] == 2**26
    numbers = well_numbers(CONSTANT)(np.array([[away[2] + 1.0, 0.0, 0.0, 0.0]]))
    assert well_of_number(int(numbers[0])) == (0, (2**26, 0))


def test_capture_long_before_rest() -> None:
    """A twentieth of the steps; both counts are of the same lanes."""
    starts = random_starts(300)
    found = fm.label_starts(CONSTANT, starts, 200.0, settle_radius=1e-3)
    assert found.settle_time is not None
    assert np.isfinite(found.settle_time).all()
    assert 20.0 * found.time.mean() < found.settle_time.mean()
    assert (found.settle_time >= found.time).all()
    last = fm.integrate(
        CONSTANT, starts, t_eval=np.sort(found.settle_time)[[-1]] + 5.0, dt=0.02, method="dop853"
    )
    assert np.abs(last.y[-1][:, :2] - TURN * found.turns - [1.45143, -0.23315]).max() < 2e-3


def test_statuses() -> None:
    saddle = next(e for e in fm.find_equilibria(fm.Scene(F0=0.0, alpha=0.0)) if e.kind == "saddle")
    starts = np.array(
        [
            [1.4, 0.1, 0.0, 0.0],
            [saddle.phi, saddle.theta, 0.0, 0.0],
            [np.nan, 0.0, 0.0, 0.0],
            [0.0, 0.0, 1e200, 0.0],
        ]
    )
    found = fm.label_starts(fm.Scene(F0=0.0, alpha=0.0), starts, 4.0)
    kinds = [Status(s).name for s in found.status]
    assert kinds[:3] == ["CAPTURED", "AT_SADDLE", "START_NOT_FINITE"]
    assert kinds[3] in ("NOT_FINITE", "STEP_TOO_LARGE")
    assert sum(found.counts.values()) == 4
    implicit = fm.label_starts(fm.Scene(F0=0.0, alpha=0.0), starts[[0, 3]], 4.0, method="radau5")
    assert implicit.status.tolist() == [Status.CAPTURED, Status.NOT_CONVERGED]
    undecided = fm.label_starts(BISTABLE, random_starts(50), 2.0)
    assert undecided.counts["undecided"] > 25
    assert (undecided.well[undecided.status == Status.UNDECIDED] == -1).all()


def test_a_slow_passage_beside_a_fold_is_at_no_saddle() -> None:
    """A millionth of a newton before it minimum and saddle are 1e-4 rad apart; the start is between them."""
    scene = BISTABLE
    fold = find_folds(scene, "F0", np.linspace(600.0, 750.0, 16))[0]
    ghost = np.array([fold.phi, fold.theta, 0.0, 0.0])
    starts = ghost + np.array([[0.0], [1e-5], [-1e-5]]) * [1.0, 0.0, 0.0, 0.0]
    before = fm.label_starts(scene.replace(F0=fold.value - 1e-6), starts, 60.0)
    assert (before.status == Status.UNDECIDED).all()


@pytest.mark.parametrize("scene", [CONSTANT, fm.Scene(F0=300.0, alpha=0.0), fm.Scene(F0=0.0, alpha=0.0)])
def test_saddles_are_at_a_saddle(scene: fm.Scene) -> None:
    saddles = [e for e in fm.find_equilibria(scene) if e.kind == "saddle"]
    starts = [[e.phi, e.theta, 0.0, 0.0] for e in saddles]
    assert (fm.label_starts(scene, starts).status == Status.AT_SADDLE).all()


def test_motions_too_fast_to_tell_are_at_no_saddle() -> None:
    starts = np.random.default_rng(3).uniform(-1000.0, 1000.0, (10, 4)) * [0.0, 0.0, 1.0, 1.0]
    found = fm.label_starts(CONSTANT, starts)
    assert set(found.status.tolist()) <= {Status.CAPTURED, Status.UNDECIDED}


def test_without_damper_there_are_no_basins() -> None:
    scene = fm.Scene(beta=0.0, alpha=0.0)
    with pytest.raises(fm.InputError, match=r"scene.beta = 0: .*no attractor; fastmech.trapped"):
        fm.label_starts(scene, np.zeros((1, 4)))
    # What is trapped stays: the energy is conserved, and no angle leaves its turn in 200 s.
    starts = random_starts(300, 2.0)
    held = fm.trapped(scene, starts).well >= 0
    y = fm.integrate(scene, starts[held], t_eval=np.linspace(1.0, 200.0, 100), dt=0.02, method="dop853").y
    assert held.sum() > 30
    turns = fm.trapped(scene, starts[held]).turns
    for states in y:
        np.testing.assert_array_equal(fm.trapped(scene, states).turns, turns)


def test_progress_that_is_no_function_is_refused() -> None:
    with pytest.raises(fm.InputError, match=r"^progress = 3: .*finished starts"):
        fm.label_starts(CONSTANT, [1.0, 0.0, 0.0, 0.0], progress=3)  # type: ignore[arg-type]


def test_an_end_that_cannot_be_counted_to_is_refused() -> None:
    with pytest.raises(fm.InputError, match=r"t_end = 1e\+308 s: must be at most"):
        fm.label_starts(CONSTANT, np.zeros((1, 4)), 1e308)


@pytest.mark.parametrize("beta", [1e5, 1e7])
def test_heavy_damping_is_labelled_by_default(beta: float) -> None:
    """No motion is lost, moving or not, and wells are those that hold the ends of SciPy's Radau."""
    scene = CONSTANT.replace(beta=beta)
    starts = random_starts(256, fastest=8.0)
    found = fm.label_starts(scene, starts, 10.0)
    assert found.counts["captured"] + found.counts["undecided"] == 256
    proved = np.flatnonzero(found.well >= 0)[:4]
    assert proved.size == 4
    for lane in proved:
        end = fm.trapped(scene, stiff_motion(scene, starts[lane], 10.0))
        assert end.well[0] == found.well[lane]
        np.testing.assert_array_equal(end.turns[0], found.turns[lane])
    alone = fm.label_starts(scene, starts[proved[0]], 10.0)
    assert alone.time[0] == found.time[proved[0]]


def test_heavy_damping_and_a_force_that_is_gone_at_once() -> None:
    """A blow of 1 N s on M2, along x: the crank stops, the pendulum goes on as after the same rates."""
    scene = fm.Scene(beta=1e6, F0=1e6, alpha=1e6)
    free = scene.replace(F0=0.0, alpha=0.0)
    rest = fm.find_equilibria(free)[0]
    blow = fm.impulse_start(free, rest, 1.0)
    still = np.array([rest.phi, rest.theta, 0.0, 0.0])
    found, same = fm.label_starts(scene, still, 10.0), fm.label_starts(free, blow, 10.0)
    assert found.counts["captured"] == same.counts["captured"] == 1
    assert found.well[0] == same.well[0]


def test_angles_that_may_be_degrees_give_a_warning() -> None:
    with pytest.warns(UserWarning, match=r"starts: reaches 180, beyond 4 turns; .*numpy.deg2rad"):
        fm.label_starts(BISTABLE, [[90.0, 180.0, 0.0, 0.0]], 1.0)


def test_printed_it_says_where_they_end() -> None:
    found = fm.label_starts(BISTABLE, random_starts(200))
    for lines in (
        str(found).splitlines(),
        str(fm.map_basins(BISTABLE, {"phi": [0, 1], "theta": [0, 1]})).split("\n"),
    ):
        assert 2 <= len(lines) <= 6
        assert "captured" in lines[0]
    largest = np.bincount(found.well[found.well >= 0]).argmax()
    share = np.mean(found.well == largest)
    assert f"  well {largest} at phi = " in str(found)
    assert f"({share:.1%})" in str(found)
    assert f"  captured after {np.nanmedian(found.time):.3g} s (median), " in str(found)
    assert f"{np.nanmax(found.time):.3g} s at most" in str(found)


def test_a_slow_device_is_followed_as_much_longer() -> None:
    """By similarity: with time a thousand times as slow, the same labels at a thousand times the times."""
    slow = 1e3
    fast = fm.Scene(F0=-150.0, c1=260.0, c2=60.0, alpha=0.0)
    scaled = {name: getattr(fast, name) / slow**2 for name in ("F0", "c1", "c2", "g")}
    starts = random_starts(40)
    here = fm.label_starts(fast, starts)
    there = fm.label_starts(fast.replace(**scaled, beta=fast.beta / slow), starts)
    assert fm.label_starts(CONSTANT, starts).t_end == 60.0  # so that the paper's results stay
    assert str(here).endswith(f"followed for {here.t_end:g} s")  # nothing is left to decide
    brief = fm.label_starts(fast, starts, t_end=0.05)
    assert brief.counts["undecided"] > 0
    assert str(brief).endswith(f"0.05 s; a longer t_end may decide {brief.counts['undecided']}")
    coarse = label_states(fast, starts, None, How(sequence=(2, 3)))
    assert coarse.counts["undecided"] > 0  # all are captured with finer steps, as they were here
    assert f"steps part for {coarse.counts['undecided']}, which a smaller dt" in str(coarse)
    assert (here.status == Status.CAPTURED).all()
    np.testing.assert_array_equal(there.well, here.well)
    np.testing.assert_array_equal(there.turns, here.turns)
    assert there.time == pytest.approx(slow * here.time, rel=0.05)


def test_a_device_of_little_damping_is_followed_for_six_decay_times() -> None:
    """Of the slower well, by eigenvalues of the linearized motion; most are not captured after 60 s."""
    device = fm.Scene(m1=3.0, m2=5.0, m3=2.0, l=0.6, c1=240.0, c2=60.0, F0=-40.0, alpha=0.0, beta=80.0)
    stable = [fm.classify(device, e) for e in fm.find_equilibria(device) if e.kind == "minimum"]
    slowest = -1.0 / max(one.eigenvalues.real.max() for one in stable)
    starts = random_starts(64, 2.0)
    found, brief = fm.label_starts(device, starts), fm.label_starts(device, starts, 60.0)
    assert found.t_end == pytest.approx(6.0 * slowest, rel=1e-6)
    assert found.counts["undecided"] == 0
    assert brief.counts["undecided"] > 10
    assert f"a longer t_end may decide {brief.counts['undecided']}" in str(brief)


def test_a_start_too_fast_for_any_step_is_told_so() -> None:
    found = fm.map_basins(CONSTANT, {"phi": [-1.0, 1.0], "theta": [-1.0, 1.0]}, fixed={"phi_dot": 1e6})
    assert (found.status == Status.STEP_TOO_LARGE).all()


@pytest.mark.slow
def test_labels_of_motions_between_stops_are_right_or_none() -> None:
    """A switch of one angle between two stiff stops: steps that were long for the kinks gave wrong labels."""
    q = fm.angles("q", -1.4, 1.4)
    joint, tip = ((r * sympy.sin(q), r * sympy.cos(q)) for r in (0.03, 0.05))
    switch = fm.Mechanism(
        (q,),
        {},
        points={"joint": joint, "tip": tip, "P": (0, 0.05)},
        masses={"tip": 0.05},
        springs=[fm.Spring("P", "joint", 2000.0, free_length=0.03), fm.TorsionSpring(q - 0.1, 0.05)],
        potential=100 * sympy.Max(0, q - 0.5) ** 2 + 100 * sympy.Max(0, -q - 0.5) ** 2,
        dampers=[fm.TorsionDamper(q, 0.002)],
        forces=[fm.Force("tip", 0.5, (math.cos(0.5), math.sin(0.5)))],
        gravity=9.81,
    )

    def rates(t: float, y: np.ndarray) -> list[float]:
        x, v = y
        length = math.sqrt(0.03**2 + 0.05**2 - 2 * 0.03 * 0.05 * math.cos(x))
        torque = -2000.0 * (length - 0.03) * 0.03 * 0.05 * math.sin(x) / length - 0.05 * (x - 0.1)
        torque += 0.05 * 9.81 * 0.05 * math.sin(x) + 0.5 * 0.05 * math.cos(x + 0.5) - 0.002 * v
        torque += -200.0 * max(0.0, x - 0.5) + 200.0 * max(0.0, -x - 0.5)
        return [v, torque / (0.05 * 0.05**2)]

    starts = np.array(
        [[-0.9, -24], [-0.81, 6], [-0.81, 48], [0.675, -48], [0.81, 54], [0.72954, 116.36], [0.6, 30]]
    )
    found = fm.label_starts(switch, starts)
    places = np.array([e.position[0] for e in fm.find_equilibria(switch)])
    for start, well in zip(starts, found.well, strict=True):
        end = solve_ivp(rates, (0.0, 0.6), start, "DOP853", rtol=1e-10, atol=1e-12).y[0, -1]
        assert well in (-1, np.argmin(np.abs(places - end)))
    assert np.count_nonzero(found.well >= 0) >= 5
