"""Where a trajectory stops: closed forms, for each family of methods and any number of threads."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import fastmech as fm
from fastmech.ensembles.ends import STOP_CODE, STOP_STATE, STOP_TIME
from fastmech.ensembles.run import run_ensemble
from fastmech.ensembles.system import System
from fastmech.integrators.methods import find_method

OMEGA, N, T_END = 1.3, 48, 10.0


def oscillator(t: float, x: float, v: float, omega: float) -> tuple[float, float]:
    return v, -omega * omega * x


def left(t: float, x: float, v: float) -> float:
    return 3.0 if x < 0.0 else 0.0


SYSTEM = System(oscillator, ["x", "v"], {"omega": OMEGA}, stop=left)


def starts() -> np.ndarray:
    rng = np.random.default_rng(0)
    return np.stack([rng.uniform(0.1, 2.0, N), rng.uniform(-1.0, 1.0, N)], axis=1)


def stops(y0: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """x = R cos(omega t - d) falls through zero at omega t = d + pi/2, with v = -R omega."""
    size, d = np.hypot(y0[:, 0], y0[:, 1] / OMEGA), np.arctan2(y0[:, 1] / OMEGA, y0[:, 0])
    return (0.5 * np.pi + d) / OMEGA, np.stack([np.zeros(len(y0)), -size * OMEGA], axis=1)


@pytest.mark.parametrize(("tol", "method"), [(1e-3, None), (1e-6, None), (1e-10, None), (1e-6, "radau5")])
def test_time_and_state_of_a_stop_keep_the_tolerance(tol: float, method: str | None) -> None:
    time, state = stops(starts())
    run = fm.integrate(SYSTEM, starts(), T_END, tol=tol, method=method)
    assert run.error is not None
    assert run.error_estimate is not None
    assert run.stop_time is not None
    true = np.abs(run.y[-1] - state).max(axis=1)
    assert (run.stop_code == 3).all()
    assert true.max() <= tol
    assert true.max() / 3.0 <= run.error_estimate <= 3.0 * true.max()
    # Within the state's error over its speed there, at least 0.1 omega^2.
    assert np.abs(run.stop_time - time).max() <= tol / (0.1 * OMEGA)
    assert run.trajectory_steps.max() < 2000


def test_outputs_before_and_after_the_stop() -> None:
    y0 = starts()
    time, _ = stops(y0)
    times = np.linspace(0.5, T_END, 20)
    run = fm.integrate(SYSTEM, y0, t_eval=times, tol=1e-8)
    d, size = np.arctan2(y0[:, 1] / OMEGA, y0[:, 0]), np.hypot(y0[:, 0], y0[:, 1] / OMEGA)
    x = size * np.cos(OMEGA * np.minimum(times[:, None], time) - d)
    np.testing.assert_allclose(run.y[..., 0], x, rtol=0, atol=1e-8)
    np.testing.assert_array_equal(run.y[-1], run.y[times > time.max()][0])


def test_a_start_that_meets_the_condition_stops_there() -> None:
    run = fm.integrate(SYSTEM, [[-1.0, -1.0], [1.0, 0.0]], T_END, tol=1e-6)
    assert run.stop_time is not None
    assert run.stop_time[0] < 1e-12
    np.testing.assert_allclose(run.y[-1, 0], [-1.0, -1.0], atol=1e-12)


def test_stops_do_not_depend_on_threads_or_companions() -> None:
    y0 = starts()
    one, three = (fm.integrate(SYSTEM, y0, T_END, tol=1e-6, threads=k) for k in (1, 3))
    np.testing.assert_array_equal(one.y, three.y)
    np.testing.assert_array_equal(one.stop_time, three.stop_time)
    np.testing.assert_array_equal(one.error, three.error)


@pytest.mark.parametrize(("name", "order"), [("rk4", 4), ("ab6", 6), ("radau3", 3)])
def test_a_located_stop_has_the_method_s_order(name: str, order: int) -> None:
    """Halved steps: the stop's time comes nearer by 2^p."""
    watch = replace(SYSTEM.observation, locate=True)
    errors = []
    for steps in (48, 96):
        run = run_ensemble(
            SYSTEM.kernel, [OMEGA], [[1.0, 0.0]], [0.0, 2.0], 2.0 / steps, find_method(name), watch
        )
        assert run.records[STOP_CODE, 0] == 3.0
        assert abs(run.records[STOP_STATE, 0]) < 1e-9
        errors.append(abs(run.records[STOP_TIME, 0] - 0.5 * np.pi / OMEGA))
    assert 2.0 ** (order - 0.6) < errors[0] / errors[1] < 2.0 ** (order + 1.6)


