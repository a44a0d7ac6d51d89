"""Generalized coordinates as SymPy symbols that carry their kind and range."""

from __future__ import annotations

import math
from typing import Any

import sympy

from fastmech.errors import InputError, shown


class CoordinateSymbol(sympy.Symbol):  # type: ignore[misc]
    """A coordinate's symbol; ``dot`` is that of its rate."""

    low: float  #: least value [rad or m]
    high: float  #: greatest value
    periodic: bool  #: an angle that turns fully: all repeats after 2 pi
    unit: str  #: "rad" or "m"

    def __new__(cls, name: str, low: float, high: float, unit: str) -> CoordinateSymbol:  # noqa: D102
        made: CoordinateSymbol = sympy.Symbol.__xnew__(cls, name, real=True)
        made.periodic = unit == "rad" and not (math.isfinite(low) or math.isfinite(high))
        made.low, made.high = (-math.pi, math.pi) if made.periodic else (low, high)
        made.unit = unit
        return made

    @property
    def dot(self) -> sympy.Symbol:
        """Symbol of the rate [rad/s or m/s]."""
        return sympy.Symbol(f"{self.name}_dot", real=True)


def angles(names: str, low: float = -math.inf, high: float = math.inf) -> Any:
    """Angles [rad] as symbols: of several names a tuple, of one the symbol itself, ``q = fm.angles("q")``.

    Without ``low`` and ``high`` an angle turns fully, and the mechanism repeats after 2 pi. Where it cannot,
    as with a torsion spring on it, give the range.

    Raises:
        InputError: names are no Python names, or the range is empty or has one end only.
    """
    return _coordinates(names, low, high, "rad")


def lengths(names: str, low: float = -math.inf, high: float = math.inf) -> Any:
    """Lengths [m] between ``low`` and ``high`` as symbols: of several names a tuple, of one that itself.

    Raises:
        InputError: names are no Python names, or the range is empty.
    """
    return _coordinates(names, low, high, "m")


def _coordinates(names: str, low: float, high: float, unit: str) -> Any:
    told = names.replace(",", " ").split() if isinstance(names, str) else []
    if not told or not all(name.isidentifier() for name in told) or len(set(told)) < len(told):
        raise InputError(f"names = {shown(names)}: must be different Python names in a text, as in 'q1 q2'")
    try:
        low, high = float(low), float(high)
    except (TypeError, ValueError):
        raise InputError(f"low, high = {shown((low, high))}: must be numbers [{unit}]") from None
    if not low < high:
        raise InputError(f"low, high = {shown((low, high))}: low must be less than high [{unit}]")
    if unit == "rad" and math.isfinite(low) != math.isfinite(high):
        raise InputError(
            f"low, high = {shown((low, high))}: an angle must have both ends, or none and turn fully"
        )
    made = tuple(CoordinateSymbol(name, low, high, unit) for name in told)
    return made if len(made) > 1 else made[0]
