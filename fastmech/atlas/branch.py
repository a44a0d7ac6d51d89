"""A resting position followed as a parameter changes, to where it ends: the branch's equations, its end."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import count
from typing import Literal, NamedTuple

import numpy as np

from fastmech.arrays import Floats
from fastmech.atlas.continuation import LONGEST, TOUCHING, TURN, Equations, newton, tangent_at

#: A Jacobian that changes by less than itself stays regular (Neumann's series). A step, or rounding, may
#: change it by half of that: between a branch and another that is near, it is singular.
CLEAR = 0.5

#: A part of the largest force that is this small is rounding: some tens of units in the last place.
ROUNDING = 1e-14

#: Newton's last step, over the branch's, may be this long where rounding keeps it from settling.
UNSETTLED = 1e-3

#: So long is a branch followed by its tangent from where it crosses another, at most: short beside a step.
PAST = 0.1 * LONGEST

#: A branch is so straight, from where it crosses another to a place on it, as parts of their distance.
STRAIGHT = 0.1

#: So far beyond the last place the forces are those beyond a kink, and ten times as far the branch is, too.
BEYOND = 10.0 * TOUCHING

#: Second derivatives are differences of first ones, over twice this.
APART = 1e-6

#: Steps along a branch at most. Where forces do not grow with the parameter as stiffness does, as under
#: follower forces, the farther the shorter they are.
MOST_STEPS = 4000

#: Rounding of forces hides the fold of a branch that slopes by less where another crosses it: a cubic's.
FLAT = ROUNDING ** (1.0 / 3.0)

#: What a position does at an end of its branch. The last is said where the branch can be followed no further
#: and its equations are singular, but no fold and no crossing of two branches is found.
How = Literal[
    "disappears", "turns unstable", "begins to flutter", "leaves its range", "meets others within rounding"
]


class EndlessError(Exception):
    """A branch takes more steps than any is worth."""


class RestBranch(NamedTuple):
    """What is known of the equilibria over one parameter; points are (coordinates, part of its range)."""

    rest: Equations
    fold: Equations  #: the last one is zero where the stiffness is singular
    determinant: Callable[[Floats], float]  #: of the stiffness, positive where the position is stable
    value: Callable[[Floats], float]  #: of the parameter
    flutters: Callable[[Floats], bool] = lambda z: False
    flutter: Callable[[Floats], Floats] = lambda z: z  #: where it begins, from very near
    in_range: Callable[[Floats], bool] = lambda z: bool(0.0 <= z[-1] <= 1.0)


class End(NamedTuple):
    """Where the branch of a stable position ends."""

    value: float | None  #: of the parameter; None: it does not end in the range
    how: How | None = None  #: what it does there
    joins: float | None = None  #: value at which it first merges with others and one stable position goes on


class _Place(NamedTuple):
    """A place on a branch."""

    z: Floats
    tangent: Floats  #: of unit length, pointing onwards
    across: Floats | None = None  #: tangent of another branch that crosses there


def ending(branch: RestBranch, start: Floats, direction: float) -> End:
    """Where the branch from ``start`` ceases to be stable.

    Where another branch crosses it, both exchange their stability. Where it turns back there, as two tilted
    positions do that straighten up (a pitchfork), the other one is followed on.

    Raises:
        EndlessError: it takes too many steps.
    """
    joins: float | None = None
    while True:
        last, stop = _followed(branch, start, direction)
        if last.across is None:
            return End(None, joins=joins) if stop is None else End(branch.value(last.z), stop, joins)
        if direction * last.tangent[-1] > FLAT:
            return End(branch.value(last.z), "turns unstable", joins)
        tangent = last.across * math.copysign(1.0, direction * last.across[-1])
        successor = newton(branch.rest, last.z + PAST * tangent, 0.5 * PAST, tangent)
        if successor is None or branch.determinant(successor) <= 0.0:
            return End(branch.value(last.z), "disappears", joins)
        start, joins = successor, branch.value(last.z) if joins is None else joins


def _followed(branch: RestBranch, start: Floats, direction: float) -> tuple[_Place, How | None]:
    """The last stable place on the branch from ``start``, and why it is the last; None: the range ends.

    A minimum can always be followed a little further. Where no step succeeds, the branch has come as near to
    its end as a step is short.
    """
    here = _Place(start, _tangent(branch, start, np.append(np.zeros(start.size - 1), direction)))
    step, stop = 0.25 * LONGEST, None
    for tried in count():
        if tried == MOST_STEPS:
            raise EndlessError
        there, stop = _corrected(branch, here, step)
        ends = there and (branch.determinant(there.z) <= 0.0 or direction * there.tangent[-1] < 0.0)
        if there is not None and not ends and not _two_folds(branch, here, there):
            here, step = there, min(LONGEST, 1.5 * step)
            continue
        crossing = _crossing(branch, here, step)
        if crossing is not None and direction * crossing.tangent[-1] >= -FLAT:  # no fold comes before it
            return crossing, "turns unstable"
        if there is not None and ends:
            fold = _fold(branch, here, there)
            if fold is not None:
                return fold, "disappears"
        step *= 0.5
        if step <= TOUCHING:
            over, end = _over_kink(branch, here)
            if end is not None:
                return here, end
            if over is None:
                break
            here, step = over, 0.25 * LONGEST
    if min(here.z[-1], 1.0 - here.z[-1]) < 10.0 * TOUCHING:
        return here, None
    if stop == "begins to flutter":
        return here._replace(z=branch.flutter(here.z)), stop
    if stop != "leaves its range" and _meets_others(branch, here):
        return here, "meets others within rounding"
    return here, stop or "disappears"


def _corrected(branch: RestBranch, here: _Place, step: float) -> tuple[_Place | None, How | None]:
    """The next place, by a step along the tangent and Newton's method; None, and why: it is too long."""
    predicted = here.z + step * here.tangent
    z = newton(branch.rest, predicted, 0.5 * step, here.tangent, left=UNSETTLED * step)
    if z is None or max(_change(branch.rest, here.z, x) for x in (predicted, z)) > CLEAR:
        return None, "disappears"
    if not branch.in_range(z):
        return None, "leaves its range"
    tangent = _tangent(branch, z, here.tangent)
    if tangent @ here.tangent < TURN:
        return None, "disappears"
    return (None, "begins to flutter") if branch.flutters(z) else (_Place(z, tangent), None)


