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

#: How far past a branch that turns back its successor is looked for [parts of the range].
PAST = 2e-3

#: A position that is given is the stable one within so many rad, lengths over their ranges by 2 pi.
NEAR = 0.1

#: Part of the largest singular value below which the fold's equations are singular: the branch goes on there.
CROSSING = 1e-3


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
    flutters: Callable[[Floats], bool] = lambda z: False
    flutter: Callable[[Floats], Floats] = lambda z: z  #: where it begins, from very near
    in_range: Callable[[Floats], bool] = lambda z: bool(0.0 <= z[-1] <= 1.0)


def ending(branch: RestBranch, start: Floats, direction: float) -> tuple[float | None, How]:
    """Value at which the branch from ``start`` ceases to be stable, and what it does there.

    None if it leaves the parameter's range before. A minimum can always be followed a little further. Where
    no step succeeds, the branch has come as near to its end as a step is short, and what Newton's method
    cannot polish there is that end. Where a symmetric position takes over from two tilted ones, their branch
    turns back and is stable on both sides: the symmetric one is followed on.
    """
    along = np.zeros(start.size)
    along[-1] = direction
    z, step, flutters, outside = start, 0.25 * STEP, False, False
    tangent = tangent_at(branch.rest, z)
    tangent = tangent * math.copysign(1.0, tangent @ along)
    while step > SHORTEST:
        there = newton(branch.rest, z + step * tangent, 0.3 * step, tangent)
        ahead = None if there is None else tangent_at(branch.rest, there)
        inside = there is not None and branch.in_range(there)
        if there is None or ahead is None or abs(ahead @ tangent) < 0.985 or not inside:
            outside = there is not None and not inside
            step *= 0.5
            continue
        if branch.flutters(there):
            flutters, step = True, 0.5 * step
            continue
        ahead = ahead * math.copysign(1.0, ahead @ tangent)
        unstable = branch.determinant(there) <= 0.0
        if unstable or ahead @ along < 0.0:
            turn = newton(branch.fold, 0.5 * (z + there), 4.0 * step) if unstable else z
            if turn is None or (not unstable and step > PAST):
                step *= 0.5
                continue
            z = turn
            beyond = _successor(branch, z, direction) if _crosses(branch.fold, z) else None
            if beyond is None:
                break
            there, ahead = beyond, tangent_at(branch.rest, beyond)
            ahead = ahead * math.copysign(1.0, ahead @ along)
        z, tangent, step, flutters = there, ahead, min(STEP, 1.5 * step), False
    if min(z[-1], 1.0 - z[-1]) < 10.0 * SHORTEST:
        return None, "disappears"
    if flutters:
        return branch.value(branch.flutter(z)), "begins to flutter"
    if outside:
        return branch.value(z), "leaves its range"
    crosses = _crosses(branch.fold, z)
    if crosses:
        # Newton's method stops short of where branches meet; the determinant passes through zero there.
        after, before = branch.determinant(z + PAST * tangent), branch.determinant(z - PAST * tangent)
        rest_of_it = 2.0 * PAST * branch.determinant(z) / (before - after) if before != after else math.inf
        z = z + rest_of_it * tangent if abs(rest_of_it) < 0.01 * PAST else z
    return branch.value(z), "turns unstable" if crosses else "disappears"


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


def _crosses(folds: Equations, z: Floats) -> bool:
    """Whether other equilibria pass through an end, so that there is more than one branch."""
    sizes = np.linalg.svd(folds(z)[1], compute_uv=False)
    return bool(sizes[-1] < CROSSING * sizes[0])
