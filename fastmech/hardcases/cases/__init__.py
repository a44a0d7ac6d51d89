"""The cases, a few to a file. To add one, append a :class:`HardCase` to the ``CASES`` of a module here.

The gallery, its tests and ``fastmech hardcases`` walk :data:`CASES`.
"""

from __future__ import annotations

from fastmech.hardcases.case import HardCase
from fastmech.hardcases.cases import algebraic, chaos, conservative, folds, references, saddle, starts

#: Every case by its name.
CASES: dict[str, HardCase] = {
    case.name: case
    for module in (references, conservative, algebraic, folds, saddle, chaos, starts)
    for case in module.CASES
}
