"""A resting position followed as a parameter changes, to where it ends: the branch's equations, its end."""

from __future__ import annotations

import math
from collections.abc import Callable
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

#: How far from where branches meet it is looked how they go [rad, and parts of the range]: they are apart
#: there by the root of that, and it is short beside a step.
PAST = 0.1 * LONGEST

#: So far beyond the last place the forces are those beyond a kink, and ten times as far the branch is, too.
BEYOND = 10.0 * TOUCHING

#: Branches that end so near to each other meet: the last steps beside them are shorter.
MET = 0.01 * PAST

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
    fold: Equations  #: the last one is zero where the stiffness is singular
    determinant: Callable[[Floats], float]  #: of the stiffness, positive where the position is stable
    value: Callable[[Floats], float]  #: of the parameter
    flutters: Callable[[Floats], bool] = lambda z: False
    flutter: Callable[[Floats], Floats] = lambda z: z  #: where it begins, from very near
    in_range: Callable[[Floats], bool] = lambda z: bool(0.0 <= z[-1] <= 1.0)


class End(NamedTuple):
    """Where the branch of a stable position ends."""

    value: float | None  #: of the parameter; None: it does not end in the range
    how: How = "disappears"
    joins: float | None = None  #: value at which it first merges with others and one stable position goes on


class _Place(NamedTuple):
    """A place on a branch."""

    z: Floats
    tangent: Floats  #: of unit length, pointing onwards


#: Why a branch is followed no further, or a step is too long.
_Stop = Literal[How, "meets others"]


def ending(branch: RestBranch, start: Floats, direction: float) -> End:
    """Where the branch from ``start`` ceases to be stable.

    Where a symmetric position takes over from two tilted ones, their branch turns back and is stable on both
    sides: the symmetric one is followed on. Where it begins is well conditioned on that one alone.
    """
    joins: float | None = None
    while True:
        last, stop = _followed(branch, start, direction)
        if stop is None:
            return End(None, joins=joins)
        if stop != "meets others":
            return End(branch.value(last.z), stop, joins)
        successor = _successor(branch, last, direction)
        passing = last if successor is None else _followed(branch, successor, -direction)[0]
        crossing = _crossing(branch, passing, last.z[-1])
        if crossing is None:
            return End(branch.value(last.z), "meets others within rounding", joins)
        if successor is None:
            return End(branch.value(crossing), "turns unstable", joins)
        start, joins = successor, branch.value(crossing) if joins is None else joins


def _followed(branch: RestBranch, start: Floats, direction: float) -> tuple[_Place, _Stop | None]:
    """The last stable place on the branch from ``start``, and why it is the last; None: the range ends.

    A minimum can always be followed a little further. Where no step succeeds, the branch has come as near to
    its end as a step is short.
    """
    here = _Place(start, _tangent(branch, start, np.append(np.zeros(start.size - 1), direction)))
    step, stop = 0.25 * LONGEST, None
    while True:
        there, stop = _corrected(branch, here, step)
        if there is not None and (branch.determinant(there.z) <= 0.0 or direction * there.tangent[-1] < 0.0):
            fold = _fold(branch, here, there)
            if fold is not None:
                return fold
        elif there is not None and not _two_folds(branch, here, there):
            here, step = there, min(LONGEST, 1.5 * step)
            continue
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
        return here, "meets others"
    return here, stop or "disappears"


def _corrected(branch: RestBranch, here: _Place, step: float) -> tuple[_Place | None, _Stop | None]:
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


def _fold(branch: RestBranch, here: _Place, there: _Place) -> tuple[_Place, _Stop] | None:
    """The fold of a step that turns unstable, or others are met there; None if the step is too long."""
    step = float(np.linalg.norm(there.z - here.z))
    fold = newton(branch.fold, 0.5 * (here.z + there.z), step, left=UNSETTLED * step)
    if fold is None or not branch.in_range(fold):
        return None
    return (here, "meets others") if _hidden(branch, fold) else (here._replace(z=fold), "disappears")


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


def _hidden(branch: RestBranch, fold: Floats) -> bool:
    """Whether rounding of the forces moves a fold so far that its equations are no longer regular."""
    jacobian = branch.fold(fold)[1]
    sizes, directions = np.linalg.svd(jacobian)[1:]
    if sizes[-1] <= ROUNDING:
        return True
    changed = branch.fold(fold + ROUNDING / sizes[-1] * directions[-1])[1] - jacobian
    return bool(np.linalg.norm(np.linalg.solve(jacobian, changed @ directions[-1])) > CLEAR)


def _crossing(branch: RestBranch, last: _Place, there: float) -> Floats | None:
    """Where others meet a branch that passes, very near its last place and a value: not stiff there.

    None: it is not so near, and the branches do not meet quite.
    """
    z, past = last.z, PAST * last.tangent
    after, before = branch.determinant(z + past), branch.determinant(z - past)
    if before == after:
        return None
    crossing = z + 2.0 * branch.determinant(z) / (before - after) * past
    return crossing if max(np.linalg.norm(crossing - z), abs(crossing[-1] - there)) < MET else None


def _successor(branch: RestBranch, last: _Place, direction: float) -> Floats | None:
    """Where a branch turns back as it meets others, the stable position a little past that, if there is one.

    So near to where equilibria meet, rounding in the gradient moves them by far more than rounding.
    """
    beyond = newton(branch.rest, last.z + PAST * last.tangent, PAST, last.tangent)
    if beyond is None or direction * (beyond[-1] - last.z[-1]) > 0.0:
        return None
    z, far = last.z.copy(), math.inf
    z[-1] = min(max(z[-1] + PAST * direction, 0.0), 1.0)
    for _ in range(30):
        value, jacobian = branch.rest(z)
        if not np.isfinite(value).all():
            return None
        step = np.linalg.lstsq(jacobian[:, :-1], value)[0]
        z[:-1] -= step
        far = float(np.linalg.norm(step))
    return z if far < 1e-8 and branch.determinant(z) > 0.0 else None
