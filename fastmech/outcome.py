"""How far a list of equilibria is proved to be correct and complete."""

from __future__ import annotations

from enum import IntEnum


class Outcome(IntEnum):
    """How far the list of equilibria is proved; kernels write it as int8."""

    COMPLETE = 0
    """Every listed equilibrium is proved to exist, and their number is the number that there are."""

    AT_FOLD = 1
    """Equilibria merge here within rounding: the merged one is listed once, as degenerate."""

    DEGENERATE = 2
    """Equilibria are not isolated (exactly, or not to be told from that within rounding); none is listed."""

    UNPROVED = 3
    """Nothing is proved; the certificate's sentence says why."""
