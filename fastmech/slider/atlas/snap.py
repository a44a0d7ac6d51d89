"""A scene's resting position over one parameter: where it ends, and beyond which values there is no fold."""

from __future__ import annotations

import math

import numpy as np

from fastmech.arrays import Floats
from fastmech.atlas.branch import RestBranch
from fastmech.errors import InputError, shown
from fastmech.scene import Scene, nearest
from fastmech.slider.atlas.systems import Plane, fold, point_at, rest
from fastmech.slider.equilibria import Equilibrium

#: Parameters that move equilibria; the others (m3, beta, alpha) do not.
MOVING = ("F0", "c1", "c2", "m1", "m2", "l", "g")

#: A range by default ends so many times the present value (or one as large as the weights') above zero.
FAR = 100.0


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
    weight = (scene.m1 + scene.m2) * scene.g / scene.l
    return {"F0": 2.0 * scene.c1 * scene.l, "c1": weight, "c2": weight, "g": 10.0}.get(parameter, 0.0)
