"""Ziegler's column: two massless rods with masses 2 m at the joint and m at the tip, pushed along the tip.

H. Ziegler, Ingenieur-Archiv 20 (1952) 49-56: undamped, two frequencies coalesce at P l / k = 7/2 - sqrt 2;
with dashpots b at both joints it flutters from 41/28 + b^2/(2 k m l^2) on.
"""

from __future__ import annotations

from sympy import cos, pi, sin, symbols

from fastmech.loads import Constant
from fastmech.models.coordinates import angles
from fastmech.models.elements import Force, TorsionDamper, TorsionSpring
from fastmech.models.mechanism import Mechanism

VALUES = {
    "m": (1.0, "kg"), "l": (1.0, "m"), "k": (1.0, "N m"), "b": (0.0, "N m s"), "P": (1.0, "N"),
}  # fmt: skip


def ziegler_column() -> Mechanism:
    """Angles of both rods from upright; the force P follows the upper one.

    Other values: ``ziegler_column().replace(P=2.0)``.
    """
    lower, upper = angles("lower upper", -float(pi), float(pi))
    m, l, k, b, P = symbols(list(VALUES))
    joint = (l * sin(lower), l * cos(lower))
    return Mechanism(
        (lower, upper),
        VALUES,
        points={"O": (0, 0), "joint": joint, "tip": (joint[0] + l * sin(upper), joint[1] + l * cos(upper))},
        masses={"joint": 2 * m, "tip": m},
        springs=[TorsionSpring(lower, k), TorsionSpring(upper - lower, k)],
        dampers=[TorsionDamper(lower, b), TorsionDamper(upper - lower, b)],
        forces=[Force("tip", Constant(P), (-sin(upper), -cos(upper)))],
        name="ziegler_column",
    )
