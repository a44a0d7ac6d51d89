"""Random mechanisms, for studies that no made-up example flatters, and their equations."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import sympy
from sympy import cos, sin

from fastmech.models.coordinates import angles, lengths
from fastmech.models.elements import Force, Spring
from fastmech.models.mechanism import Mechanism

Random = np.random.Generator


def size(rng: Random, low: float, high: float) -> float:
    """A number of any order of magnitude between powers of ten."""
    return float(10.0 ** rng.uniform(low, high))


def place_in(rng: Random, far: float = 2.0) -> tuple[float, float]:
    """A point of a square."""
    x, y = rng.uniform(-far, far, 2).tolist()
    return x, y


def _hanging(rng: Random, q: list[Any], place: tuple[Any, Any], longest: float) -> dict[str, Any]:
    """Masses on rods, one below the other."""
    points = {}
    for k, angle in enumerate(q):
        l = rng.uniform(0.3, longest)
        place = place[0] + l * sin(angle), place[1] - l * cos(angle)
        points[f"M{k}"] = place
    return points


def chain(rng: Random) -> Mechanism:
    """One to three pendulums, masses of ratios to 1e6 (a metric near singular), a spring to the last."""
    q = [angles(f"q{k}") for k in range(int(rng.integers(1, 4)))]
    points: dict[str, Any] = {"A": place_in(rng), **_hanging(rng, q, (0, 0), 1.5)}
    return Mechanism(
        q,
        points=points,
        masses={f"M{k}": size(rng, -3, 3) for k in range(len(q))},
        springs=[Spring("A", f"M{len(q) - 1}", size(rng, 0, 3), float(rng.choice([0.0, 0.5, 1.5])))],
        potential=-sum(size(rng, -1, 2) * cos(a - b) for a, b in pairwise(q)),
        forces=[Force("M0", rng.normal() * 10.0, (1, 0))],
        gravity=9.81,
        name="chain",
    )


def cart(rng: Random) -> Mechanism:
    """A cart on a spring that carries one or two pendulums, the last one on a spring too."""
    x = lengths("x", -3.0, 3.0)
    q = [angles(f"q{k}") for k in range(int(rng.integers(1, 3)))]
    points: dict[str, Any] = {
        "O": (0, 0),
        "C": (x, 0),
        "W": place_in(rng, 1.0),
        **_hanging(rng, q, (x, 0), 1.0),
    }
    return Mechanism(
        [x, *q],
        points=points,
        masses={name: size(rng, -1, 1) for name in points if name[0] in "CM"},
        springs=[
            Spring("O", "C", size(rng, 0, 3)),
            Spring("W", f"M{len(q) - 1}", size(rng, 0, 2), rng.uniform(0.0, 1.0)),
        ],
        gravity=9.81,
        name="cart",
    )


def explicit(mechanism: Mechanism) -> tuple[list[Any], list[Any]]:
    """States as symbols, and their rates as expressions, parameters having their values."""
    found, q = mechanism.equations, [c.symbol for c in mechanism.coordinates]
    v = [sympy.Symbol(f"{symbol}_dot", real=True) for symbol in q]
    values = {sympy.Symbol(name, real=True): value for name, value in mechanism.parameters.items()}
    right = [f - h for f, h in zip(found.forces, found.inertia, strict=True)]
    solved = found.metric.LUsolve(sympy.Matrix(right)).subs(found.means).subs(values)
    return [*q, *v], [*v, *solved]
