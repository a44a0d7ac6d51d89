"""Derivatives of a mechanism's forces at rest, of its metric and of its damping, as functions of numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import sympy
from sympy.printing.pycode import PythonCodePrinter

if TYPE_CHECKING:
    from fastmech.models.mechanism import Mechanism


class _Exact(PythonCodePrinter):  # type: ignore[misc]
    """Python text with all digits of a number: fifteen move a fold by some 1e-13 of itself."""

    def __init__(self) -> None:
        super().__init__({"fully_qualified_modules": False})

    def _print_Float(self, expr: Any) -> str:
        return repr(float(expr))


class Expansion(NamedTuple):
    """Functions of coordinates and then of some parameters, together z; each gives one flat list."""

    forces: Callable[..., list[float]]  #: forces at rest (n,), their derivatives by z (n, z) and (n, z, z)
    motion: Callable[..., list[float]]  #: metric and damping (2, n, n), their derivatives by z (2, n, n, z)


def expansion(mechanism: Mechanism, names: Sequence[str]) -> Expansion:
    """Of the parameters ``names``; the others have their values, loads are at their means."""
    values = {
        sympy.Symbol(name, real=True): sympy.Float(value)
        for name, value in mechanism.parameters.items()
        if name not in names
    }
    q = [coordinate.symbol for coordinate in mechanism.coordinates]
    v = [sympy.Symbol(f"{symbol}_dot", real=True) for symbol in q]
    z = [*q, *(sympy.Symbol(name, real=True) for name in names)]
    found = mechanism.equations
    still = dict.fromkeys(v, 0) | found.means
    forces = [sympy.sympify(force).xreplace(values) for force in mechanism.statics().forces]
    # Where a spring passes length zero, or dry friction turns, a sign jumps; its slope is zero elsewhere.
    first = [slope_of(force, x) for force in forces for x in z]
    second = [slope_of(slope, x) for slope in first for x in z]
    damping = [-slope_of(force, rate).subs(still) for force in found.forces for rate in v]
    inertia = [sympy.sympify(entry).xreplace(values) for entry in [*found.metric, *damping]]
    return Expansion(
        _numbers_of(z, [*forces, *first, *second]),
        _numbers_of(z, [*inertia, *(entry.diff(x) for entry in inertia for x in z)]),
    )


def _numbers_of(z: Sequence[Any], expressions: list[Any]) -> Callable[..., list[float]]:
    found: Callable[..., list[float]] = sympy.lambdify(z, expressions, "math", printer=_Exact, cse=True)
    return found


def slope_of(expression: Any, x: Any) -> Any:
    """A derivative, where a sign does not jump: there its slope is zero, as it is in an open contact.

    The second one of Hertz's force has Max(0, x)**(-1/2) times a step, 0 / 0 there.
    """
    slope = expression.diff(x).replace(sympy.DiracDelta, lambda *_: sympy.Integer(0))
    return slope.replace(
        lambda e: e.is_Pow and e.exp.is_negative and isinstance(e.base, sympy.Max) and 0 in e.base.args,
        lambda e: sympy.Piecewise((e, e.base > 0), (0, True)),
    )