def passed(t: float, x: float, v: float, level: float, omega: float) -> float:
    return omega if x > level else 0.0


def family_passed(t: float, y: np.ndarray, p: np.ndarray) -> float:
    return 3.0 if y[0] > p[1] else 0.0


def family(t: float, y: np.ndarray, p: np.ndarray, rates: np.ndarray) -> None:
    for i in range(y.size):
        rates[i] = p[0]


def steady(t: float, x: float, v: float, omega: float, level: float) -> tuple[float, float]:
    return v, 0.0 * x * omega * level


@pytest.mark.parametrize(
    ("how", "allowed"),
    [
        ({"tol": 1e-9}, 1e-9),
        ({"tol": 1e-9, "method": "radau5"}, 1e-9),
        ({"dt": 0.01}, 0.0101),
        ({"dt": 0.01, "method": "abm8"}, 0.0101),
    ],
)
def test_a_stop_knows_each_trajectory_s_parameters(how: dict[str, Any], allowed: float) -> None:
    """x = v t passes a level of its own."""
    rng = np.random.default_rng(3)
    level, y0 = rng.uniform(0.5, 5.0, 700), np.stack([np.zeros(700), rng.uniform(1.0, 2.0, 700)], axis=1)
    system = System(steady, ["x", "v"], {"level": 9.0, "omega": 2.0}, stop=passed)
    run = fm.integrate(system, y0, t_end=10.0, parameters={"level": level}, **how)
    assert run.stop_time is not None
    assert (run.stop_code == 2).all()
    late = run.stop_time - level / y0[:, 1]
    assert late.min() > -1e-9
    assert late.max() < allowed


def test_a_stop_of_a_family_takes_parameters() -> None:
    system = System(family, ("x", 3), {"rate": 2.0, "level": 4.0}, stop=family_passed)
    run = fm.integrate(system, np.zeros((5, 3)), 10.0, 0.25, parameters={"level": np.arange(1.0, 6.0)})
    np.testing.assert_allclose(run.stop_time, [0.75, 1.25, 1.75, 2.25, 2.75])


def test_a_stop_that_asks_for_what_is_no_parameter_is_refused() -> None:
    with pytest.raises(fm.InputError, match="stop: takes"):
        System(oscillator, ["x", "v"], {"omega": 1.0}, stop=passed)


def free(t: float, x: float, v: float) -> tuple[float, float]:
    return v, -x


def beyond(t: float, x: float, v: float) -> int:
    return 1 if x > 1.0 else (2 if x < -1.0 else 0)


@pytest.mark.parametrize("tol", [1e-3, 1e-7])
@pytest.mark.parametrize("quantile", [1.0, 0.99])
def test_a_stop_shorter_than_a_step_is_found(tol: float, quantile: float) -> None:
    """Vibrations of amplitudes slightly over and under the limit: the arc sine tells when they reach it."""
    rng = np.random.default_rng(8)
    over = 1.0 + rng.choice([-1.0, 1.0], 200) * 10.0 ** rng.uniform(-8.0, -0.5, 200)
    phase = rng.uniform(-0.7, 0.3, 200)
    y0 = over[:, None] * np.column_stack([np.sin(phase), np.cos(phase)])
    system = System(free, ["x", "v"], stop=beyond)
    run = fm.integrate(system, y0, 10.0, tol=tol, quantile=quantile)
    assert run.stop_time is not None
    assert run.error_estimate is not None
    np.testing.assert_array_equal(run.stop_code, over > 1.0)
    hit = over > 1.0
    assert np.abs(run.stop_time - (np.arcsin(1.0 / np.fmax(over, 1.0)) - phase))[hit].max() < 2e-2
    assert run.error_estimate <= tol
    assert "may stop for less than a step" in str(run.reason)


