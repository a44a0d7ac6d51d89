"""Right-hand sides with branches: what ``tol`` claims, against references that go from branch to branch."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
import pytest
from ensembles.references import Floats
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import fastmech as fm


def friction(t: float, x: float, v: float, gain: float, window: float, kinetic: float) -> tuple[float, float]:
    """Stick and slip on a belt of speed 1.5: the branch that sticks is as narrow as the window."""
    r = v - 1.5
    mu = kinetic + (1.0 - kinetic) * np.exp(-abs(r) / 0.5)
    if abs(r) > window:
        return v, -x - 0.1 * v - np.tanh(gain * r) * mu
    if abs(x + 0.1 * v) > 1.0:
        return v, -x - 0.1 * v + np.tanh(gain * mu)
    return 1.5, 1.5 - v


@numba.njit
def piece(x: float, v: float, window: float) -> int:
    """Slip above and below the belt's speed: 1, -1; in the window let go, 2, or stuck, 3."""
    if abs(v - 1.5) > window:
        return 1 if v > 1.5 else -1
    return 2 if abs(x + 0.1 * v) > 1.0 else 3


@numba.njit
def field(where: int, x: float, v: float, gain: float, kinetic: float) -> tuple[float, float]:
    r = v - 1.5
    mu = kinetic + (1.0 - kinetic) * np.exp(-abs(r) / 0.5)
    if where == 3:
        return 1.5, 1.5 - v
    if where == 2:
        return v, -x - 0.1 * v + np.tanh(gain * mu)
    return v, -x - 0.1 * v - np.tanh(gain * r) * mu


@numba.njit
def rk4(where: int, x: float, v: float, h: float, gain: float, kinetic: float) -> tuple[float, float]:
    a, b = field(where, x, v, gain, kinetic)
    c, d = field(where, x + h / 2 * a, v + h / 2 * b, gain, kinetic)
    e, f = field(where, x + h / 2 * c, v + h / 2 * d, gain, kinetic)
    p, q = field(where, x + h * e, v + h * f, gain, kinetic)
    return x + h / 6 * (a + 2 * c + 2 * e + p), v + h / 6 * (b + 2 * d + 2 * f + q)


@numba.njit
def from_piece_to_piece(
    starts: Floats, times: Floats, dt: float, gain: float, window: float, kinetic: float
) -> Floats:
    """States (times, n, 2) by rk4 inside each piece; where one ends by bisection."""
    y = np.full((times.size, len(starts), 2), np.nan)
    for i in range(len(starts)):
        x, v, t, o = starts[i, 0], starts[i, 1], 0.0, 0
        where = piece(x, v, window)
        while o < times.size:
            h = min(dt, times[o] - t)
            x_end, v_end = rk4(where, x, v, h, gain, kinetic)
            if piece(x_end, v_end, window) != where:
                low, high = 0.0, h
                for _ in range(60):
                    middle = 0.5 * (low + high)
                    x_end, v_end = rk4(where, x, v, middle, gain, kinetic)
                    if piece(x_end, v_end, window) == where:
                        low = middle
                    else:
                        high = middle
                h = high
                x_end, v_end = rk4(where, x, v, h, gain, kinetic)
            x, v, t = x_end, v_end, t + h
            where = piece(x, v, window)
            if t >= times[o] - 1e-12:
                t = times[o]
                y[o, i, 0], y[o, i, 1] = x, v
                o += 1
    return y


@pytest.mark.parametrize(
    ("seed", "gain", "window", "kinetic"),
    [
        (1, 200.0, 1e-4, 0.5),
        (2, 200.0, 1e-4, 0.5),
        (3, 200.0, 1e-3, 0.5),
        (4, 200.0, 1e-5, 0.5),
        (5, 50.0, 1e-4, 0.5),
        (6, 200.0, 1e-4, 0.3),
        (7, 200.0, 1e-4, 0.8),
    ],
)
@pytest.mark.slow
def test_no_claim_about_a_narrow_branch_is_wrong(
    seed: int, gain: float, window: float, kinetic: float
) -> None:
    """Steps that pass over the window bring 0.51 to 0.57 to rest of seed 1, and agree about it."""
    n, tol, times = (
        (100, 1e-4, np.linspace(400.0, 500.0, 201)) if seed == 1 else (24, 1e-4, np.array([300.0]))
    )
    starts = np.random.default_rng(seed).uniform([-2.0, 0.0], [2.0, 2.0], (n, 2))
    names = {"gain": gain, "window": window, "kinetic": kinetic}
    right, finer = (from_piece_to_piece(starts, times, dt / gain, gain, window, kinetic) for dt in (0.4, 0.2))
    assert np.abs(right - finer).max() < 1e-5  # the reference knows what it says
    run = fm.integrate(fm.System(friction, ["x", "v"], names), starts, t_eval=times, tol=tol)
    assert run.error is not None
    known = np.isfinite(run.error)
    true = np.abs(run.y - right).max(axis=(0, 2))
    assert (true[known] <= tol).all()
    assert (run.error[known] <= tol).all()
    assert known.mean() >= 0.95
    if seed == 1:
        assert np.mean(np.ptp(run.y[:, :, 0], axis=0) < 0.1) == np.mean(np.ptp(right[:, :, 0], axis=0) < 0.1)


