"""Explicit Runge-Kutta methods, one constant each.

To add one, write one constant in :mod:`fastmech.integrators.tableaus.explicit`: its tableau, order and
source. It is checked when the module is imported (shapes, row sums, order conditions), appears under its name
in :data:`TABLEAUS` and in :data:`fastmech.integrators.methods.METHODS`, and the tests that walk the registry
measure its order.
"""

from __future__ import annotations

import fastmech.integrators.tableaus.explicit as explicit
from fastmech.integrators.tableau import Tableau

#: Every tableau by its name.
TABLEAUS: dict[str, Tableau] = {
    value.name: value for value in vars(explicit).values() if isinstance(value, Tableau)
}
