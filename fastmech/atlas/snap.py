"""``fm.find_snap``: the load, or any other parameter's value, at which a resting position ends."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from fastmech.arrays import Floats
from fastmech.atlas.continuation import Equations, newton, tangent_at
from fastmech.atlas.defining import Balance
from fastmech.atlas.systems import Plane, fold, point_at, rest
from fastmech.equilibria.find import Equilibria, Equilibrium, find_equilibria
from fastmech.errors import InputError, shown
from fastmech.models.equilibria import RestingPlace
from fastmech.models.equilibria import find_equilibria as resting_places
from fastmech.models.mechanism import Mechanism
from fastmech.models.stability import assess
from fastmech.objects import Printed
from fastmech.scene import Scene, nearest, require_scene

#: Longest step along the branch [rad, and parts of the range], and the shortest.
STEP, SHORTEST = 0.02, 1e-9

#: How far past a branch that turns back its successor is looked for [parts of the range].
PAST = 2e-3

#: Parameters that move equilibria; the others (m3, beta, alpha) do not.
MOVING = ("F0", "c1", "c2", "m1", "m2", "l", "g")

#: A position that is given by its angles is the stable one within so many rad.
NEAR = 0.1

#: A range by default ends so many times the present value (or one as large as the weights') above zero.
FAR = 100.0

#: Part of the largest singular value below which the fold's equations are singular: the branch goes on there.
CROSSING = 1e-3


#: What a position does at an end of its branch.
How = Literal["disappears", "turns unstable", "begins to flutter", "leaves its range"]


@dataclass(frozen=True, repr=False)
class Snap(Printed):
    """Values of a parameter at which a resting position ends."""

    parameter: str
    unit: str  #: of the parameter
    position: tuple[float, ...]  #: at the present value [rad or m]
    value: float  #: the present value
    below: float | None  #: value at which it ends when the parameter is lowered; None: at no value
    above: float | None  #: value at which it ends when the parameter is raised; None: at no value
    how: tuple[How, How]  #: what it does there, below and above
    searched: tuple[float, float]  #: values that were searched
    exhaustive: bool  #: beyond the range there is no fold, so None means never

    @property
    def answer(self) -> str:
        """Where it ends, in words."""
        ends = [
            f"{how} at {value:.6g} {self.unit}"
            for value, how in zip((self.below, self.above), self.how, strict=True)
            if value is not None
        ]
        nowhere = "no load whatever" if self.parameter == "F0" else f"no {self.parameter} whatever"
        if not self.exhaustive:
            nowhere = (
                "no load in that range" if self.parameter == "F0" else f"no {self.parameter} in that range"
            )
        low, high = self.searched
        beyond = "; no position merges with another beyond" if self.exhaustive else ""
        return (
            f"{' and '.join(ends) or f'disappears at {nowhere}'} "
            f"(searched from {low:.6g} to {high:.6g} {self.unit}{beyond})"
        )

    def told(self) -> str:
        """The answer in words."""
        return self.sentence

    @property
    def sentence(self) -> str:
        """The position, the present value and the answer in words."""
        at = (
            f"{self.value:g} {self.unit}"
            if self.parameter == "F0"
            else f"{self.parameter} = {self.value:g} {self.unit}"
        )
        place = ", ".join(f"{x:z.4f}" for x in self.position)
        return f"the position ({place}) at {at} {self.answer}"


def find_snap(
    system: Scene | Mechanism,
    equilibrium: Any = None,
    searched: tuple[float, float] | None = None,
    *,
    parameter: str | None = None,
) -> Snap:
    """The values of a parameter, below and above the present one, at which a stable position ends.

    The position is followed as the parameter changes, until it merges with a saddle and disappears, or passes
    through other equilibria and is unstable from there on (as symmetric ones do), or begins to flutter. A
    mechanism's loads are at their means. The present load of a scene is F0 where alpha = 0 and 0 where
    alpha > 0, as in ``find_equilibria``; the loads searched are constant ones. (A map or a search for folds
    over F0 asks for alpha = 0, since there F0 would be no load at all.)

    Args:
        system: the mechanism at its present load.
        equilibrium: a stable one of it, or about where it is: coordinates [rad or m], of a scene
            (phi, theta). By default the deepest, of a mechanism the first stable one.
        searched: values to search. A mechanism needs them. By default all at which a scene may have a fold,
            see ``fold_free``, but not more than 100 times the present ones.
        parameter: its name; of a scene one of F0, c1, c2, m1, m2, l, g, and F0 by default.

    Raises:
        InputError: the equilibrium is not stable or not one of the system, there is no stable one, the
            parameter moves no equilibrium, or the range does not hold its present value.
    """
    if isinstance(system, Mechanism):
        return _of_mechanism(system, equilibrium, searched, parameter)
    require_scene(system)
    parameter = "F0" if parameter is None else parameter
    if parameter not in MOVING:
        hint = (
            nearest(parameter, list(MOVING))
            if isinstance(parameter, str)
            else f"allowed: {', '.join(MOVING)}"
        )
        raise InputError(f"parameter = {shown(parameter)}: must be one that moves equilibria; {hint}")
    found = find_equilibria(system)
    held = system.replace(F0=found.force, alpha=0.0)
    chosen = stable_at(found, equilibrium)
    present, unit, _ = held.described()[parameter]
    below, above = fold_free(held, parameter)
    if searched is None:
        far = FAR * max(abs(present), _natural(held, parameter))
        high = min(1.01 * max(above, abs(present)) + (parameter == "F0"), max(far, 1.01 * abs(present)))
        low = -high if parameter == "F0" else 1e-6 * present if below > 0.0 else 0.0
    else:
        low, high = _range(held, searched, parameter, present, unit)
    plane = Plane(held, (parameter,), (low,), (high,))
    start = np.array([chosen.phi, chosen.theta, *plane.parts([present])])
    branch = _Branch(
        rest(plane),
        fold(plane),
        lambda z: float(point_at(plane, z[:, None]).determinant[0]),
        lambda z: float(plane.values(z[2:])[parameter]),
    )
    exhaustive = low <= below and high >= above
    return _snap(branch, start, parameter, unit, (chosen.phi, chosen.theta), present, (low, high), exhaustive)


def _of_mechanism(
    mechanism: Mechanism, equilibrium: Any, searched: tuple[float, float] | None, parameter: str | None
) -> Snap:
    known = mechanism.described()
    if parameter is None or parameter not in known:
        raise InputError(f"parameter = {shown(parameter)}: must be one of {', '.join(known)}")
    present, unit, _ = known[parameter]
    low, high = _range(mechanism, searched, parameter, present, unit)
    balance = Balance(mechanism, {parameter: low}, {parameter: high})
    chosen = _stable_place(balance, equilibrium, present)
    start = balance.point(chosen.position, np.array([present]))
    balance.rescale(start)
    side = np.sign(balance.determinant(start))
    follows = not mechanism.statics().conservative
    branch = _Branch(
        balance.rest,
        balance.singular,
        lambda z: float(side * balance.determinant(z)),
        lambda z: float(balance.values(z)[0]),
        lambda z: follows and balance.flutters(z),
        balance.flutter,
        balance.in_range,
    )
    position = tuple(map(float, chosen.position))
    return _snap(branch, start, parameter, unit, position, present, (low, high), False)


def _stable_place(balance: Balance, wanted: Any, present: float) -> RestingPlace:
    """The stable resting place wanted, one of the list or about where it is; by default the first."""
    mechanism = balance.mechanism
    found = resting_places(mechanism)
    stable = [  # where nothing damps and forces follow, swings that keep their size have to do
        k
        for k, place in enumerate(found)
        if place.orientation != 0
        and assess(mechanism.linear(place.position), place.morse_index).verdict != "unstable"
    ]
    if not stable:
        raise InputError("equilibrium: the mechanism has no stable one")
    if wanted is None:
        return found[stable[0]]
    if isinstance(wanted, RestingPlace):
        if (k := found.index_of(wanted)) in stable:
            return found[k]
        raise InputError(f"equilibrium = {shown(wanted.position.tolist())}: must be a stable one")
    try:
        near = np.asarray(wanted, dtype=np.float64)
    except (TypeError, ValueError):
        near = np.empty(0)
    if near.shape != (balance.n,):
        raise InputError(
            f"equilibrium = {shown(wanted)}: must be one of fastmech.find_equilibria, or its coordinates"
        )
    points = np.array([balance.point(found[k].position, np.array([present])) for k in stable])
    away = np.abs(balance.apart(points, balance.point(near, np.array([present])))).max(axis=1)
    if away.min() <= NEAR:
        return found[stable[int(np.argmin(away))]]
    places = "; ".join(", ".join(f"{x:.4f}" for x in found[k].position) for k in stable)
    raise InputError(f"equilibrium = {shown(near.tolist())}: is near no stable one; they are at {places}")


def _snap(
    branch: _Branch, start: Floats, parameter: str, unit: str, position: tuple[float, ...],
    present: float, searched: tuple[float, float], exhaustive: bool,
) -> Snap:  # fmt: skip
    below, above = (_ending(branch, start, direction) for direction in (-1.0, 1.0))
    how = below[1], above[1]
    return Snap(parameter, unit, position, present, below[0], above[0], how, searched, exhaustive)


def fold_free(scene: Scene, parameter: str) -> tuple[float, float]:
    """Values of a parameter beyond which, on either side, the scene has no fold; the force is constant.

    With the amplitudes of ``fastmech.equilibria.search`` over m2 l, B1 = |((m1 + m2) g - c2 l, F)|,
    B2 = |(m2 g, F)| and B3 = c1 l, there is none where one of 1/B1, 1/B2, 1/B3 is at least the sum of the
    others. The lower value is 0 where the parameter may be 0, and more than 0 where it may not: what is
    between is for the search.
    """
    weight, pull, spring = (scene.m1 + scene.m2) * scene.g, scene.c2 * scene.l, scene.c1 * scene.l
    one, two = math.hypot(weight - pull, scene.F0), math.hypot(scene.m2 * scene.g, scene.F0)

    def apart(a: float, b: float) -> float:
        """The third amplitude from which on its inverse is less than the difference of the others'."""
        return a * b / abs(a - b) if a != b else math.inf

    def over(a: float, b: float) -> float:
        return a / b if b > 0.0 else math.inf if a > 0.0 else 0.0

    if parameter == "F0":
        return -2.0 * spring, 2.0 * spring
    if parameter == "c1":
        return 0.0, apart(one, two) / scene.l
    if parameter == "c2":
        return 0.0, (weight + apart(two, spring)) / scene.l
    if parameter == "g":
        return 0.0, max(over(2.0 * spring, scene.m2), over(pull + 2.0 * spring, scene.m1 + scene.m2))
    tiny = np.nextafter(0.0, 1.0)
    if parameter == "m1":
        return tiny, over(pull + apart(two, spring), scene.g) - scene.m2
    if parameter == "m2":
        return tiny, max(over(2.0 * spring, scene.g), over(pull + 2.0 * spring, scene.g) - scene.m1)
    return tiny, max(over(2.0 * two, scene.c1), over(weight + 2.0 * two, scene.c2))