@numba.njit
def write(w: Floats, x: float) -> None:
    w[0] = x


@numba.njit
def kick(w: Floats, p: Floats) -> float:
    return 1.0 / p[0] if 0.3 < w[0] < 0.3 + p[0] else 0.0


def written(t: float, x: float, v: float, p: float) -> tuple[float, float]:
    w = np.empty(1)
    write(w, x)
    return v, -x + (1.0 / p if 0.3 < w[0] < 0.3 + p else 0.0)


def shared(t: float, x: float, v: float, p: float) -> tuple[float, float]:
    w = np.empty(2)
    u = w
    write(u, x)
    return v, -x + (1.0 / p if 0.3 < w[0] < 0.3 + p else 0.0)


def written_array(t: float, y: Floats, p: Floats, rates: Floats) -> None:
    w = np.empty(1)
    write(w, y[0])
    rates[0] = y[1]
    rates[1] = -y[0] + kick(w, p)


@pytest.mark.parametrize("field", [written, shared, written_array])
@pytest.mark.slow
def test_a_branch_on_what_was_written_into_an_array_is_seen(field: Any) -> None:
    """Energy tells what steps over the window miss: each pass through it changes v^2/2 + x^2/2 by 1."""
    width, state = 1e-3, ("y", 2) if field is written_array else ["x", "v"]
    starts = np.random.default_rng(11).uniform(-1.5, 1.5, (40, 2))
    run = fm.integrate(fm.System(field, state, {"p": width}), starts, t_end=20.0, tol=1e-4)
    assert run.error is not None
    known = run.error <= 1e-4
    assert known.all() == (field is not written_array)  # whose decisions are not located, which is said

    def energy(y: Floats) -> Floats:
        return 0.5 * (y**2).sum(axis=1) - np.clip((y[:, 0] - 0.3) / width, 0.0, 1.0)

    assert (np.abs(energy(run.y[-1]) - energy(starts))[known] < 0.15).all()


def bilinear(t: float, x: float, v: float, stiff: float) -> tuple[float, float]:
    return v, -x - 0.1 * v - max(0.0, stiff * (x - 0.5)) + 0.6 * fm.cos(1.3 * t)


def bouncing(t: float, x: float, v: float, stiff: float) -> tuple[float, float]:
    return v, -9.81 + (-stiff * x - 20.0 * v if x < 0.0 else 0.0)


def bilinear_by_numpy(t: float, x: float, v: float, stiff: float) -> tuple[float, float]:
    return v, -x - 0.1 * v - float(np.where(x > 0.5, stiff * (x - 0.5), 0)) + 0.6 * fm.cos(1.3 * t)


def bouncing_by_numpy(t: float, x: float, v: float, stiff: float) -> tuple[float, float]:
    return v, -9.81 + np.where(np.less(x, 0.0), -stiff * x - 20.0 * v, 0.0)


def switched(field: Any, border: Any, start: Floats, times: Floats) -> Floats:
    """SciPy's DOP853 from one crossing of the border to the next."""
    t, y, out = 0.0, start, []
    while t < times[-1]:
        side = border(y) > 0.0 if border(y) else border(y + 1e-9 * np.array(field(t, y, True))) > 0.0

        def event(t: float, y: Floats) -> float:
            return float(border(y))

        event.terminal, event.direction = True, -1.0 if side else 1.0  # type: ignore[attr-defined]
        part = solve_ivp(
            lambda t, y, side=side: field(t, y, side), (t, times[-1]), y, "DOP853", events=event,
            rtol=1e-11, atol=1e-11, dense_output=True, max_step=0.05,
        )  # fmt: skip
        inside = times[(times > t) & (times <= part.t[-1])]
        out += [part.sol(one) for one in inside]
        t, y = part.t[-1], part.y[:, -1]
        y = np.array([border.at, y[1]]) if part.status == 1 else y
    return np.array(out)