def _over_kink(branch: RestBranch, here: _Place) -> tuple[_Place | None, How | None]:
    """The stable place beyond a kink of the forces, as where a contact opens, or how it ends on the kink.

    Where no matrix between the two stiffnesses is singular, the branch goes on, and stable (Clarke 1976).
    None and None: there is no kink, or the branch turns back on it.
    """
    across = here.z + BEYOND * here.tangent
    change = _change(branch.rest, here.z, across)
    if not np.isfinite(change):
        return None, None
    tangent = _tangent(branch, across, np.append(np.zeros(across.size - 1), here.tangent[-1]))
    if change <= CLEAR and tangent @ here.tangent >= TURN:
        return None, None
    there, stop = _corrected(branch, _Place(across, tangent), 10.0 * BEYOND)
    if there is None:
        return None, stop if stop == "begins to flutter" else None
    if branch.determinant(across) * branch.determinant(there.z) <= 0.0:  # that is not beyond the kink
        return None, None
    before, after = (branch.rest(z)[1][:, :-1] for z in (here.z, across))
    ratios = np.linalg.eigvals(np.linalg.solve(before, after))
    turns = ((ratios.imag == 0.0) & (ratios.real <= 0.0)).any()
    return (None, "turns unstable") if turns else (there, None)


def _tangent(branch: RestBranch, z: Floats, onwards: Floats) -> Floats:
    """Unit tangent of the branch, pointing onwards."""
    tangent = tangent_at(branch.rest, z)
    return tangent * math.copysign(1.0, tangent @ onwards)


def _fold(branch: RestBranch, here: _Place, there: _Place) -> _Place | None:
    """The fold of a step that turns unstable; None if the step is too long."""
    step = float(np.linalg.norm(there.z - here.z))
    fold = newton(branch.fold, 0.5 * (here.z + there.z), step, left=UNSETTLED * step)
    return here._replace(z=fold) if fold is not None and branch.in_range(fold) else None


def _two_folds(branch: RestBranch, here: _Place, there: _Place) -> bool:
    """Whether a step goes over two folds, as beside a cusp: its stiffness is least between, one is found."""
    hardens = []
    for place in (here, there):
        value, jacobian = branch.fold(place.z)
        hardens.append(jacobian[-1] @ place.tangent * value[-1] > 0.0)
    if hardens != [False, True]:
        return False
    reach = float(np.linalg.norm(there.z - here.z))
    return newton(branch.fold, 0.5 * (here.z + there.z), reach) is not None


