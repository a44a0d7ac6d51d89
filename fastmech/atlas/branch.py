"""A resting position followed as a parameter changes, to where it ends: the branch's equations, its end."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np

from fastmech.arrays import Floats
from fastmech.atlas.continuation import Equations, newton, tangent_at

#: Longest step along the branch [rad, and parts of the range], and the shortest.
STEP, SHORTEST = 0.02, 1e-9

#: How far past a branch that meets others its successor is looked for [parts of the range]; and the step with
#: which a branch has come near enough to where it turns back.
PAST, TURNED = 2e-3, 1e-4

#: Near where branches almost meet a step is so much of the distance to other positions at least, and where
#: these are so near the fold is looked for [rad].
CLEAR, CLOSE = 0.4, 1e-4

#: A position that is given is the stable one within so many rad, lengths over their ranges by 2 pi.
NEAR = 0.1

#: Part of the largest singular value below which the fold's equations are singular: other branches pass
#: through. Beside such a point, at a distance d of the branches [rad], it is about d squared.
CROSSING = 1e-6

#: The same where Newton's method has found the fold; and how evenly a symmetric position lies between two
#: tilted ones, over its distance, where lists of them cannot be proved any more.
EXACTLY, EVENLY = 1e-12, 0.02

#: Two positions that merge are nearer to each other than to all others by this factor.
ALONE = 10.0


#: What a position does at an end of its branch. Beside perfect symmetry two positions come nearer to each
#: other than rounding lets them be told apart; one of them ends there.
How = Literal[
    "disappears",
    "turns unstable",
    "begins to flutter",
    "leaves its range",
    "meets others within rounding",
]


class RestBranch(NamedTuple):
    """What is known of the equilibria over one parameter; points are (coordinates, part of its range)."""

    rest: Equations
    fold: Equations
    determinant: Callable[[Floats], float]  #: of the stiffness, positive where the position is stable
    value: Callable[[Floats], float]  #: of the parameter
    others: Callable[[Floats], Floats | None]
    """Distances of all other equilibria at its value, rising, infinity beyond them; None: not proved."""
    flutters: Callable[[Floats], bool] = lambda z: False
    flutter: Callable[[Floats], Floats] = lambda z: z  #: where it begins, from very near
    in_range: Callable[[Floats], bool] = lambda z: bool(0.0 <= z[-1] <= 1.0)


class End(NamedTuple):
    """Where the branch of a stable position ends."""

    value: float | None  #: of the parameter; None: it does not end in the range
    how: How = "disappears"
    joins: float | None = None  #: value at which it first merges with others and one stable position goes on


def ending(branch: RestBranch, start: Floats, direction: float) -> End:
    """Where the branch from ``start`` ceases to be stable.

    A minimum can always be followed a little further. Where no step succeeds, the branch has come as near to
    its end as a step is short, and what Newton's method cannot polish there is that end. Where a symmetric
    position takes over from two tilted ones, their branch turns back and is stable on both sides: the
    symmetric one is followed on. Beside perfect symmetry a branch ends where another one is very near, and a
    step could lead over to that: where the stiffness was least on the way, steps are repeated that are short
    beside the distance to all other positions.
    """
    along = np.zeros(start.size)
    along[-1] = direction
    z, step, flutters, outside, joins = start, 0.25 * STEP, False, False, None
    tangent = tangent_at(branch.rest, z)
    tangent = tangent * math.copysign(1.0, tangent @ along)
    behind: list[tuple[Floats, Floats, float]] = []
    repeated, away = direction * start[-1], np.full(2, math.inf)
    while step > SHORTEST:
        turn: Floats | None = None
        if direction * z[-1] <= repeated:
            others = branch.others(z)
            away = away if others is None else others
            if (others is None or away[0] < CLOSE) and away[1] > ALONE * away[0]:
                fold = newton(branch.fold, z, 4.0 * away[0])
                if fold is not None:
                    return End(branch.value(fold), "disappears", joins)
            if others is None and away[0] < STEP:
                turn = z
            step = min(step, CLEAR * away[0])
        if turn is None:
            found = newton(branch.rest, z + step * tangent, 0.3 * step, tangent)
            onwards = tangent if found is None else tangent_at(branch.rest, found)
            inside = found is not None and branch.in_range(found)
            if found is None or abs(onwards @ tangent) < 0.985 or not inside:
                outside = found is not None and not inside
                step *= 0.5
                continue
            there, ahead = found, onwards * math.copysign(1.0, onwards @ tangent)
            if branch.flutters(there):
                flutters, step = True, 0.5 * step
                continue
            stiffness = branch.determinant(there)
            if direction * z[-1] > repeated:
                behind.append((z, tangent, stiffness))
                least = len(behind) > 2 and behind[-2][2] < min(behind[-3][2], stiffness)
                if least or stiffness <= 0.0 or ahead @ along < 0.0:
                    repeated, step = max(direction * z[-1], direction * there[-1]), 0.25 * STEP
                    away = np.full(2, math.inf)
                    z, tangent, _ = behind[max(len(behind) - 4, 0)]
                    behind.clear()
                    continue
            if stiffness <= 0.0 or ahead @ along < 0.0:
                turn = newton(branch.fold, 0.5 * (z + there), step) if stiffness <= 0.0 else z
                if turn is None or (stiffness > 0.0 and step > TURNED):
                    step *= 0.5
                    continue
        if turn is not None:
            if turn is not z and not _crosses(branch.fold, turn, EXACTLY):
                return End(branch.value(turn), "disappears", joins)
            if turn is z and away[0] < math.inf and abs(away[1] - 2.0 * away[0]) > EVENLY * away[0]:
                return End(branch.value(z), "meets others within rounding", joins)
            z = turn
            beyond = _successor(branch, z, direction)
            if beyond is None:
                break
            joins = branch.value(z) if joins is None else joins
            there, ahead = beyond, tangent_at(branch.rest, beyond)
            ahead = ahead * math.copysign(1.0, ahead @ along)
            behind.clear()
            repeated = -math.inf
        z, tangent, step, flutters = there, ahead, min(STEP, 1.5 * step), False
    if min(z[-1], 1.0 - z[-1]) < 10.0 * SHORTEST:
        return End(None, joins=joins)
    if flutters:
        return End(branch.value(branch.flutter(z)), "begins to flutter", joins)
    if outside:
        return End(branch.value(z), "leaves its range", joins)
    crosses = _crosses(branch.fold, z)
    if crosses:
        # Newton's method stops short of where branches meet; the determinant passes through zero there.
        after, before = branch.determinant(z + PAST * tangent), branch.determinant(z - PAST * tangent)
        rest_of_it = 2.0 * PAST * branch.determinant(z) / (before - after) if before != after else math.inf
        z = z + rest_of_it * tangent if abs(rest_of_it) < 0.01 * PAST else z
    return End(branch.value(z), "turns unstable" if crosses else "disappears", joins)


def _successor(branch: RestBranch, z: Floats, direction: float) -> Floats | None:
    """The stable position a little past z that Newton's method finds from there, if it does.

    So near to where equilibria meet, rounding in the gradient moves them by far more than rounding.
    """
    z, far = z.copy(), math.inf
    z[-1] = min(max(z[-1] + PAST * direction, 0.0), 1.0)
    for _ in range(30):
        value, jacobian = branch.rest(z)
        if not np.isfinite(value).all():
            return None
        step = np.linalg.lstsq(jacobian[:, :-1], value)[0]
        z[:-1] -= step
        far = float(np.linalg.norm(step))
    return z if far < 1e-8 and branch.determinant(z) > 0.0 else None


def _crosses(folds: Equations, z: Floats, part: float = CROSSING) -> bool:
    """Whether other equilibria pass through an end, so that there is more than one branch."""
    sizes = np.linalg.svd(folds(z)[1], compute_uv=False)
    return bool(sizes[-1] < part * sizes[0])