class Border:
    """Where x passes a value."""

    def __init__(self, at: float) -> None:
        self.at = at

    def __call__(self, y: Floats) -> float:
        return float(y[0] - self.at)


@pytest.mark.parametrize(
    ("rhs", "stiff", "at", "times"),
    [
        (bilinear, 4.0, 0.5, np.linspace(2.0, 30.0, 8)),
        (bilinear_by_numpy, 4.0, 0.5, np.linspace(2.0, 30.0, 8)),
        (bouncing, 2e4, 0.0, np.linspace(0.25, 2.0, 8)),
        (bouncing_by_numpy, 2e4, 0.0, np.linspace(0.25, 2.0, 8)),
    ],
)
def test_piecewise_linear_systems_keep_their_errors(rhs: Any, stiff: float, at: float, times: Floats) -> None:
    starts = np.random.default_rng(5).uniform([at + 0.05, -1.0], [at + 0.5, 1.0], (12, 2))

    def field(t: float, y: Floats, above: bool) -> list[float]:
        x, v = y
        if at > 0.0:
            return [v, -x - 0.1 * v - (stiff * (x - 0.5) if above else 0.0) + 0.6 * math.cos(1.3 * t)]
        return [v, -9.81 - (0.0 if above else stiff * x + 20.0 * v)]

    right = np.stack([switched(field, Border(at), start, times) for start in starts], axis=1)
    run = fm.integrate(fm.System(rhs, ["x", "v"], {"stiff": stiff}), starts, t_eval=times, tol=1e-5)
    assert run.error is not None
    true = np.abs(run.y - right).max(axis=(0, 2))
    assert (run.error <= 1e-5).all()
    assert (true <= 1e-5).all()
    assert 1.0 / 3.0 <= np.median(run.error / true) <= 3.0


@pytest.mark.parametrize("quantile", [1.0, 0.99])
def test_a_choice_by_numpy_is_the_same_as_one_by_python(quantile: float) -> None:
    starts = np.random.default_rng(6).uniform([0.05, -1.0], [0.5, 1.0], (50, 2))
    one, other = (
        fm.integrate(
            fm.System(rhs, ["x", "v"], {"stiff": 2e4}), starts, t_end=2.0, tol=1e-5, quantile=quantile
        )
        for rhs in (bouncing, bouncing_by_numpy)
    )
    np.testing.assert_array_equal(one.y, other.y)
    assert one.error_estimate == other.error_estimate <= 1e-5
    assert one.reason == other.reason


def walled(t: float, x: float, v: float) -> tuple[float, float]:
    return v, -x - (100.0 * (x - 9.0) if x > 9.0 else 0.0)


@pytest.mark.parametrize("tol", [1.0, 1e-2, 1e-4])
def test_errors_are_told_where_the_longest_steps_are_more_accurate_than_asked(tol: float) -> None:
    """An oscillator that never comes to its wall: two runs with the same steps would be no distance apart."""
    starts = np.random.default_rng(2).uniform(-2.0, 2.0, (20, 2))
    run = fm.integrate(fm.System(walled, ["x", "v"], {}), starts, 10.0, tol=tol)
    right = starts * math.cos(10.0) + starts[:, ::-1] * [math.sin(10.0), -math.sin(10.0)]
    true = np.abs(run.y[0] - right).max(axis=1)
    assert run.error is not None
    assert np.min(run.error / true) >= 1.0 / 3.0
    assert np.max(run.error / true) <= 3.0


def dry(t: float, x: float, v: float) -> tuple[float, float]:
    return v, -x - 0.3 * np.sign(v)


def test_what_slides_along_a_border_has_no_error_that_is_known() -> None:
    """Coulomb friction: x goes from turn to turn by 2 mu less, and sticks where less than mu pulls."""
    starts = np.array([[1.0, 0.0], [2.05, 0.0]])
    run = fm.integrate(fm.System(dry, ["x", "v"], {}), starts, t_eval=[1.0, 2.0, 20.0], tol=1e-5)
    assert run.error is not None
    assert np.isinf(run.error).all()
    assert "along a branch's border" in str(run.reason)
    early = fm.integrate(fm.System(dry, ["x", "v"], {}), starts, t_eval=[1.0, 2.0], tol=1e-5)
    assert early.error is not None
    assert early.error.max() <= 1e-5
    np.testing.assert_allclose(early.y[1, :, 0], 0.3 + (starts[:, 0] - 0.3) * math.cos(2.0), atol=1e-5)


