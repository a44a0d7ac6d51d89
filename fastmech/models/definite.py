"""Whether a kinetic energy is positive definite, and dissipation passive, all over the ranges, by intervals.

By Sylvester's criteria: all leading minors of the metric are positive, and no principal minor of the damping
matrix is negative. They are written as sums of sines and cosines, which intervals bound closely, so that one
box is enough as a rule.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from itertools import combinations
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

from fastmech.arrays import Floats
from fastmech.errors import InputError
from fastmech.generated import kept_text
from fastmech.models.balance import enclosing, enclosures

if TYPE_CHECKING:
    from fastmech.models.mechanism import Mechanism


#: Operations of the longest determinant: to write it as a sum takes minutes for much longer ones.
LONGEST = 400

#: Boxes that are looked at before it stays open, and where parameters have ranges, which are not divided.
MOST_BOXES, FEW_BOXES = 500, 20

#: Share of the greatest damping that is none, and such a number: rounding where it touches zero, or is zero.
ROUNDED, LEAST = 1e-12, 1e-300


#: Values of parameters between which something is to be known, by name.
Ranges = Mapping[str, tuple[float, float]]


def definite(mechanism: Mechanism, over: Ranges = MappingProxyType({})) -> tuple[bool | None, Floats]:
    """Whether the metric is positive definite everywhere, proved, and where it is not.

    None where that stays open: where a range that matters is endless, where more than :data:`MOST_BOXES`
    boxes are needed, and where the metric is too long or has functions without known bounds.
    """

    def minors() -> list[Any]:
        metric = mechanism.equations.metric
        return [metric[:k, :k].det(method="berkowitz") for k in range(1, metric.rows + 1)]

    return _above(mechanism, _text(mechanism, "definite", mechanism.prints, minors), None, over)


def passive(mechanism: Mechanism, over: Ranges = MappingProxyType({})) -> tuple[bool | None, Floats]:
    """Whether dissipation feeds energy in nowhere, proved, and where it may.

    Dampers do not where their coefficients are not negative. None as in :func:`definite`, and where what is
    given as ``dissipation`` is neither quadratic in the rates nor a sum of terms that grow with them.
    """
    if not any(mechanism.dissipation):
        return True, np.empty(0)
    given, *coefficients = mechanism.dissipation
    rates = [sympy.Symbol(name, real=True) for name in mechanism.state[len(mechanism.coordinates) :]]
    name = hashlib.sha256(f"{mechanism.prints}{mechanism.dissipation}".encode()).hexdigest()[:16]
    text = _text(mechanism, "passive", name, lambda: [*coefficients, *_damping(given, rates)])
    return _above(mechanism, text, ROUNDED, over)


def _text(mechanism: Mechanism, kind: str, name: str, make: Callable[[], Sequence[Any]]) -> str:
    """Of the function that bounds expressions, kept under its name; empty where it is not to be had."""
    each = enumerate(mechanism.coordinates)
    endless = {k: c.symbol for k, c in each if math.isinf(c.low) or math.isinf(c.high)}

    def text() -> str:
        try:
            expressions = [sympy.sympify(x) for x in make()]
            far = any(x.free_symbols & {*endless.values()} for x in expressions)
            long = any(sympy.count_ops(x) > LONGEST for x in expressions)
            return "" if far or long else enclosing(mechanism.statics(), expressions)
        except InputError:
            return ""

    return kept_text(kind, "_".join([name, *map(str, endless)]), text)


@np.errstate(all="ignore")
def _above(mechanism: Mechanism, text: str, slack: float | None, over: Ranges) -> tuple[bool | None, Floats]:
    """Whether a text's expressions are positive, or not below ``-slack`` of their sizes, and where not."""
    if not text:
        return None, np.empty(0)
    values = [over.get(name, (value, value)) for name, value in mechanism.parameters.items()]
    bounds, scale, body = enclosures(values, text), 0.0, text.partition("\n")[2]
    ends = np.array([(c.low, c.high) for c in mechanism.coordinates])
    fixed = [f"q{k}" not in body for k in range(len(ends))]  # of a range that does not matter one value does
    ends[fixed] = np.clip(0.0, *ends[fixed].T)[:, None]
    todo = [ends]
    for _ in range(FEW_BOXES if over else MOST_BOXES):
        if not todo:
            break
        box = todo.pop(0)  # the widest first: beside a zero no box is narrow enough
        middle, side = box.mean(1), int(np.argmax(box[:, 1] - box[:, 0]))
        at = np.array(bounds(np.stack([middle, middle], axis=1)))
        scale = np.fmax(scale, np.where(np.isfinite(at), np.abs(at), 0.0).max(axis=1))
        least = np.nextafter(0.0, 1.0) if slack is None else -np.fmax(slack * scale, LEAST)
        if (at[:, 1] < least).any():
            return False, middle
        if not (np.array(bounds(box))[:, 0] >= least).all():
            todo += [box.copy(), box.copy()]
            todo[-1][side, 0] = todo[-2][side, 1] = middle[side]
    return None if todo else True, np.empty(0)


def _damping(given: Any, v: Sequence[Any]) -> list[Any]:
    """Of coordinates, what is nowhere negative only if Rayleigh's function ``given`` feeds nothing in.

    Raises:
        InputError: of such a function nothing is known.
    """
    by_rates: dict[Any, Any] = {}
    for term in sympy.Add.make_args(given):
        factor, moving = term.as_independent(*v, as_Add=False)
        if moving.free_symbols & {*v}:
            by_rates[moving] = by_rates.get(moving, 0) + factor
    if all(_grows(moving, v) for moving in by_rates):
        return list(by_rates.values())
    damping = sympy.hessian(given, v).applyfunc(sympy.expand)
    rest = given - sum(damping[i, j] * a * b for i, a in enumerate(v) for j, b in enumerate(v)) / 2
    if damping.free_symbols & {*v} or sympy.expand(rest) != 0:
        raise InputError("dissipation: is neither quadratic nor a sum of terms that grow with the rates")
    rows = [rows for k in range(1, len(v) + 1) for rows in combinations(range(len(v)), k)]
    return [sympy.expand(damping.extract(some, some).det(method="berkowitz")) for some in rows]


def _grows(x: Any, v: Sequence[Any]) -> bool:
    """Whether an expression is known not to fall along any ray of rates from rest."""
    if not x.free_symbols & {*v}:
        return True
    if x.is_Add:
        return all(_grows(part, v) for part in x.args)
    if x.is_Mul:
        return all(part.is_nonnegative and _grows(part, v) for part in x.args)
    if isinstance(x, sympy.exp | sympy.log):
        return _grows(x.args[0], v)
    inner, power = x.as_base_exp()
    if (even := isinstance(inner, sympy.Abs | sympy.cosh)) or (power.is_Integer and power % 2 == 0):
        base = inner.args[0] if even else inner
        if power.is_positive and sympy.expand(sum(r * base.diff(r) for r in v) - base) == 0:
            return True
    return bool(x.is_Pow and power.is_positive and inner.is_nonnegative and _grows(inner, v))
