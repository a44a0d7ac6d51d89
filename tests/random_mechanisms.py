"""Random mechanisms of six kinds, hard ones among them."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import sympy
from sympy import cos, sin, sqrt

from fastmech.models.coordinates import angles, lengths
from fastmech.models.elements import Force, Spring
from fastmech.models.mechanism import Mechanism
from fastmech.studies.bench.devices import Random, cart, chain, place_in, size


def truss(rng: Random) -> Mechanism:
    """Three bars of stiffnesses of ratios to 1e6 on one joint."""
    x, y = lengths("x y", -2.0, 2.0)
    feet = {f"S{j}": place_in(rng, 1.5) for j in range(3)}
    return Mechanism(
        (x, y),
        points=feet | {"M": (x, y)},
        masses={"M": size(rng, -1, 1)},
        springs=[Spring(foot, "M", size(rng, -1, 5), rng.uniform(0.5, 2.0)) for foot in feet],
        gravity=9.81,
        name="truss",
    )


def zero_length(rng: Random) -> Mechanism:
    """A bead on a circle or a line that passes the foot of a spring of some free length."""
    if rng.random() < 0.5:
        q = angles("q")
        bead, turn = (cos(q), sin(q)), rng.uniform(0.0, 6.0)
        foot = (float(cos(turn)), float(sin(turn)))
    else:
        q = lengths("q", -2.0, 2.0)
        bead, foot = (q, 0), (rng.uniform(-1.0, 1.0), 0.0)
    return Mechanism(
        q,
        points={"B": bead, "F": foot},
        masses={"B": 1.0},
        springs=[Spring("F", "B", size(rng, 0, 3), rng.uniform(0.1, 1.0))],
        forces=[Force("B", rng.normal(), (1, 0))],
        gravity=9.81,
        name="zero_length",
    )


def beside_fold(rng: Random) -> Mechanism:
    """The von Mises truss under a load that is its snap load but for 1e-12 to 1e-3 of it."""
    x, y = lengths("x", -0.9, 0.9), lengths("y", -2.0, 2.0)
    rise, k = rng.uniform(0.2, 0.9), size(rng, 1, 4)
    free = float(sqrt(1.0 + rise**2))
    load = 2.0 * k * free * (1.0 - free ** (-2.0 / 3.0)) ** 1.5
    load *= 1.0 + float(rng.choice([-1.0, 1.0])) * size(rng, -12, -3)
    return Mechanism(
        (x, y),
        points={"A": (-1.0, 0.0), "B": (1.0, 0.0), "M": (x, y)},
        masses={"M": 1.0},
        springs=[Spring("A", "M", k, free), Spring("B", "M", k, free)],
        forces=[Force("M", load, (0, -1))],
        name="beside_fold",
    )


def coupled(rng: Random) -> Mechanism:
    """One to three angles and lengths in potentials of harmonics and springs, coupled pair by pair."""
    turning = rng.random(int(rng.integers(1, 4))) < 0.6
    q = [angles(f"u{k}") if turns else lengths(f"u{k}", -2.0, 2.0) for k, turns in enumerate(turning)]
    U: Any = 0
    for s, turns in zip(q, turning, strict=True):
        if turns:
            for k in (1, int(rng.integers(1, 3))):
                U += size(rng, -3, 3) * rng.normal() * cos(k * s - rng.uniform(0, 6))
        else:
            U += size(rng, -3, 3) * (s - rng.normal()) ** 2 / 2
            U -= size(rng, -3, 3) * cos(rng.uniform(1, 4) * s)
    for (a, own), (b, other) in pairwise(zip(q, turning, strict=True)):
        both = (
            cos(a - b) if own and other else (sum(sin(c) if t else c for c, t in ((a, own), (b, other)))) ** 2
        )
        U += size(rng, -3, 3) * both / 2
    return Mechanism(q, kinetic=sum(s.dot**2 for s in q) / 2, potential=sympy.sympify(U), name="coupled")


KINDS: dict[str, Callable[[Random], Mechanism]] = {
    kind.__name__: kind for kind in (chain, truss, cart, zero_length, beside_fold, coupled)
}
