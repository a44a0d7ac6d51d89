"""What the balance of a mechanism is made of: coordinates, parameters and forces at rest, as expressions."""

from __future__ import annotations

from typing import Any, NamedTuple


class Coordinate(NamedTuple):
    """A generalized coordinate."""

    symbol: Any  #: SymPy symbol, real
    low: float  #: least value [rad or m]; of an angle -pi
    high: float  #: greatest value; of an angle pi
    periodic: bool  #: an angle: all repeats after 2 pi


class Statics(NamedTuple):
    """Generalized forces at rest; a mechanism is in balance where all are zero."""

    coordinates: tuple[Coordinate, ...]
    parameters: tuple[Any, ...]  #: SymPy symbols, in the order in which values are given
    forces: tuple[Any, ...]  #: expressions Q - dU/dq in coordinates and parameters, loads at their means
    conservative: bool  #: forces have a potential: their Jacobian is symmetric
    springs: tuple[tuple[Any, ...], ...] = ()  #: components of the way from end to end of each [m]
    stored: tuple[Any, ...] = ()  #: terms of U, of which some are those of springs
    other: tuple[Any, ...] = ()  #: forces that are not given by U
    also: tuple[Any, ...] = ()  #: what else vanishes in equilibria
    regular: Any = 1  #: equilibria are where ``forces`` are zero and this is not
