"""The load at which the present resting position disappears."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastmech.atlas.continuation import newton, tangent_at
from fastmech.atlas.systems import Plane, fold, point_at, rest
from fastmech.equilibria.find import Equilibrium, find_equilibria
from fastmech.errors import InputError
from fastmech.scene import Scene

Floats = NDArray[np.float64]

#: Longest step along the branch [rad, and parts of the range].
STEP = 0.02


@dataclass(frozen=True)
class Snap:
    """Loads at which a resting position disappears; forces in N, angles in rad."""

    phi: float  #: the position at the present load
    theta: float
    force: float  #: the present load
    below: float | None  #: load at which it disappears when the load is lowered; None: at no load
    above: float | None  #: load at which it disappears when the load is raised; None: at no load
    searched: tuple[float, float]  #: loads that were searched
    exhaustive: bool  #: beyond the range there is no fold, so None means never

    @property
    def answer(self) -> str:
        """Where it disappears, in words."""
        loads = [f"{load:.6g} N" for load in (self.below, self.above) if load is not None]
        gone = " and at ".join(loads) or ("no load whatever" if self.exhaustive else "no load in that range")
        low, high = self.searched
        beyond = "; no position merges with another beyond" if self.exhaustive else ""
        return f"disappears at {gone} (searched from {low:.6g} to {high:.6g} N{beyond})"

    @property
    def sentence(self) -> str:
        """The position, its load and the answer in words."""
        return f"the position ({self.phi:z.4f}, {self.theta:z.4f}) rad at {self.force:g} N {self.answer}"


def find_snap(
    scene: Scene,
    equilibrium: Equilibrium | None = None,
    searched: tuple[float, float] | None = None,
) -> Snap:
    """The constant loads F0, below and above the present one, at which a stable position disappears.

    The position is followed as the load changes, until it merges with a saddle. The present load is F0 where
    alpha = 0 and 0 where alpha > 0, as in ``find_equilibria``; the loads searched are constant ones. (A map
    or a search for folds over F0 asks for alpha = 0, since there F0 would be no load at all.)

    Args:
        scene: the mechanism at its present load.
        equilibrium: a stable one of the scene; by default the deepest.
        searched: loads to search [N]; by default all at which a fold is possible. With |F| >= 2 c1 l there
            is none: then A1/A2 + A1/A3 <= 1 for the amplitudes of ``fastmech.equilibria.balance``.

    Raises:
        InputError: the equilibrium is not stable or not one of the scene, there is no stable one, or the
            range does not hold the present load.
    """
    found = find_equilibria(scene)
    present = found.force
    everywhere = 2.0 * scene.c1 * scene.l
    limit = 1.01 * max(everywhere, abs(present)) + 1.0
    low, high = (-limit, limit) if searched is None else _range(searched, present)
    chosen = _chosen(found.items, equilibrium)
    plane = Plane(scene.replace(F0=present, alpha=0.0), ("F0",), (low,), (high,))
    start = np.array([chosen.phi, chosen.theta, *plane.parts([present])])
    return Snap(
        chosen.phi,
        chosen.theta,
        present,
        _merging(plane, start, -1.0),
        _merging(plane, start, 1.0),
        (low, high),
        low <= -everywhere and high >= everywhere,
    )


def _range(searched: object, present: float) -> tuple[float, float]:
    try:
        ends = np.asarray(searched)
    except ValueError:
        ends = np.array(None)
    if ends.dtype.kind in "iuf" and ends.shape == (2,) and np.isfinite(ends).all():
        low, high = (float(end) for end in ends)
        if low < high and low <= present <= high:
            return low, high
    raise InputError(f"searched = {searched!r}: must be a range of forces [N] that holds {present:g} N")


def _chosen(items: tuple[Equilibrium, ...], wanted: Equilibrium | None) -> Equilibrium:
    stable = [item for item in items if item.morse_index == 0]
    if not stable:
        raise InputError("equilibrium: the scene has no stable one")
    if wanted is None:
        return stable[0]
    if not isinstance(wanted, Equilibrium):
        raise InputError(f"equilibrium = {wanted!r}: must be one that find_equilibria gives")
    for item in stable:
        if math.hypot(item.phi - wanted.phi, item.theta - wanted.theta) <= 1e-6:
            return item
    raise InputError(
        f"equilibrium = ({wanted.phi:.6g}, {wanted.theta:.6g}): must be a stable one of the scene at its load"
    )


def _merging(plane: Plane, start: Floats, direction: float) -> float | None:
    """Load at which the branch from ``start`` first turns back, None if it leaves the range before.

    A minimum can always be followed a little further. Where no step succeeds, the branch has come as near to
    its end as a step is short, and what Newton's method cannot polish there is that end.
    """
    equations = rest(plane)
    z, step = start, 0.25 * STEP
    tangent = tangent_at(equations, z)
    tangent = tangent * math.copysign(1.0, tangent[2] * direction)
    while 0.0 <= z[2] <= 1.0 and step > 1e-9:
        there = newton(equations, z + step * tangent, 0.3 * step, tangent)
        ahead = None if there is None else tangent_at(equations, there)
        if there is None or ahead is None or abs(ahead @ tangent) < 0.985:
            step *= 0.5
            continue
        ahead = ahead * math.copysign(1.0, ahead @ tangent)
        if float(point_at(plane, there[:, None]).determinant[0]) <= 0.0:
            turn = newton(fold(plane), 0.5 * (z + there), 4.0 * step)
            if turn is not None:
                load = float(plane.values(turn[2:])["F0"])
                return load if plane.low[0] <= load <= plane.high[0] else None
            step *= 0.5
            continue
        z, tangent, step = there, ahead, min(STEP, 1.5 * step)
    return float(plane.values(z[2:])["F0"]) if 0.0 <= z[2] <= 1.0 else None
