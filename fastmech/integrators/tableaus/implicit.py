"""Implicit Runge-Kutta methods: Gauss (A-stable, symplectic), Radau IIA and SDIRK (L-stable).

Formulas: Hairer, Wanner, *Solving ODEs II*, section IV.5 (tables 5.1, 5.2, 5.5, 5.6) and IV.6 (table 6.5).
"""

from __future__ import annotations

from math import sqrt

from fastmech.integrators.tableau import ImplicitTableau

GAUSS2 = ImplicitTableau(
    name="gauss2", order=2, a=[[1 / 2]], b=[1.0], c=[1 / 2], source="Gauss; the implicit midpoint rule"
)

# fmt: off
# Rows of tables are filled.
_R = sqrt(3)
GAUSS4 = ImplicitTableau(
    name="gauss4", order=4,
    a=[[1 / 4, 1 / 4 - _R / 6], [1 / 4 + _R / 6, 1 / 4]],
    b=[1 / 2, 1 / 2],
    c=[1 / 2 - _R / 6, 1 / 2 + _R / 6],
    source="Hammer, Hollingsworth, MTAC 9 (1955); Butcher, Math. Comp. 18 (1964)",
)

_Q = sqrt(15)
GAUSS6 = ImplicitTableau(
    name="gauss6", order=6,
    a=[
        [5 / 36, 2 / 9 - _Q / 15, 5 / 36 - _Q / 30],
        [5 / 36 + _Q / 24, 2 / 9, 5 / 36 - _Q / 24],
        [5 / 36 + _Q / 30, 2 / 9 + _Q / 15, 5 / 36],
    ],
    b=[5 / 18, 4 / 9, 5 / 18], c=[1 / 2 - _Q / 10, 1 / 2, 1 / 2 + _Q / 10],
    source="Kuntzmann, 1961; Butcher, Math. Comp. 18 (1964)",
)

RADAU3 = ImplicitTableau(
    name="radau3", order=3,
    a=[[5 / 12, -1 / 12], [3 / 4, 1 / 4]], b=[3 / 4, 1 / 4], c=[1 / 3, 1.0],
    source="Ehle, thesis, Waterloo 1969 (Radau IIA)",
)

_S = sqrt(6)
RADAU5 = ImplicitTableau(
    name="radau5", order=5,
    a=[
        [(88 - 7 * _S) / 360, (296 - 169 * _S) / 1800, (-2 + 3 * _S) / 225],
        [(296 + 169 * _S) / 1800, (88 + 7 * _S) / 360, (-2 - 3 * _S) / 225],
        [(16 - _S) / 36, (16 + _S) / 36, 1 / 9],
    ],
    b=[(16 - _S) / 36, (16 + _S) / 36, 1 / 9], c=[(4 - _S) / 10, (4 + _S) / 10, 1.0],
    source="Ehle, thesis, Waterloo 1969 (Radau IIA)",
)

SDIRK4 = ImplicitTableau(
    name="sdirk4", order=4,
    a=[
        [1 / 4],
        [1 / 2, 1 / 4],
        [17 / 50, -1 / 25, 1 / 4],
        [371 / 1360, -137 / 2720, 15 / 544, 1 / 4],
        [25 / 24, -49 / 48, 125 / 16, -85 / 12, 1 / 4],
    ],
    b=[25 / 24, -49 / 48, 125 / 16, -85 / 12, 1 / 4], c=[1 / 4, 3 / 4, 11 / 20, 1 / 2, 1.0],
    source="Hairer, Wanner, Solving ODEs II, table IV.6.5",
)

# fmt: on
#: Every implicit tableau by its name.
IMPLICIT_TABLEAUS: dict[str, ImplicitTableau] = {
    value.name: value for value in (GAUSS2, GAUSS4, GAUSS6, RADAU3, RADAU5, SDIRK4)
}
