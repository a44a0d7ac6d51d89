"""Decisions that a function's source hides: no claim about them, and none where there are none."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
import pytest

import fastmech as fm
from fastmech.ensembles.switches import MOST_NOTES, UnclearError

LOW, HIGH = 7.0, 7.002


@numba.njit
def window(_: float, x: float) -> float:
    return 1.0 if (x - 7.0) * (x - 7.002) < 0.0 else 0.0


@numba.njit
def fill(y: Any, out: Any) -> None:
    out[0] = 1.0
    out[1] = (y[0] - 7.0) * (y[0] - 7.002)


@numba.njit
def soft(x: float, k: float = 2.0) -> float:
    return math.tanh(k * x)


def in_a_comprehension(t, x, y):
    return 1.0, 5e3 * sum([1.0 if (v - LOW) * (v - HIGH) < 0.0 else 0.0 for v in (x, x)])


def by_a_starred_argument(t, x, y):
    return 1.0, 1e4 * window(*(0.0, x))


def in_an_inner_function(t, x, y):
    def inside(v):
        return 1e4 if (v - LOW) * (v - HIGH) < 0.0 else 0.0

    return 1.0, inside(x)


def by_an_array_s_maximum(t, x, y):
    a = np.zeros(2)
    a[1] = 1.0 - ((x - 7.001) / 1e-3) ** 2
    return 1.0, 1.5e4 * a.max()


def by_an_array_s_order(t, x, y):
    a = np.zeros(2)
    a[1] = 1.0 - ((x - 7.001) / 1e-3) ** 2
    a.sort()
    return 1.0, 1.5e4 * a[1]


def by_an_array_of_integers(t, x, y):
    n = np.zeros(1, np.int64)
    n[0] = (x - 7.0) / 2e-3 + 1e5
    return 1.0, 1e4 / (1.0 + 1e6 * float((n[0] - 100000) ** 2))


def by_bits(t, x, y):
    a = np.zeros(1)
    b = a.view(np.int64)
    a[0] = (x - 7.0) * (x - 7.002)
    return 1.0, 1e4 * float((b[0] >> 63) & 1)


def by_what_is_no_number(t, x, y):
    return 1.0, 0.0 if np.isnan(math.sqrt((x - 7.0) * (7.002 - x))) else 1e4


def by_a_rounding_in_place(t, x, y):
    r = (x - 7.0) / 2e-3
    r //= 1.0
    return 1.0, 1e4 / (1.0 + 1e6 * r * r)


def by_a_complex_angle(t, x, y):
    return 1.0, 1e4 / math.pi * np.log((x - 7.0) * (x - 7.002) + 0j).imag


def by_roots_of_squares(t, x, y):
    a, b = x - 7.0, x - 7.002
    return 1.0, 5e3 * (a / math.sqrt(a * a) - b / (b**2) ** 0.5)


def by_lengths_of_one_side(t, x, y):
    a, b = x - 7.0, x - 7.002
    return 1.0, 5e3 * (a / math.hypot(a, 0.0) - b / np.hypot(0.0, b))


def by_a_diagonal(t, x, y):
    a = x - 7.0
    return 1.0, 5e3 * a / math.hypot(a, a)


def by_an_angle_of_its_tangent(t, x, y):
    return 1.0, 1e4 / math.pi * (math.atan(math.tan(x - 7.0)) - math.atan(math.tan(x - 7.002)) + 0.002)


HIDDEN = [
    by_roots_of_squares,
    by_lengths_of_one_side,
    by_a_diagonal,
    by_an_angle_of_its_tangent,
    in_a_comprehension,
    in_an_inner_function,
    by_an_array_s_maximum,
    by_an_array_s_order,
    by_an_array_of_integers,
    by_bits,
    by_what_is_no_number,
    by_a_rounding_in_place,
    by_a_complex_angle,
]


def beside_a_remainder_of_integers(t, x, y, k):
    total = 0.0
    for i in range(4):
        total += 0.25 * (1.0 if k > 0.5 else 2.0) if i % 2 == 0 else float(i // 2) * 0.0
    return total, 1e4 if (x - LOW) * (x - HIGH) < 0.0 else 0.0


def by_numpy_s_choice(t, x, y):
    return 1.0, np.where(np.logical_and(np.less((x - LOW) * (x - HIGH), 0.0), True), 1e4, 0)


NOTED = [by_a_starred_argument, by_numpy_s_choice, beside_a_remainder_of_integers]


def with_a_name(t, x, y):
    return y, -x - 0.3 * soft(x=y, k=2.0)


def with_an_inner_function(t, x, y):
    square = lambda v: v * v  # noqa: E731
    return y, -x - 0.1 * square(y)


def with_arrays(t, x, y):
    return y, -x - 0.1 * np.prod(np.array([x, y])) * np.array([x, y]).dot(np.array([1.0, 2.0]))


def with_complex_numbers(t, x, y):
    z = complex(x, y)
    return y, -x - 0.1 * (z * z).real


def with_roots_and_powers(t, x, y):
    return y, -x - 0.1 * (x * x + 1.0) ** 0.5 * math.sqrt(1.0 + y * y) - 0.1 * math.hypot(1.0, y) ** 1.5


def with_lengths(t, x, y, k):
    return y, -x / (math.hypot(x - 1.0, y) + 1.0) - 0.1 * np.hypot(k, y) * math.hypot(k, 0.0)


def with_a_gamma_function(t, x, y):
    return y, -x - 0.1 * math.gamma(2.0 + x * x)


def with_a_choice_by_a_parameter(t, x, y, k):
    return y, (-x if k > 0.5 else -x * x * x) * (abs(k) + 1.0) - 0.1 * fm.sin(y)


def with_numpy_s_choice_by_a_parameter(t, x, y, k):
    return y, np.where(k > 0.5, -x, -x * x * x) - 0.1 * fm.sin(y)


SMOOTH = [
    with_a_name,
    with_an_inner_function,
    with_arrays,
    with_complex_numbers,
    with_roots_and_powers,
    with_lengths,
    with_a_gamma_function,
    with_a_choice_by_a_parameter,
    with_numpy_s_choice_by_a_parameter,
]


def system(rhs: Callable[..., Any]) -> fm.System:
    return fm.System(rhs, ["x", "y"], {"k": 1.0} if "k" in rhs.__code__.co_varnames else {})


@pytest.mark.parametrize("rhs", HIDDEN)
def test_a_decision_that_the_source_hides_is_seen(rhs: Callable[..., Any]) -> None:
    with pytest.raises(UnclearError):
        _ = system(rhs).switches


def test_what_is_not_located_is_named_with_its_line() -> None:
    line = by_an_array_s_maximum.__code__.co_firstlineno + 3
    with pytest.raises(UnclearError, match=rf"a\.max.*, line {line}; .* `a if c else b`"):
        _ = system(by_an_array_s_maximum).switches


@pytest.mark.parametrize("rhs", NOTED)
def test_a_decision_is_noted_wherever_it_is_called_from(rhs: Callable[..., Any]) -> None:
    seen = np.zeros(1 + 2 * MOST_NOTES)
    system(rhs).switches(0.0, np.array([7.001, 0.0]), np.ones(len(system(rhs).parameters)), seen)
    value, outcome = (7.001 - LOW) * (7.001 - HIGH), 1.0
    pairs = seen[1 : 1 + 2 * int(seen[0])].reshape(-1, 2)
    assert (np.abs(pairs - [value, outcome]).max(axis=1) < 1e-15).any()


@pytest.mark.parametrize("rhs", SMOOTH)
def test_what_decides_nothing_by_its_state_is_smooth(rhs: Callable[..., Any]) -> None:
    assert system(rhs).switches is None


SIDES, PULL = np.array([-9.0, 0.0, 9.0]), np.array([-18.0, 0.0, 9.0])
TIMES = np.linspace(0.0, 10.0, 42)
DRIVE = np.random.default_rng(4).normal(0.0, 2.0, 42)


def on_two_springs(t, x, y):
    return y, -np.interp(x, SIDES, PULL)


def by_a_table_of_times(t, x, y):
    return np.interp(t, TIMES, DRIVE), x - y


def test_knots_of_a_table_of_states_end_steps() -> None:
    """Half a turn on a spring of 1 and half on one of 2: back at the start after 3 of both."""
    starts = np.column_stack([np.linspace(0.3, 3.0, 20), np.zeros(20)])
    run = fm.integrate(system(on_two_springs), starts, 3.0 * np.pi * (1.0 + 0.5**0.5), tol=1e-8)
    assert run.error is not None
    assert (run.error <= 1e-8).all()
    np.testing.assert_allclose(run.y[-1], starts, atol=1e-8)


def test_knots_of_a_table_of_times_end_steps() -> None:
    """The first state is the broken line's integral."""
    starts = np.column_stack([np.linspace(-1.0, 1.0, 20), np.zeros(20)])
    run = fm.integrate(system(by_a_table_of_times), starts, 10.0, tol=1e-8)
    assert run.error is not None
    assert (run.error <= 1e-8).all()
    integral = np.diff(TIMES) @ (DRIVE[1:] + DRIVE[:-1]) / 2.0
    np.testing.assert_allclose(run.y[-1, :, 0], starts[:, 0] + integral, atol=1e-8)