def _meets_others(branch: RestBranch, last: _Place) -> bool:
    """Whether the branch was regular a little before its last place and is hardly so there."""
    return _change(branch.rest, last.z, last.z - PAST * last.tangent) > 1.0 / CLEAR


def _change(equations: Equations, z: Floats, there: Floats) -> float:
    """How much a Jacobian changes between two places, over itself: if by less than 1, it stays regular."""
    jacobian, other = equations(z)[1], equations(there)[1]
    if not np.isfinite([jacobian, other]).all():
        return math.inf
    return float(np.linalg.norm(np.linalg.pinv(jacobian, rcond=0.0) @ (other - jacobian), 2))


def _crossing(branch: RestBranch, here: _Place, step: float) -> _Place | None:
    """Where another branch crosses this one ahead, as near as a step; None: none, or forces break it up.

    With v, the least singular vector of the forces' Jacobian J, f + b v = 0, v J = 0 and v v = 1 hold where
    branches cross (Moore 1980), also where they only nearly do: b is the force that keeps them apart.
    """
    n = here.z.size - 1
    v = np.linalg.svd(branch.rest(here.z)[1])[0][:, -1]
    found = newton(_meeting(branch.rest), np.concatenate([here.z, v, [0.0]]), 1.0, left=UNSETTLED * step)
    if found is None:
        return None
    z, away = found[: n + 1], found[: n + 1] - here.z
    jacobian = branch.rest(z)[1]
    bent = _bent(branch.rest, z, found[n + 1 : -1])
    size = 1.0 + float(np.linalg.norm(jacobian)) + float(np.linalg.norm(bent))
    ahead = np.linalg.norm(away) < LONGEST and away @ here.tangent > 0.0 and branch.in_range(z)
    if not ahead or abs(found[-1]) > ROUNDING * size:
        return None
    level = np.linalg.svd(jacobian)[2][-2:]  # both branches are in this plane, where bent is zero along them
    (low, high), axes = np.linalg.eigh(level @ bent @ level.T)
    if not low < 0.0 < high:
        return None
    one, other = (
        (math.sqrt(high) * axes[:, 0] + s * math.sqrt(-low) * axes[:, 1]) @ level / math.sqrt(high - low)
        for s in (1.0, -1.0)
    )
    if max(abs(one[-1]), abs(other[-1])) <= FLAT:  # no branch passes: more than two meet
        return None
    for tangent, across in ((one, other), (other, one)):
        onwards = tangent * math.copysign(1.0, away @ tangent)
        reach = float(away @ onwards)
        near = min(PAST, 0.25 * reach)
        back, between = (
            newton(branch.rest, z - s * onwards, STRAIGHT * s, onwards, left=UNSETTLED * s)
            for s in (reach, near)
        )
        if back is None or between is None or np.linalg.norm(back - here.z) > UNSETTLED * reach:
            continue
        if branch.determinant(between) > 0.0:  # no fold lies between
            return _Place(z, onwards, across)
    return None


def _meeting(rest: Equations) -> Equations:
    """The equations of ``_crossing``; their unknowns are (z, v, b)."""

    def equations(y: Floats) -> tuple[Floats, Floats]:
        n = y.size // 2 - 1
        z, v, b = y[: n + 1], y[n + 1 : -1], y[-1]
        value, jacobian = rest(z)
        rows = np.zeros((y.size, y.size))
        rows[:n, : n + 1], rows[:n, n + 1 : -1], rows[:n, -1] = jacobian, b * np.eye(n), v
        rows[n:-1, : n + 1], rows[n:-1, n + 1 : -1] = _bent(rest, z, v), jacobian.T
        rows[-1, n + 1 : -1] = 2.0 * v
        return np.concatenate([value + b * v, v @ jacobian, [v @ v - 1.0]]), rows

    return equations


def _bent(rest: Equations, z: Floats, v: Floats) -> Floats:
    """Second derivatives of v f by all unknowns."""
    ahead, back = (np.array([v @ rest(z + s * e)[1] for e in np.eye(z.size)]) for s in (APART, -APART))
    slopes = (ahead - back) / (2.0 * APART)
    return np.asarray(0.5 * (slopes + slopes.T))