def _natural(scene: Scene, parameter: str) -> float:
    """A value of a parameter that may be 0 at which it matters as much as the weights, or the spring."""
    weight = (scene.m1 + scene.m2) * scene.g
    return {"F0": 2.0 * scene.c1 * scene.l, "c1": weight / scene.l, "c2": weight / scene.l, "g": 10.0}.get(
        parameter, 0.0
    )


def _range(
    system: Scene | Mechanism, searched: object, parameter: str, present: float, unit: str
) -> tuple[float, float]:
    try:
        ends = np.asarray(searched)
    except ValueError:
        ends = np.array(None)
    if ends.dtype.kind in "iuf" and ends.shape == (2,) and np.isfinite(ends).all():
        low, high = (float(end) for end in ends)
        if low < high and low <= present <= high:
            for end in (low, high):
                system.replace(**{parameter: end})
            return low, high
    told = f"{present:g} {unit}"
    raise InputError(f"searched = {shown(searched)}: must be a range of {parameter} that holds {told}")


def stable_at(found: Equilibria, wanted: Equilibrium | Sequence[float] | None) -> Equilibrium:
    """The stable equilibrium that is given, or that is about (phi, theta) [rad]; by default the deepest.

    Raises:
        InputError: it is none of them, or not stable.
    """
    stable = [item for item in found if item.morse_index == 0]
    if not stable:
        raise InputError("equilibrium: the scene has no stable one")
    if wanted is None:
        return stable[0]
    if isinstance(wanted, Equilibrium):
        chosen = found[found.index_of(wanted)]
        if chosen.morse_index == 0:
            return chosen
        raise InputError(
            f"equilibrium = ({chosen.phi:.6g}, {chosen.theta:.6g}) rad: "
            f"is a {chosen.kind}, must be a stable one"
        )
    try:
        phi, theta = (float(angle) for angle in wanted)
    except (TypeError, ValueError):
        raise InputError(
            f"equilibrium = {shown(wanted)}: must be one of fastmech.find_equilibria, or (phi, theta) in rad"
        ) from None
    away = [math.hypot(2 * math.sin((e.phi - phi) / 2), 2 * math.sin((e.theta - theta) / 2)) for e in stable]
    if min(away) <= NEAR:
        return stable[away.index(min(away))]
    places = ", ".join(f"({e.phi:.4f}, {e.theta:.4f})" for e in stable)
    raise InputError(f"equilibrium = ({phi:g}, {theta:g}) rad: is near no stable one; they are at {places}")


class _Branch(NamedTuple):
    """What is known of the equilibria over one parameter; points are (coordinates, part of its range)."""

    rest: Equations
    fold: Equations
    determinant: Callable[[Floats], float]  #: of the stiffness, positive where the position is stable
    value: Callable[[Floats], float]  #: of the parameter
    flutters: Callable[[Floats], bool] = lambda z: False
    flutter: Callable[[Floats], Floats] = lambda z: z  #: where it begins, from very near
    in_range: Callable[[Floats], bool] = lambda z: bool(0.0 <= z[-1] <= 1.0)


def _ending(branch: _Branch, start: Floats, direction: float) -> tuple[float | None, How]:
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


def _successor(branch: _Branch, z: Floats, direction: float) -> Floats | None:
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