def test_a_table_that_is_made_on_the_way_is_not_located() -> None:
    def rhs(t, x, y):
        return y, -np.interp(x, SIDES, PULL * t)

    with pytest.raises(UnclearError, match=r"np\.interp in a way that is not known"):
        _ = system(rhs).switches


def test_rates_that_a_callee_wrote_and_that_are_compared() -> None:
    def rhs(t, y, p, rates):
        fill(y, rates)
        rates[1] = 1e4 if rates[1] < 0.0 else 0.0

    with pytest.raises(UnclearError):
        _ = fm.System(rhs, ("y", 2), {}).switches


def test_a_step_that_begins_on_the_edge_of_a_window() -> None:
    """Of 6,000 starts some come to x = 7 exactly: there the value compared is 0, and rises on both sides."""

    def rhs(t, x, y):
        return 1.0, 1e4 if (x - 7.0) * (x - 7.002) < 0.0 else 0.0

    starts = np.column_stack([np.random.default_rng(3).uniform(0.0, 5.0, 6000), np.zeros(6000)])
    run = fm.integrate(fm.System(rhs, ["x", "y"], {}), starts, 10.0, tol=1e-4)
    np.testing.assert_allclose(run.y[-1, :, 1], 20.0, atol=1e-3)
    assert run.error is not None
    assert (run.error <= 1e-4).all()


def test_hidden_decisions_leave_no_error_claimed() -> None:
    """Every step passes over the window of 0.002 in x, in which y grows by 20."""
    starts = np.column_stack([np.linspace(0.0, 5.0, 20), np.zeros(20)])
    run = fm.integrate(system(by_roots_of_squares), starts, 10.0, tol=1e-4)
    assert run.error is not None
    claimed = np.isfinite(run.error)
    assert (np.abs(run.y[-1, claimed, 1] - 20.0) <= 1e-3).all()
    assert "decides where its source does not show it" in str(run.reason)
