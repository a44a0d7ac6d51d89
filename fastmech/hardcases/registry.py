"""Every case by its name, from the modules of :mod:`fastmech.hardcases.cases`.

The gallery, its tests and ``fastmech hardcases`` walk :data:`CASES`.
"""

from __future__ import annotations

from fastmech.hardcases.case import HardCase
from fastmech.hardcases.cases import (
    algebraic,
    chaos,
    conservative,
    damping,
    folds,
    precision,
    references,
    saddle,
    starts,
)

#: Every case by its name.
CASES: dict[str, HardCase] = {
    case.name: case
    for module in (damping, references, conservative, algebraic, folds, saddle, chaos, precision, starts)
    for case in module.CASES
}