def within(t: float, x: float, v: float) -> bool:
    return x < 1.0 and x > 0.9


def test_a_window_is_found_whatever_comparison_comes_first() -> None:
    """Vibrations pass it in a part of a step; the second comparison is not made at every look."""
    amplitude, phase = np.linspace(2.0, 6.0, 100), np.linspace(-0.7, 0.1, 100)
    y0 = amplitude[:, None] * np.column_stack([np.sin(phase), np.cos(phase)])
    run = fm.integrate(System(free, ["x", "v"], stop=within), y0, 6.0, tol=1e-6)
    np.testing.assert_allclose(run.stop_time, np.arcsin(0.9 / amplitude) - phase, atol=1e-5)


def thrown(t: float, x: float, y: float, u: float, v: float) -> tuple[float, float, float, float]:
    return u, v, 0.0, -9.81


def at_target(t: float, x: float, y: float, u: float, v: float) -> bool:
    return np.hypot(x - 6.0, y - 2.0) < 0.3


def test_a_distance_is_looked_at_between_steps() -> None:
    """Balls thrown at a target: roots of a quartic tell which come within reach, and when."""
    rng = np.random.default_rng(2)
    u, v = rng.uniform(2.0, 8.0, 400), rng.uniform(5.0, 12.0, 400)
    system = System(thrown, ["x", "y", "u", "v"], stop=at_target)
    run = fm.integrate(system, np.column_stack([0.0 * u, 0.0 * u, u, v]), 2.0, tol=1e-6)
    assert run.stop_time is not None
    hits = 0
    for k in range(400):
        square = np.polyadd(np.polymul([u[k], -6.0], [u[k], -6.0]), [-0.09])
        height = [-4.905, v[k], -2.0]
        roots = np.roots(np.polyadd(square, np.polymul(height, height)))
        times = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0.0) & (roots.real < 2.0)]
        hits += times.size > 0
        assert (
            run.stop_time[k] == pytest.approx(times.min(), abs=1e-5) if times.size else not run.stop_code[k]
        )
    assert hits > 20


def test_a_start_within_the_condition_stops_there_also_if_one_step_leaves_it() -> None:
    run = fm.integrate(System(free, ["x", "v"], stop=beyond), [[1.16181949, 0.51768152]], 12.0, tol=1e-4)
    np.testing.assert_allclose(run.stop_time, 0.0, atol=1e-9)
    np.testing.assert_allclose(run.y[-1, 0], [1.16181949, 0.51768152], atol=1e-4)
    assert run.error_estimate is not None
    assert run.error_estimate <= 1e-4


def test_where_no_condition_can_be_read_it_is_told() -> None:
    names: dict[str, Any] = {}
    exec("def unread(t, x, v):\n    return x > 0.5", names)
    run = fm.integrate(System(free, ["x", "v"], stop=names["unread"]), [[0.0, 1.0]], 1.0, tol=1e-4)
    assert "may be missed" in str(run.reason)


def kepler(t: float, x: float, y: float, u: float, v: float) -> tuple[float, float, float, float]:
    cubed = (x * x + y * y) ** 1.5
    return u, v, -x / cubed, -y / cubed


def near_the_sun(t: float, x: float, y: float, u: float, v: float) -> bool:
    return np.sqrt(x * x + y * y) < 0.5


def test_stops_between_steps_are_located_to_rounding() -> None:
    """Kepler's equation tells when ellipses come within a distance of the sun."""
    e, begin = np.linspace(0.52, 0.65, 20), np.linspace(1.6, 4.6, 20)
    x, y, r = np.cos(begin) - e, np.sqrt(1.0 - e * e) * np.sin(begin), 1.0 - e * np.cos(begin)
    y0 = np.column_stack([x, y, -np.sin(begin) / r, np.sqrt(1.0 - e * e) * np.cos(begin) / r])
    end = 2.0 * np.pi - np.arccos(0.5 / e)
    exact = end - e * np.sin(end) - begin + e * np.sin(begin)
    run = fm.integrate(System(kepler, ["x", "y", "u", "v"], stop=near_the_sun), y0, 12.0, tol=1e-8)
    assert run.error is not None
    assert (run.error <= 1e-8).all()
    np.testing.assert_allclose(run.stop_time, exact, atol=1e-8)
