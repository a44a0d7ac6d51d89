"""Folds and pitchforks over one parameter, all of them, with the proof."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.atlas.axes import check_axis
from fastmech.atlas.continuation import Curve, newton
from fastmech.atlas.cover import apart, solutions
from fastmech.atlas.enclosure import System
from fastmech.atlas.folds import RESIDUAL, merging, sifted
from fastmech.atlas.systems import Plane, families, point_at, rest, suited
from fastmech.scene import Scene

Floats = NDArray[np.float64]

#: Places this near to one another [rad and parts] that the search could not tell apart count as one.
TOGETHER = 1e-3

#: Third derivative, and derivative by the parameter, over the loads, that count as zero at such a place.
FLAT = 1e-3


@dataclass(frozen=True)
class FoldPoint:
    """A value of a parameter at which equilibria merge."""

    value: float
    phi: float  #: where they merge [rad]
    theta: float
    merges: str  #: what merges with a saddle: ``minimum`` or ``maximum``
    kind: str
    """``fold``: two vanish; ``pitchfork``: by symmetry one splits into three. Only where another parameter is
    right to rounding: ``cusp``: three merge into one; ``transcritical``: two meet and part again."""
    residual: float  #: scaled residual of gradient and Hessian's determinant


class FoldPoints(tuple[FoldPoint, ...]):
    """The folds of a range, in rising order."""

    complete: bool  #: it is proved that the range holds no other one
    reason: str  #: why it is not; empty if it is

    def __new__(cls, points: Iterable[FoldPoint], reason: str) -> FoldPoints:
        """The points and why they may not be all."""
        self = super().__new__(cls, points)
        self.complete, self.reason = not reason, reason
        return self


def find_folds(scene: Scene, name: str, values: ArrayLike) -> FoldPoints:
    """All folds of ``scene`` over a range of one parameter, in rising order.

    They are found by branch and prune (``fastmech.atlas.cover``), which proves that none is missing.

    Args:
        scene: gives every other parameter.
        name: the parameter.
        values: rising or falling; the first and the last one are the ends of the range.

    Raises:
        InputError: an unknown name, values that neither rise nor fall or that the scene refuses.
    """
    axis = check_axis(scene, name, values)
    plane = suited(Plane(scene, (name,), (float(axis[0]),), (float(axis[-1]),)))
    points, reasons = [], []
    for family in families(plane):
        found = solutions(family.system, _alone(family.system))
        folds, doubts = sifted(plane, found)
        points += [_point(plane, curve.points[0], family.kind) for curve in folds]
        points += [point for z in _together(found.open) if (point := _singular(plane, z)).residual < RESIDUAL]
        reasons += doubts
    return FoldPoints(sorted(points, key=lambda point: point.value), "; ".join(reasons))


def _alone(system: System) -> Callable[[Floats], Curve | None]:
    def follow(z: Floats) -> Curve | None:
        there = newton(system, z, reach=1e-3)
        return None if there is None else Curve(there[None], np.zeros((1, z.size)), False)

    return follow


def _point(plane: Plane, z: Floats, kind: str) -> FoldPoint:
    p = point_at(plane, z)
    phi, theta = (float(np.mod(angle + np.pi, 2.0 * np.pi) - np.pi) for angle in (p.phi, p.theta))
    value = float(plane.values(z[2:])[plane.names[0]])
    return FoldPoint(value, phi, theta, merging(p), kind, p.residual)


def _together(places: Floats) -> list[Floats]:
    """Middles of places (n, 3) that lie together."""
    middles = []
    while len(places):
        near = np.linalg.norm(apart(places, places[0]), axis=1) < TOGETHER
        middles.append(places[0] + apart(places[near], places[0]).mean(axis=0))
        places = places[~near]
    return middles


def _singular(plane: Plane, z: Floats) -> FoldPoint:
    """The merging where the equations of a fold are singular, by its normal form."""
    p = point_at(plane, z)
    moved = rest(plane)(z)[1][:, 2]  # of the gradient
    h11, h12, h22 = p.hessian
    null = np.array([h12, -h11]) if abs(h11) > abs(h22) else np.array([h22, -h12])
    along = abs(moved @ null) / (np.linalg.norm(null) * np.linalg.norm(moved))
    flat = abs(p.third) < FLAT * p.size
    kind = ("cusp" if flat else "fold") if along > FLAT else ("pitchfork" if flat else "transcritical")
    return _point(plane, z, kind)
