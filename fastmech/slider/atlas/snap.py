"""A scene's resting position over one parameter: where it ends, and beyond which values there is no fold."""

from __future__ import annotations

import math

import numpy as np

from fastmech.arrays import Flags, Floats
from fastmech.atlas.branch import End, RestBranch
from fastmech.errors import InputError, shown
from fastmech.outcome import Outcome
from fastmech.scene import Scene, nearest
from fastmech.slider.atlas.cover import apart
from fastmech.slider.atlas.folds import FoldPoint, find_folds
from fastmech.slider.atlas.systems import Plane, fold, point_at, rest
from fastmech.slider.coefficients import reduce
from fastmech.slider.equilibria import Equilibrium
from fastmech.slider.solve import solve_rows

#: Parameters that move equilibria; the others (m3, beta, alpha) do not.
MOVING = ("F0", "c1", "c2", "m1", "m2", "l", "g")

#: A range by default ends so many times the present value (or one as large as the weights') above zero.
FAR = 100.0

#: Parts of the way to a fold that are left where it is looked which minimum it takes; that one is nearer to
#: the place of the fold than others by this factor, and the same as another within so many rad.
BEFORE, NEARER, SAME = tuple(10.0 ** (-0.5 * k) for k in range(8, 21)), 2.0, 1e-6

#: A step moves a minimum by this part of its distance to other equilibria; the shortest, of the whole way.
CLEAR, SHORTEST_STEP = 0.2, 1e-13


def moving(parameter: object) -> str:
    """A parameter's name, if it moves equilibria.

    Raises:
        InputError: it does not, or is none.
    """
    if isinstance(parameter, str) and parameter in MOVING:
        return parameter
    hint = nearest(parameter, list(MOVING)) if isinstance(parameter, str) else f"allowed: {', '.join(MOVING)}"
    raise InputError(f"parameter = {shown(parameter)}: must be one that moves equilibria; {hint}")


def branch_of(
    scene: Scene, parameter: str, chosen: Equilibrium, searched: tuple[float, float]
) -> tuple[RestBranch, Floats]:
    """The equilibria of a scene with a constant force over a parameter's range, and the one to begin with."""
    plane = Plane(scene, (parameter,), searched[:1], searched[1:])
    branch = RestBranch(
        rest(plane),
        fold(plane),
        lambda z: float(point_at(plane, z[:, None]).determinant[0]),
        lambda z: float(plane.values(z[2:])[parameter]),
    )
    return branch, np.array([chosen.phi, chosen.theta, *plane.parts([getattr(scene, parameter)])])


def range_of_folds(scene: Scene, parameter: str) -> tuple[float, float]:
    """Values that hold all folds of a scene with a constant force, or 100 times the present ones."""
    below, above = fold_free(scene, parameter)
    present = abs(getattr(scene, parameter))
    far = FAR * max(present, _natural(scene, parameter))
    high = min(1.01 * max(above, present) + (parameter == "F0"), max(far, 1.01 * present))
    return -high if parameter == "F0" else 1e-6 * present if below > 0.0 else 0.0, high


