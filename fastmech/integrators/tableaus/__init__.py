"""Explicit Runge-Kutta methods, one constant each.

To add one, write one constant in the module of its order: its tableau, order and source. It is checked when
the module is imported (shapes, row sums, order conditions), appears under its name in :data:`TABLEAUS` and in
:data:`fastmech.integrators.methods.METHODS`, and the tests that walk the registry measure its order.
"""

from __future__ import annotations

import fastmech.integrators.tableaus.order_1_to_5 as order_1_to_5
import fastmech.integrators.tableaus.order_6_to_8 as order_6_to_8
import fastmech.integrators.tableaus.order_10 as order_10
from fastmech.integrators.tableau import Tableau

#: Every tableau by its name.
TABLEAUS: dict[str, Tableau] = {
    value.name: value
    for module in (order_1_to_5, order_6_to_8, order_10)
    for value in vars(module).values()
    if isinstance(value, Tableau)
}
