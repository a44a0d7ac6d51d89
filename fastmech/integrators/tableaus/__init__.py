"""Explicit Runge-Kutta methods, one constant each in :mod:`fastmech.integrators.tableaus.explicit`."""

from __future__ import annotations

import fastmech.integrators.tableaus.explicit as explicit
from fastmech.integrators.tableau import Tableau

#: Every tableau by its name.
TABLEAUS: dict[str, Tableau] = {
    value.name: value for value in vars(explicit).values() if isinstance(value, Tableau)
}
