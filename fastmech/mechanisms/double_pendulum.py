"""Two pendulums, one hanging from the other, with a spring from the lower mass to a point beside them."""

from __future__ import annotations

from sympy import cos, sin, symbols

from fastmech.models.coordinates import angles
from fastmech.models.elements import Spring, TorsionDamper
from fastmech.models.mechanism import Mechanism

VALUES = {
    "m1": (1.0, "kg"), "m2": (1.0, "kg"), "l1": (1.0, "m"), "l2": (1.0, "m"), "g": (9.81, "m/s2"),
    "k": (0.0, "N/m"), "x0": (1.0, "m"), "b": (0.0, "N m s"),
}  # fmt: skip


def double_pendulum() -> Mechanism:
    """Angles from the vertical; a spring of no free length ends at (x0, 0), both joints have a damper b.

    k and b are zero by default: ``double_pendulum().replace(k=20.0, b=0.5)``.
    """
    upper, lower = angles("upper lower")
    m1, m2, l1, l2, g, k, x0, b = symbols(list(VALUES))
    x, y = l1 * sin(upper), -l1 * cos(upper)
    return Mechanism(
        (upper, lower),
        VALUES,
        points={"O": (0, 0), "A": (x0, 0), "M1": (x, y), "M2": (x + l2 * sin(lower), y - l2 * cos(lower))},
        masses={"M1": m1, "M2": m2},
        springs=[Spring("A", "M2", k)],
        dampers=[TorsionDamper(upper, b), TorsionDamper(lower - upper, b)],
        gravity=g,
        name="double_pendulum",
    )
