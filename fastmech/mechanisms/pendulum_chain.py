"""A chain of pendulums of unit lengths and masses, with a torsion-like coupling of neighbours.

U = -sum w_i (g cos q_i + F sin q_i) - c sum cos(q_i - q_(i+1)), w = (n, ..., 1).
"""

from __future__ import annotations

from itertools import pairwise

from sympy import cos, sin, symbols

from fastmech.errors import InputError, shown
from fastmech.loads import Constant
from fastmech.models.coordinates import angles
from fastmech.models.elements import Force
from fastmech.models.mechanism import MOST_COORDINATES, Mechanism

VALUES = {"m": (1.0, "kg"), "l": (1.0, "m"), "g": (9.81, "m/s2"), "F": (3.0, "N"), "c": (12.0, "N m")}


def pendulum_chain(n: int) -> Mechanism:
    """A chain of n pendulums, each mass pushed sideways by F; angles are from the vertical.

    Other values: ``pendulum_chain(3).replace(F=0.0)``.

    Raises:
        InputError: n is not from 1 to 4.
    """
    if isinstance(n, bool) or not isinstance(n, int) or not 1 <= n <= MOST_COORDINATES:
        raise InputError(f"n = {shown(n)}: must be a whole number from 1 to {MOST_COORDINATES}")
    q = [angles(f"q{i + 1}") for i in range(n)]
    m, l, g, F, c = symbols(list(VALUES))
    points: dict[str, tuple[object, object]] = {}
    x: object = 0
    y: object = 0
    for i, angle in enumerate(q):
        x, y = x + l * sin(angle), y - l * cos(angle)
        points[f"M{i + 1}"] = x, y
    return Mechanism(
        q,
        {name: given for name, given in VALUES.items() if n > 1 or name != "c"},
        points={"O": (0, 0), **points},
        masses=dict.fromkeys(points, m),
        potential=-c * sum(cos(a - b) for a, b in pairwise(q)),
        forces=[Force(name, Constant(F), (1, 0)) for name in points],
        gravity=g,
        name=f"pendulum_chain_{n}",
    )
