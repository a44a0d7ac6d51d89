"""Intervals of real numbers as pairs (low, high), each operation rounded outward; compiled or in Python.

An operation gives an interval that holds the exact result for all numbers of its operands. What may lie
beyond ``LARGEST``, and what is not defined everywhere on its operands, is ``(-inf, inf)``; an end is never
NaN, and none is infinite alone.

The processor rounds to nearest. ``below`` and ``above`` step from a rounded result past its neighbours by two
operations without a branch (Rump, Zimmermann, Boldo, Melquiond: Computing predecessor and successor in
rounding to nearest, BIT 49, 2009). Nothing may be fused or reordered for that, see ``fastmech.jit.EXACT``.
Trigonometric, hyperbolic and inverse functions, exponential and logarithm are the C library's; those in use
err by one or two units in the last place, four are allowed here.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from fastmech.jit import inlined_exactly

Interval: TypeAlias = tuple[float, float]
Matrix: TypeAlias = Sequence[Sequence[Interval]]

#: Names of what works on intervals.
OPERATIONS = (
    "absolute", "acos", "acosh", "add", "asin", "asinh", "atan", "atan2", "atanh", "chosen", "cos", "cosh",
    "div", "exp", "greatest", "log", "mul", "neg", "power", "raised", "sign", "sin", "sinh", "sqrt",
    "step", "sub", "tanh",
)  # fmt: skip

#: Numbers beyond are not told from infinity: a few operations on others cannot overflow unseen.
LARGEST = 1e300

_HALF_UNIT = 2.0**-53 * (1.0 + 2.0**-52)
_TINY = 5e-324
_LIBRARY = 4.0 * 2.0**-52
_FINITE, _BELOW_ONE = float(np.finfo(np.float64).max), 1.0 - 2.0**-53

_QUARTER = (1.5707963267948966, 1.5707963267948968)  #: bounds on pi / 2

_BY_PI = 0.3183098861837907  #: 1 / pi, rounded
_REDUCTION = 1e-15  #: bound on the relative error of ``x * _BY_PI``, four times as large as it is

#: Radians beyond which sine and cosine are not placed: a turn is then known to less than 1e-5.
_FARTHEST = 1e9


@inlined_exactly
def below(x: float) -> float:
    """A number less than every real that rounds to ``x``."""
    return x - (abs(x) * _HALF_UNIT + _TINY)


@inlined_exactly
def above(x: float) -> float:
    """A number greater than every real that rounds to ``x``."""
    return x + (abs(x) * _HALF_UNIT + _TINY)


@inlined_exactly
def _outward(low: float, high: float, share: float = _HALF_UNIT) -> Interval:
    """Both ends rounded outward by a share of them; an end that is NaN or too large gives all numbers."""
    if low >= -LARGEST and high <= LARGEST:
        return low - (abs(low) * share + _TINY), high + (abs(high) * share + _TINY)
    return -np.inf, np.inf


@inlined_exactly
def add(a: Interval, b: Interval) -> Interval:
    """Sum."""
    return _outward(a[0] + b[0], a[1] + b[1])


@inlined_exactly
def sub(a: Interval, b: Interval) -> Interval:
    """Difference."""
    return _outward(a[0] - b[1], a[1] - b[0])


@inlined_exactly
def neg(a: Interval) -> Interval:
    """Negative; exact."""
    return -a[1], -a[0]


@inlined_exactly
def absolute(a: Interval) -> Interval:
    """Absolute value; exact."""
    if a[0] >= 0.0 or not a[1] <= LARGEST:
        return a
    return (-a[1], -a[0]) if a[1] <= 0.0 else (0.0, max(-a[0], a[1]))


@inlined_exactly
def sign(a: Interval) -> Interval:
    """1, -1, or where it is not known, as at zero, all between."""
    if a[0] > 0.0:
        return 1.0, 1.0
    return (-1.0, -1.0) if a[1] < 0.0 else (-1.0, 1.0)


@inlined_exactly
def _hull(p: float, q: float, r: float, s: float) -> Interval:
    """Of four rounded products: infinite ones survive beside NaN, or all are NaN."""
    x, y = (p, q) if p < q else (q, p)
    z, w = (r, s) if r < s else (s, r)
    return _outward(x if x < z else z, y if y > w else w)


@inlined_exactly
def mul(a: Interval, b: Interval) -> Interval:
    """Product."""
    return _hull(a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1])


@inlined_exactly
def div(a: Interval, b: Interval) -> Interval:
    """Quotient; all numbers where the divisor may be zero."""
    if b[0] > 0.0 or b[1] < 0.0:
        return _hull(a[0] / b[0], a[0] / b[1], a[1] / b[0], a[1] / b[1])
    return -np.inf, np.inf


@inlined_exactly
def magnitude(a: Interval) -> float:
    """Largest absolute value; exact."""
    return max(-a[0], a[1])


@inlined_exactly
def _power_below(x: float, n: int) -> float:
    """A bound below x^n, for x >= 0."""
    y = x
    for _ in range(n - 1):
        y = max(below(y * x), 0.0)
    return y


@inlined_exactly
def _power_above(x: float, n: int) -> float:
    """A bound above x^n, for x >= 0."""
    y = x
    for _ in range(n - 1):
        y = above(y * x)
    return y


@inlined_exactly
def power(a: Interval, n: int) -> Interval:
    """a^n for a whole n > 0."""
    low, high = a
    if n % 2 == 0:  # of absolute values
        least = low if low > 0.0 else (-high if high < 0.0 else 0.0)
        return _outward(_power_below(least, n), _power_above(magnitude(a), n))
    return _outward(
        _power_below(low, n) if low > 0.0 else -_power_above(-low, n),
        _power_above(high, n) if high > 0.0 else -_power_below(-high, n),
    )


@inlined_exactly
def sqrt(a: Interval) -> Interval:
    """Square root; all numbers where the operand may be negative by more than rounding."""
    if a[0] >= -1.0 / LARGEST:
        return _outward(np.sqrt(max(a[0], 0.0)), np.sqrt(max(a[1], 0.0)))
    return -np.inf, np.inf


@inlined_exactly
def _wave(a: Interval, ends: Interval, shift: float) -> Interval:
    """Range of cos(x - shift pi) over ``a``, whose values at the ends are given.

    It is 1 where x / pi - shift is even and -1 where it is odd, else it is monotone. Rounding is monotone, so
    that a whole number between the exact bounds lies between the rounded ones.
    """
    low, high = a[0] * _BY_PI, a[1] * _BY_PI
    low = low - abs(low) * _REDUCTION - shift
    high = high + abs(high) * _REDUCTION - shift
    least, most = _outward(min(ends[0], ends[1]), max(ends[0], ends[1]), _LIBRARY)
    top = 2.0 * np.ceil(0.5 * low) <= high
    bottom = 2.0 * np.ceil(0.5 * (low - 1.0)) + 1.0 <= high
    return (-1.0 if bottom else max(least, -1.0)), (1.0 if top else min(most, 1.0))


@inlined_exactly
def cos(a: Interval) -> Interval:
    """Cosine."""
    if a[0] >= -_FARTHEST and a[1] <= _FARTHEST:
        return _wave(a, (np.cos(a[0]), np.cos(a[1])), 0.0)
    return (-1.0, 1.0) if magnitude(a) < np.inf else (-np.inf, np.inf)


@inlined_exactly
def sin(a: Interval) -> Interval:
    """Sine."""
    if a[0] >= -_FARTHEST and a[1] <= _FARTHEST:
        return _wave(a, (np.sin(a[0]), np.sin(a[1])), 0.5)
    return (-1.0, 1.0) if magnitude(a) < np.inf else (-np.inf, np.inf)


def _rising(function: Any, least: float = -np.inf, most: float = np.inf) -> Any:
    """Bounds of a rising function of the C library; all numbers where the operand may lie beyond its ends."""

    @inlined_exactly
    def bounds(a: Interval) -> Interval:
        if least <= a[0] and a[1] <= most:
            return _outward(function(a[0]), function(a[1]), _LIBRARY)
        return -np.inf, np.inf

    return bounds


exp = _rising(np.exp)
sinh = _rising(np.sinh)
asinh = _rising(np.arcsinh)
log = _rising(np.log, least=_TINY)
acosh = _rising(np.arccosh, least=1.0)
atan = _rising(np.arctan, -_FINITE, _FINITE)
tanh = _rising(np.tanh, -_FINITE, _FINITE)
asin = _rising(np.arcsin, -1.0, 1.0)
atanh = _rising(np.arctanh, -_BELOW_ONE, _BELOW_ONE)


@inlined_exactly
def acos(a: Interval) -> Interval:
    """Arccosine; all numbers where the operand may lie beyond -1 or 1."""
    return _outward(np.arccos(a[1]), np.arccos(a[0]), _LIBRARY) if magnitude(a) <= 1.0 else (-np.inf, np.inf)


@inlined_exactly
def atan2(y: Interval, x: Interval) -> Interval:
    """Angle of the point (x, y) in (-pi, pi]; all numbers where it may jump, left of the origin."""
    if x[0] > 0.0:
        return atan(div(y, x))
    if y[0] > 0.0 or y[1] < 0.0:
        quarter = (_QUARTER[0], _QUARTER[1]) if y[0] > 0.0 else (-_QUARTER[1], -_QUARTER[0])
        return sub(quarter, atan(div(x, y)))
    return -np.inf, np.inf


@inlined_exactly
def cosh(a: Interval) -> Interval:
    """Hyperbolic cosine."""
    least, most = absolute(a)
    return _outward(np.cosh(least), np.cosh(most), _LIBRARY)


@inlined_exactly
def raised(a: Interval, b: Interval) -> Interval:
    """a^b for real b; all numbers where a may be negative by more than rounding, or zero for b <= 0."""
    if a[0] > 0.0:
        return exp(mul(b, log(a)))
    if a[0] >= -1.0 / LARGEST and b[0] > 0.0:
        most = max(a[1], 1.0 / LARGEST)
        high = exp(mul(b, log((most, most))))[1]
        return (0.0, high) if high < np.inf else (-np.inf, np.inf)
    return -np.inf, np.inf


@inlined_exactly
def greatest(a: Interval, b: Interval) -> Interval:
    """The greater of two numbers; exact."""
    known = a[1] <= LARGEST and b[1] <= LARGEST
    return (max(a[0], b[0]), max(a[1], b[1])) if known else (-np.inf, np.inf)


@inlined_exactly
def step(a: Interval) -> Interval:
    """1 of what is positive, 0 of what is negative, or where that is not known, as at zero, all between."""
    if a[0] > 0.0:
        return 1.0, 1.0
    return (0.0, 0.0) if a[1] < 0.0 else (0.0, 1.0)


@inlined_exactly
def chosen(c: Interval, a: Interval, b: Interval) -> Interval:
    """``a`` where ``c`` is positive, ``b`` where it is negative, else what holds both."""
    if c[0] > 0.0:
        return a
    return b if c[1] < 0.0 else (min(a[0], b[0]), max(a[1], b[1]))


def product(a: Matrix, b: Matrix) -> list[list[Interval]]:
    """Product of matrices, in Python alone; an entry of ``a`` that is zero adds nothing."""
    found = []
    for row in a:
        sums = [(0.0, 0.0)] * len(b[0])
        for x, other in zip(row, b, strict=True):
            if x != (0.0, 0.0):
                sums = [add(total, mul(x, y)) for total, y in zip(sums, other, strict=True)]
        found.append(sums)
    return found
