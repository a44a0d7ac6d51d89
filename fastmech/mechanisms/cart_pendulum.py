"""An inverted pendulum on a cart, both held by springs.

With the cart free to move the pendulum's upright position is stable where kt > m g l.
"""

from __future__ import annotations

from sympy import cos, pi, sin, symbols

from fastmech.models.coordinates import angles, lengths
from fastmech.models.elements import Damper, Spring, TorsionSpring
from fastmech.models.mechanism import Mechanism

VALUES = {
    "M": (2.0, "kg"), "m": (1.0, "kg"), "l": (1.0, "m"), "g": (9.81, "m/s2"), "k": (10.0, "N/m"),
    "kt": (12.0, "N m"), "b": (0.0, "N s/m"),
}  # fmt: skip


def cart_pendulum() -> Mechanism:
    """Place x of the cart, and the pendulum's angle from upright; a torsion spring keeps it from turning.

    Other values: ``cart_pendulum().replace(kt=2.0)``.
    """
    x, angle = lengths("x", -5.0, 5.0), angles("angle", -float(pi), float(pi))
    M, m, l, g, k, kt, b = symbols(list(VALUES))
    return Mechanism(
        (x, angle),
        VALUES,
        points={"O": (0, 0), "cart": (x, 0), "mass": (x + l * sin(angle), l * cos(angle))},
        masses={"cart": M, "mass": m},
        springs=[Spring("O", "cart", k), TorsionSpring(angle, kt)],
        dampers=[Damper("O", "cart", b, along=(1, 0))],
        gravity=g,
        name="cart_pendulum",
    )