def trap(t: float, x: float, width: float) -> tuple[float]:
    return (1.0 if x < 0.0 or x > width else 0.25,)


def pulse(t: float, x: float, width: float) -> tuple[float]:
    return (1.0 / width if 1.0 < t < 1.0 + width else 0.0,)


@pytest.mark.parametrize("width", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize(
    ("rhs", "ends"),
    [
        (trap, lambda x, width: x + 4.0 - 3.0 * width),  # through the window at a quarter of the speed
        (pulse, lambda x, width: x + 1.0),
    ],
)
def test_a_window_however_narrow_is_passed_step_by_step(rhs: Any, ends: Any, width: float) -> None:
    starts = np.linspace(-2.0, -0.5, 7)[:, None]
    run = fm.integrate(fm.System(rhs, ["x"], {"width": width}), starts, 4.0, tol=1e-6)
    assert run.error is not None
    assert run.error.max() <= 1e-6
    np.testing.assert_allclose(run.y[-1], ends(starts, width), rtol=0.0, atol=1e-7)


def test_a_smooth_condition_that_turns_over_and_back_is_seen() -> None:
    """x' = 1, and y' = 1 where x^2 < w^2: steps are exact, so nothing but the condition keeps them short."""
    for width in (1e-3, 1e-6):
        system = fm.System(counted, ["x", "y"], {"width": width})
        run = fm.integrate(system, [[-1.0, 0.0], [-0.3, 0.0]], 4.0, tol=1e-6)
        assert run.error is not None
        assert run.error.max() <= 1e-6
        np.testing.assert_allclose(run.y[-1, :, 1], 2.0, rtol=0.0, atol=1e-6)


def counted(t: float, x: float, y: float, width: float) -> tuple[float, float]:
    return 1.0, (1.0 / width if x * x < width * width else 0.0)


def arrived(t: float, x: float, v: float) -> float:
    return 2.0 if x < -0.12 else 0.0


def test_stops_are_located_between_branches_too() -> None:
    """A fall onto a spring: the deepest point that is looked for lies in it."""
    system = fm.System(bouncing, ["x", "v"], {"stiff": 100.0}, stop=arrived)
    run = fm.integrate(system, [[0.5, 0.0], [0.01, 0.0]], 1.0, tol=1e-8)
    assert run.stop_code is not None
    assert run.stop_time is not None
    np.testing.assert_array_equal(run.stop_code, [2, 0])
    v0, t0 = -math.sqrt(9.81), 1.0 / math.sqrt(9.81)
    # x'' = -9.81 - 100 x - 20 x': critical damping, closed form
    rest = -0.0981

    def depth(s: float) -> float:
        return rest + math.exp(-10.0 * s) * (-rest + (v0 - 10.0 * rest) * s) + 0.12

    assert run.stop_time[0] == pytest.approx(t0 + brentq(depth, 0.0, 0.08), abs=1e-7)


def sawtooth(t: float, x: float, v: float) -> tuple[float, float]:
    return v, 1.0 - 0.1 * v - 0.5 * np.arctan2(fm.sin(x), fm.cos(x))


def test_an_angle_that_wraps_jumps() -> None:
    """The angle of (cos x, sin x) goes from pi to -pi at odd multiples of pi: SciPy stops there."""
    starts = np.random.default_rng(0).uniform([-1.0, 4.0], [1.0, 8.0], (24, 2))
    run = fm.integrate(fm.System(sawtooth, ["x", "v"], {}), starts, 8.0, tol=1e-6)
    assert np.isfinite(run.error).mean() >= 0.5

    def wraps(t: float, y: Floats, turn: float) -> float:
        return float(abs(y[0] - turn) - math.pi)

    wraps.terminal, wraps.direction = True, 1.0  # type: ignore[attr-defined]
    for k in np.flatnonzero(np.isfinite(run.error)):
        t, y = 0.0, starts[k]
        while t < 8.0:
            # The middle of the turn in which the motion goes on.
            turn = 2.0 * math.pi * np.round((y[0] + 1e-9 * np.sign(y[1])) / (2.0 * math.pi))
            done = solve_ivp(
                lambda t, y, c: (y[1], 1.0 - 0.1 * y[1] - 0.5 * (y[0] - c)),
                (t, 8.0), y, args=(turn,), events=wraps, rtol=1e-11, atol=1e-12,
            )  # fmt: skip
            t, y = float(done.t[-1]), done.y[:, -1]
            y[0] += 1e-12 * np.sign(y[1]) * (t < 8.0)
        assert np.abs(run.y[-1, k] - y).max() <= 1e-5


@pytest.mark.parametrize("quantile", [0.5, 0.9])
@pytest.mark.slow
def test_below_the_largest_error_single_errors_are_said_to_be_unknown(quantile: float) -> None:
    starts = np.random.default_rng(0).uniform(-1.0, 1.0, (600, 2))
    run = fm.integrate(
        fm.System(bilinear, ["x", "v"], {"stiff": 4.0}), starts, 2.0, tol=1e-3, quantile=quantile
    )
    assert "branches: errors of single trajectories are not known" in str(run.reason)
    smooth = fm.integrate(fm.System(linear, ["x", "v"], {}), starts, 2.0, tol=1e-3, quantile=quantile)
    assert "branches" not in str(smooth.reason)


def linear(t: float, x: float, v: float) -> tuple[float, float]:
    return v, -x


def test_a_method_that_is_asked_for_is_kept_and_measured() -> None:
    starts = np.random.default_rng(0).uniform(-1.0, 1.0, (20, 2))
    system = fm.System(bilinear, ["x", "v"], {"stiff": 4.0})
    right = fm.integrate(system, starts, 20.0, tol=1e-10).y
    run = fm.integrate(system, starts, 20.0, tol=1e-4, method="rk4")
    assert run.method == "rk4"
    assert run.error is not None
    true = np.abs(run.y - right).max(axis=(0, 2))
    assert (true <= run.error + 1e-9).all()


def test_a_branch_whose_source_is_not_at_hand_makes_errors_unknown() -> None:
    made: dict[str, Any] = {}
    exec("def rhs(t, x):\n    return (1.0 if x < 0.5 else 2.0,)\ndef even(t, x):\n    return (-x,)", made)
    run = fm.integrate(fm.System(made["rhs"], ["x"], {}), [[0.0]], 1.0, tol=1e-4)
    assert run.error is not None
    assert np.isinf(run.error).all()
    assert "source is not at hand" in str(run.reason)
    smooth = fm.integrate(fm.System(made["even"], ["x"], {}), [[1.0]], 1.0, tol=1e-4)
    assert smooth.error is not None
    assert smooth.error.max() <= 1e-4


def test_threads_and_companions_do_not_matter() -> None:
    system = fm.System(bilinear, ["x", "v"], {"stiff": 4.0})
    starts = np.random.default_rng(0).uniform(-1.0, 1.0, (30, 2))
    one, three = (fm.integrate(system, starts, 20.0, tol=1e-5, threads=threads) for threads in (1, 3))
    np.testing.assert_array_equal(one.y, three.y)
    np.testing.assert_array_equal(one.error, three.error)
    some = fm.integrate(system, np.insert(starts[7:9], 1, np.nan, axis=0), 20.0, tol=1e-5)
    np.testing.assert_array_equal(some.y[:, [0, 2]], one.y[:, 7:9])
    assert some.status[1] == fm.Status.START_NOT_FINITE
    told: list[int] = []
    fm.integrate(system, starts, 20.0, tol=1e-5, progress=told.append)
    assert sum(told) == 30


@pytest.mark.slow
def test_smooth_systems_lose_nothing() -> None:
    """Own systems without branches: at most 1 % have no error that is known, and no claim is wrong."""
    rng = np.random.default_rng(6)
    for rhs, names, starts, t_end in (
        (pendulum, ["x", "v"], rng.uniform([-2.6, -10.0], [3.7, 10.0], (300, 2)), 50.0),
        (duffing, ["x", "v"], rng.uniform(-1.0, 1.0, (300, 2)), 50.0),
        (lorenz, ["x", "y", "z"], rng.uniform([-10.0, -10.0, 10.0], [10.0, 10.0, 30.0], (300, 3)), 5.0),
    ):
        system = fm.System(rhs, names, {})
        assert system.switches is None
        run = fm.integrate(system, starts, t_end, tol=1e-5)
        right = fm.integrate(system, starts, t_end, dt=0.001, method="dop853").y
        assert run.error is not None
        known = np.isfinite(run.error)
        assert known.mean() >= 0.99
        assert (np.abs(run.y - right).max(axis=(0, 2))[known & (run.error <= 1e-5)] <= 1e-4).all()


def pendulum(t: float, x: float, v: float) -> tuple[float, float]:
    return v, -0.1 * v + 0.5 - fm.sin(x)


def duffing(t: float, x: float, v: float) -> tuple[float, float]:
    return v, -0.08 * v - x**3 + 0.2 * fm.cos(t)


def lorenz(t: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    return 10.0 * (y - x), x * (28.0 - z) - y, x * y - 8.0 / 3.0 * z


@pytest.mark.parametrize("formulation", ["lagrange", "hamilton"])
def test_loads_that_jump_move_a_mass_as_the_closed_form_says(formulation: Any) -> None:
    """A mass of 4 kg on a spring; a pulse from 1 s to 1.5 s adds what two steps of force bring."""
    x = fm.lengths("x", -50.0, 50.0)
    pulse = fm.loads.Pulse(3.0, start=1.0, duration=0.5)
    device = fm.Mechanism(
        x, {}, points={"P": (x, 0)}, masses={"P": 4}, potential=9 * x**2 / 2,
        forces=[fm.Force("P", pulse, (1, 0))],
    )  # fmt: skip
    times, w = np.array([0.5, 1.2, 3.0]), 1.5
    right = np.column_stack(
        [np.cos(w * times) + 2.0 / w * np.sin(w * times), 2.0 * np.cos(w * times) - w * np.sin(w * times)]
    )
    for begin, sign in ((1.0, 1.0), (1.5, -1.0)):
        since = np.maximum(times - begin, 0.0)
        right += sign / 3.0 * np.column_stack([1.0 - np.cos(w * since), w * np.sin(w * since)])
    run = fm.integrate(device, [1.0, 2.0], t_eval=times, tol=1e-9, formulation=formulation)
    assert np.abs(run.y[:, 0] - right).max() <= 1e-9
    scene, start = fm.Scene(load=fm.loads.Pulse(80.0, start=0.5, duration=0.5)), [1.5, 0.2, 0.5, 1.0]
    fixed = fm.integrate(scene, start, 1.0, dt=1e-3, method="dop853").y
    assert np.abs(fm.integrate(scene, start, 1.0, tol=1e-9, formulation=formulation).y - fixed).max() <= 1e-9


def test_what_a_start_gets_does_not_depend_on_how_many_there_are() -> None:
    """A mass between a spring and a stop takes some 17,000 steps to 1e-8."""

    def stop(t, x, v):  # type: ignore[no-untyped-def]
        return v, -x - 0.02 * v - (10.0 * (x - 0.5) if x > 0.5 else 0.0) + 0.5 * math.cos(0.7 * t)

    system, starts = fm.System(stop, ["x", "v"], {}), np.random.default_rng(1).uniform(-2.0, 2.0, (300, 2))
    many, few = (fm.integrate(system, some, 100.0, tol=1e-8) for some in (starts, starts[:3]))
    assert many.error is not None
    assert (many.error <= 1e-8).all()
    assert np.array_equal(many.y[:, :3], few.y)


@pytest.mark.slow
def test_a_quantile_is_that_of_all_where_few_err_more() -> None:
    """Few swing widely; against steps that end at the branch, for each start (tested above)."""
    system = fm.System(
        lambda t, x, v: (v, -9.0 * x * (1.0 + x * x) - (2.0 if x > 0.5 else 0.0)), ["x", "v"], {}
    )
    for seed in range(6):
        rng = np.random.default_rng(seed)
        starts = rng.uniform(-0.4, 0.4, (500, 2))
        starts[rng.choice(500, 15, replace=False)] *= 12.0
        known = fm.integrate(system, starts, t_eval=[2.0, 4.0], tol=1e-10)
        run = fm.integrate(system, starts, t_eval=[2.0, 4.0], tol=1e-3, quantile=0.99)
        error = np.sort(np.abs(run.y - known.y).max(axis=(0, 2)))[math.ceil(0.99 * 500) - 1]
        assert error <= min(1e-3, 3.0 * run.error_estimate)
