"""Outward rounding against exact rationals and mpmath's intervals, compiled and in Python."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from fastmech import jit
from fastmech.intervals import arithmetic
from fastmech.intervals.arithmetic import Interval

RATIONAL: dict[str, Callable[[Fraction, Fraction], Fraction]] = {
    "add": lambda x, y: x + y,
    "sub": lambda x, y: x - y,
    "mul": lambda x, y: x * y,
    "div": lambda x, y: x / y,
}
FUNCTIONS = (
    *("sin", "cos", "sqrt", "exp", "log", "atan", "asin", "acos", "sinh", "cosh", "tanh"),
    *("asinh", "acosh", "atanh"),
)
POWERS = (1, 2, 3, 4, 7)


def intervals(seed: int, n: int) -> list[Interval]:
    """Huge, tiny, narrow, wide, of one number, straddling zero, beside multiples of pi / 2, up to 1."""
    rng = np.random.default_rng(seed)
    centres = np.concatenate(
        [
            rng.normal(size=n) * 10.0 ** rng.uniform(-12, 8, n),
            rng.normal(size=n // 4) * 10.0 ** rng.uniform(-320, 300, n // 4),
            rng.integers(-40, 40, n // 2) * (np.pi / 2) + rng.normal(size=n // 2) * 1e-15,
            rng.integers(-100_000, 100_000, n // 4) * (np.pi / 2),
            rng.integers(-9, 9, n // 4).astype(float),
            np.sign(rng.normal(size=n // 4)) * (1.0 - 10.0 ** rng.uniform(-17, 0, n // 4)),
        ]
    )
    widths = np.abs(centres) * 10.0 ** rng.uniform(-17, 1, centres.size)
    widths[rng.random(centres.size) < 0.2] = 0.0
    low, high = centres - widths * rng.random(centres.size), centres + widths
    within = (np.abs(centres) <= 1.0) & (rng.random(centres.size) < 0.5)
    low[within], high[within] = np.maximum(low[within], -1.0), np.minimum(high[within], 1.0)
    return list(zip(low.tolist(), high.tolist(), strict=True))


def array_of(function: Any, arguments: int, n: int = 0) -> Any:
    """The function over rows of ends, compiled with fused products allowed around it."""
    if arguments == 2:

        def over(a: Any, b: Any, out: Any) -> None:
            for i in range(len(a)):
                out[i, 0], out[i, 1] = function((a[i, 0], a[i, 1]), (b[i, 0], b[i, 1]))

    elif n:

        def over(a: Any, b: Any, out: Any) -> None:
            for i in range(len(a)):
                out[i, 0], out[i, 1] = function((a[i, 0], a[i, 1]), n)

    else:

        def over(a: Any, b: Any, out: Any) -> None:
            for i in range(len(a)):
                out[i, 0], out[i, 1] = function((a[i, 0], a[i, 1]))

    return njit(over, error_model="numpy", fastmath={"contract"})


def evaluated(name: str, arguments: int, n: int = 0) -> tuple[list[Interval], list[Interval], list[Interval]]:
    a, b = intervals(1, 1200), intervals(2, 1200)
    out = np.empty((len(a), 2))
    array_of(getattr(arithmetic, name), arguments, n)(np.array(a), np.array(b), out)
    assert not np.isnan(out).any()
    infinite = np.isinf(out)
    assert (infinite[:, 0] == infinite[:, 1]).all()
    return a, b, [tuple(row) for row in out.tolist()]


@pytest.mark.parametrize("name", RATIONAL)
def test_rational_operations_hold_the_exact_results(name: str) -> None:
    a, b, results = evaluated(name, 2)
    for x, y, (low, high) in zip(a, b, results, strict=True):
        if np.isinf(low):
            too_large = max(map(abs, (*x, *y))) > 1e140 or (name == "div" and min(map(abs, y)) < 1e-140)
            assert too_large or (name == "div" and y[0] <= 0.0 <= y[1])
            continue
        corners = [RATIONAL[name](Fraction(p), Fraction(q)) for p in x for q in y]
        assert low < min(corners)
        assert high > max(corners)
        for bound, exact in ((low, min(corners)), (high, max(corners))):  # and no wider than two neighbours
            assert abs(Fraction(bound) - exact) <= abs(exact) * Fraction(2.0**-51) + Fraction(2e-323)


@pytest.mark.parametrize("n", POWERS)
def test_powers_hold_the_exact_results(n: int) -> None:
    a, _, results = evaluated("power", 1, n)
    for (p, q), (low, high) in zip(a, results, strict=True):
        if np.isinf(low):
            assert max(abs(p), abs(q)) > 1e42
            continue
        ends = [Fraction(p) ** n, Fraction(q) ** n] + ([Fraction(0)] if p <= 0 <= q and n % 2 == 0 else [])
        assert low < min(ends)
        assert high > max(ends)
        for bound, exact in ((low, min(ends)), (high, max(ends))):
            assert abs(Fraction(bound) - exact) <= abs(exact) * Fraction(n * 2.0**-51) + Fraction(1e-322)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_hold_mpmath_s_results(name: str) -> None:
    a, _, results = evaluated(name, 1)
    with mpmath.workdps(400):  # an argument of 1e300 has as many digits before its point
        exact = getattr(mpmath, name)
        for (p, q), (low, high) in zip(a, results, strict=True):
            if np.isinf(low):
                undefined = (name in ("sqrt", "log") and p <= 0.0) or (
                    name in ("asin", "acos") and max(-p, q) > 1
                )
                undefined = undefined or (name == "acosh" and p < 1) or (name == "atanh" and max(-p, q) >= 1)
                too_large = {"exp": q, "sinh": max(-p, q), "cosh": max(-p, q)}.get(name, 0.0) > 690.0
                assert undefined or too_large
                continue
            if name in ("sqrt", "log") and p <= 0.0:
                continue
            ends = [exact(mpmath.mpf(p)), exact(mpmath.mpf(q))]
            ends += [1] if name == "cosh" and p <= 0.0 <= q else []
            if name in ("sin", "cos"):
                shift = mpmath.mpf("0.5") if name == "sin" else 0
                t, u = mpmath.mpf(p) / mpmath.pi - shift, mpmath.mpf(q) / mpmath.pi - shift
                ends += [1] if 2 * mpmath.ceil(t / 2) <= u else []
                ends += [-1] if 2 * mpmath.ceil((t - 1) / 2) + 1 <= u else []
            assert low <= min(ends)
            assert high >= max(ends)
            if name not in ("sin", "cos") or max(abs(p), abs(q)) < 1e5:
                for bound, value in ((low, min(ends)), (high, max(ends))):
                    near_a_turn = name in ("sin", "cos") and abs(abs(value) - 1) < 1e-9
                    assert abs(bound - value) <= abs(value) * 1.2e-15 + 1e-300 or near_a_turn


def test_real_powers_hold_mpmath_s_results() -> None:
    """Least and greatest at corners, as those of b log(a) are."""
    a, b, results = evaluated("raised", 2)
    found = 0
    with mpmath.workdps(60):
        for x, y, (low, high) in zip(a, b, results, strict=True):
            known = x[0] > 0.0 or (x[0] >= -1e-300 and y[0] > 0.0)
            size = max((abs(mpmath.log(z) * w) for z in x for w in y if z > 0.0), default=0.0)
            if np.isinf(low):
                assert not known or size > 690.0
                continue
            assert known
            corners = [mpmath.mpf(z) ** mpmath.mpf(w) if z > 0.0 else mpmath.mpf(0) for z in x for w in y]
            assert low <= min(corners)
            assert high >= max(corners)
            for bound, value in ((low, min(corners)), (high, max(corners))):
                assert abs(bound - value) <= value * (1.0 + size) * 3e-15 + 1e-300 or x[1] <= 1e-300
            found += 1
    assert found > 300


def test_angles_of_points_hold_mpmath_s_results() -> None:
    """Least and greatest at corners of boxes that do not meet the line left of the origin."""
    y, x, results = evaluated("atan2", 2)
    known = 0
    with mpmath.workdps(60):
        for p, q, (low, high) in zip(y, x, results, strict=True):
            if np.isinf(low):
                met = p[0] <= 0.0 <= p[1] and q[0] <= 0.0
                assert met or max(map(abs, (*p, *q))) > 1e140 or 0.0 < min(map(abs, (*p, *q))) < 1e-140
                continue
            known += 1
            corners = [mpmath.atan2(mpmath.mpf(s), mpmath.mpf(c)) for s in p for c in q]
            assert low <= min(corners)
            assert high >= max(corners)
            for bound, value in ((low, min(corners)), (high, max(corners))):
                assert abs(bound - value) <= 3e-15
    assert known > 1000


def test_choices_are_exact() -> None:
    a, b, results = evaluated("greatest", 2)
    for x, y, found in zip(a, b, results, strict=True):
        assert found == (max(x[0], y[0]), max(x[1], y[1])) or max(x[1], y[1]) > 1e300
    for (p, q), found in zip(*evaluated("step", 1)[::2], strict=True):
        assert found == (float(p > 0.0), float(q >= 0.0))


@pytest.mark.nojit
def test_positive_powers_of_zero_are_zero() -> None:
    for power, most in ((0.5, 2.0), (1.5, 8.0), (-1.5, None)):
        low, high = arithmetic.raised((0.0, 4.0), (power, power))
        assert (low, high) == ((-np.inf, np.inf) if most is None else (0.0, pytest.approx(most, rel=1e-14)))
        assert most is None or high >= most
    low, high = arithmetic.raised((0.0, 4.0), (0.5, 1.5))
    assert (low, high) == (0.0, pytest.approx(8.0, rel=1e-14))
    assert arithmetic.raised((0.0, 0.5), (0.5, 1.5))[1] == pytest.approx(np.sqrt(0.5), rel=1e-14)


@pytest.mark.nojit
def test_one_of_two_is_chosen_or_both() -> None:
    a, b, everything = (1.0, 2.0), (-3.0, 1.5), (-np.inf, np.inf)
    assert arithmetic.chosen((1e-300, 1.0), a, everything) == a
    assert arithmetic.chosen((-1.0, -1e-300), everything, b) == b
    for border in ((-1.0, 1.0), (0.0, 0.0), (0.0, 1.0), (-1.0, 0.0), everything):
        assert arithmetic.chosen(border, a, b) == (-3.0, 2.0)
        assert arithmetic.chosen(border, a, everything) == everything


@pytest.mark.nojit
@settings(max_examples=300, deadline=None)
@given(
    st.floats(allow_nan=False, allow_infinity=False),
    st.floats(allow_nan=False, allow_infinity=False),
    st.floats(0.0, 1.0),
    st.sampled_from([*RATIONAL]),
)
def test_in_python_the_same_source_holds_every_number_of_its_operands(
    x: float, y: float, fraction: float, name: str
) -> None:
    a, b = (min(x, y), max(x, y)), (min(x, x * fraction), max(x, x * fraction))
    with np.errstate(all="ignore"):
        low, high = getattr(arithmetic, name)(a, b)
    p, q = Fraction(y), Fraction(x)
    if name != "div" or q != 0:
        exact = RATIONAL[name](p, q)
        assert (np.isinf(low) and np.isinf(high)) or Fraction(low) <= exact <= Fraction(high)


@pytest.mark.nojit
def test_all_numbers_stay_all_numbers() -> None:
    everything, zero = (-np.inf, np.inf), (0.0, 0.0)
    with np.errstate(all="ignore"):
        for other in (zero, (1.0, 2.0), (-3.0, 5.0), everything):
            for operation in (arithmetic.add, arithmetic.sub, arithmetic.mul, arithmetic.greatest):
                assert operation(everything, other) == operation(other, everything) == everything
            assert arithmetic.div(other, everything) == everything
            assert arithmetic.div(other, (-1.0, 1.0)) == everything
        assert arithmetic.sqrt((-1e-9, 1.0)) == everything
        assert arithmetic.power(everything, 2) == everything
        assert (
            arithmetic.raised(everything, (2.5, 2.5))
            == arithmetic.raised((1.0, 2.0), everything)
            == everything
        )
        assert arithmetic.raised((0.0, 1.0), (-0.5, -0.5)) == everything
        assert arithmetic.atan2(everything, (-1.0, 1.0)) == everything
        for name in FUNCTIONS:  # of what is not defined nothing is known
            assert getattr(arithmetic, name)(everything) == everything


def test_nothing_may_be_fused_into_a_bound() -> None:
    mine = [part for part in jit._parts if part.py_func.__module__ == arithmetic.__name__]
    assert len(mine) >= 18
    assert all(part.targetoptions["fastmath"] is False for part in mine)
