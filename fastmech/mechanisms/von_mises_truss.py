"""The von Mises truss: two equal bars between two supports, a mass and a downward force at their joint.

Without sideways motion it snaps at 2 k L (1 - cos^(2/3) a)^(3/2), with L cos a = half the span and
L sin a = rise.
"""

from __future__ import annotations

from sympy import sqrt, symbols

from fastmech.loads import Constant
from fastmech.models.coordinates import lengths
from fastmech.models.elements import Damper, Force, Spring
from fastmech.models.mechanism import Mechanism

VALUES = {
    "m": (1.0, "kg"), "k": (1000.0, "N/m"), "span": (2.0, "m"), "rise": (0.5, "m"), "b": (0.0, "N s/m"),
    "P": (0.0, "N"),
}  # fmt: skip


def von_mises_truss() -> Mechanism:
    """Place of the joint: x sideways from the middle, y above the supports.

    Other values: ``von_mises_truss().replace(P=0.0)``.
    """
    x, y = lengths("x", -0.9, 0.9), lengths("y", -2.0, 2.0)
    m, k, span, rise, b, P = symbols(list(VALUES))
    free = sqrt(span**2 / 4 + rise**2)
    return Mechanism(
        (x, y),
        VALUES,
        points={"A": (-span / 2, 0), "B": (span / 2, 0), "M": (x, y)},
        masses={"M": m},
        springs=[Spring("A", "M", k, free), Spring("B", "M", k, free)],
        dampers=[Damper("A", "M", b, along=(1, 0)), Damper("A", "M", b, along=(0, 1))],
        forces=[Force("M", Constant(P), (0, -1))],
        name="von_mises_truss",
    )
