"""Derivatives of a mechanism's forces at rest, of its metric and of its damping, as functions of numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import sympy
from sympy.printing.pycode import PythonCodePrinter

if TYPE_CHECKING:
    from fastmech.models.mechanism import Mechanism


#: Functions that are kept, by what they are made of.
MOST_KEPT = 64


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
    """Of the parameters ``names``; the others have their values, loads are at their means.

    What differs from one device to the next only by values is made once. Terms of zeros are left out: the
    slope of a spring's force is 0 / 0 where its length is zero, unless its free length is known to be.
    """
    forces = [sympy.sympify(force) for force in mechanism.statics().forces]
    found = mechanism.equations
    q = tuple(coordinate.symbol for coordinate in mechanism.coordinates)
    inertia = _inertia(q, tuple(found.metric), tuple(found.forces), tuple(found.means.items()))
    powers = {power for e in (*forces, *inertia) for power in e.atoms(sympy.Pow)}
    exponents = {x for power in powers for x in power.exp.free_symbols}
    others = {sympy.Symbol(n, real=True): v for n, v in mechanism.parameters.items() if n not in names}
    fixed = {x: sympy.Float(value) for x, value in others.items() if value == 0.0 or x in exponents}
    free = {x: value for x, value in others.items() if x not in fixed}
    z, own = (*q, *(sympy.Symbol(name, real=True) for name in names)), tuple(free.values())
    put = (tuple(entry.xreplace(fixed) for entry in entries) for entries in (forces, inertia))
    made = _made(*put, z, tuple(free))
    return Expansion(*(lambda *point, function=function: function(*point, *own) for function in made))


@lru_cache(maxsize=MOST_KEPT)
def _inertia(
    q: tuple[Any, ...], metric: tuple[Any, ...], forces: tuple[Any, ...], means: tuple[tuple[Any, Any], ...]
) -> tuple[Any, ...]:
    """Metric and damping at rest, flat."""
    v = [sympy.Symbol(f"{symbol}_dot", real=True) for symbol in q]
    still = dict.fromkeys(v, 0) | dict(means)
    damping = [-slope_of(force, rate).subs(still) for force in forces for rate in v]
    return tuple(sympy.sympify(entry) for entry in [*metric, *damping])


@lru_cache(maxsize=MOST_KEPT)
def _made(
    forces: tuple[Any, ...], inertia: tuple[Any, ...], z: tuple[Any, ...], others: tuple[Any, ...]
) -> Expansion:
    """Functions of z and then of the other parameters."""
    # Where a spring passes length zero, or dry friction turns, a sign jumps; its slope is zero elsewhere.
    first = [slope_of(force, x) for force in forces for x in z]
    second = [slope_of(slope, x) for slope in first for x in z]
    slopes = [entry.diff(x) for entry in inertia for x in z]
    both = [*forces, *first, *second], [*inertia, *slopes]
    return Expansion(*(sympy.lambdify([*z, *others], e, "math", printer=_Exact, cse=True) for e in both))


def slope_of(expression: Any, x: Any) -> Any:
    """A derivative, where a sign does not jump: there its slope is zero, as it is in an open contact.

    The second one of Hertz's force has Max(0, x)**(-1/2) times a step, 0 / 0 there.
    """
    slope = expression.diff(x).replace(sympy.DiracDelta, lambda *_: sympy.Integer(0))
    return slope.replace(
        lambda e: e.is_Pow and e.exp.is_negative and isinstance(e.base, sympy.Max) and 0 in e.base.args,
        lambda e: sympy.Piecewise((e, e.base > 0), (0, True)),
    )