def fold_free(scene: Scene, parameter: str) -> tuple[float, float]:
    """Values of a parameter beyond which, on either side, the scene has no fold; the force is constant.

    With the amplitudes of ``fastmech.slider.theorem`` over m2 l, B1 = |((m1 + m2) g - c2 l, F)|,
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


def ends_at_folds(
    scene: Scene, parameter: str, chosen: Equilibrium, searched: tuple[float, float]
) -> list[End] | None:
    """Where, below and above the present value, a stable position of a held scene ends, and how.

    Between folds that are proved to be all its minima go on one by one, so each is followed through the
    proved lists; which of them a fold takes is told by where it merges. Where folds are not proved to be all,
    it is followed to the ends of the range, too.

    Returns:
        None: not all that merges are folds, or, beside perfect symmetry, lists do not tell which position a
        fold takes; the continuation has to do.
    """
    found = find_folds(scene, parameter, searched)
    if any(point.kind not in ("fold", "cusp") for point in found):
        return None
    present = float(getattr(scene, parameter))
    ends: list[End] = []
    for side, last in zip((-1.0, 1.0), searched, strict=True):
        ahead = [p for p in found if p.merges == "minimum" and side * (p.value - present) > 0.0]
        place, at = np.array([chosen.phi, chosen.theta]), present
        end = End(None)
        for point in sorted(ahead, key=lambda p: side * p.value):
            ends_there, place, at = _ends_at(scene, parameter, (place, at), point)
            if ends_there is None:
                return None
            if ends_there:
                end = End(point.value)
                break
        if (
            end.value is None
            and not found.complete
            and _followed(scene, parameter, (place, at), last) is None
        ):
            return None
        ends.append(end)
    return ends


def _ends_at(
    scene: Scene, parameter: str, start: tuple[Floats, float], fold: FoldPoint
) -> tuple[bool | None, Floats, float]:
    """Whether a fold takes a minimum (None: not known), where that is shortly before, and that value.

    Beside perfect symmetry two minima are equally near to a fold that takes one of them, until they are so
    near to each other that no list tells them apart.
    """
    place, at = start
    there, span = np.array([fold.phi, fold.theta]), fold.value - at
    if parameter != "F0":  # beyond a fold near zero, too, values are such as a scene may have
        span = math.copysign(min(abs(span), abs(fold.value)), span)
    for share in BEFORE:
        value = fold.value - share * span
        followed = _followed(scene, parameter, (place, at), value)
        if followed is None:
            break
        place, at = followed, value
        values = (at, fold.value + share * span)
        minima, beyond = (
            positions[lowest] for positions, lowest in (_at(scene, parameter, value) for value in values)
        )
        if len(beyond) == len(minima) + 1 > 1:
            return False, place, at  # one begins there
        if len(beyond) != len(minima) - 1 or not len(beyond):
            continue
        away = np.linalg.norm(apart(minima, there), axis=1)
        nearest = minima[away <= NEARER * away.min()]
        if (np.linalg.norm(apart(nearest, place), axis=1) > SAME).all():
            return False, place, at
        if len(nearest) == 1:
            return True, place, at
    return None, place, at


def _at(scene: Scene, parameter: str, value: float) -> tuple[Floats, Flags]:
    """All equilibria (n, 2) at a value, and which of them are minima; nothing where they are not proved."""
    rows = np.array([reduce(scene.replace(**{parameter: value}))])
    found = solve_rows(rows, compiled=False)
    count = int(found.count[0]) if found.outcome[0] == Outcome.COMPLETE else 0
    return np.stack([found.phi[0, :count], found.theta[0, :count]], axis=-1), found.index[0, :count] == 0


def _followed(scene: Scene, parameter: str, start: tuple[Floats, float], end: float) -> Floats | None:
    """Where a minimum is at another value: steps miss it by little beside its distance to others."""
    place, at = start
    step, least, slope = end - at, SHORTEST_STEP * abs(end - at), np.zeros(2)

    def clear(value: float, near: Floats) -> tuple[Floats, float, float]:
        """The minimum nearest to a place, how far it is from there, and all other equilibria from it."""
        found, lowest = _at(scene, parameter, value)
        if not len(found):
            return near, math.inf, 0.0
        away = np.linalg.norm(apart(found, near), axis=1)
        k = int(away.argmin())
        others = np.linalg.norm(apart(np.delete(found, k, axis=0), found[k]), axis=1)
        return found[k], float(away[k]) if lowest[k] else math.inf, float(others.min(initial=np.pi))

    _, _, room = clear(at, place)
    while at != end:
        value = end if abs(end - at) <= abs(step) else at + step
        there, missed, other = clear(value, place + slope * (value - at))
        if missed > CLEAR * min(room, other):
            step *= 0.5
            if abs(step) < least or at + step == at:
                return None
            continue
        slope = apart(there, place) / (value - at)
        place, at, room, step = there, value, other, 2.0 * step
    return place
