"""Folds over one parameter; fold curves, pitchfork curves and cusps over two: all of them, with the proof."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Floats
from fastmech.atlas.continuation import LONGEST, Curve, finish_on_edge, inside, newton, trace
from fastmech.ensembles.checks import check_pair
from fastmech.objects import Drawn, Printed, counted
from fastmech.scene import Scene
from fastmech.slider.atlas.axes import check_axis
from fastmech.slider.atlas.cover import Covered, DefiningSystem, apart, solutions
from fastmech.slider.atlas.systems import ParameterPoint, Plane, cusp, families, point_at, rest, suited

#: Points after which no further curve is begun.
MOST_POINTS = 40_000

#: Scaled residual of a fold; solutions of the equations of a symmetry that are none have much larger ones.
RESIDUAL = 1e-9

#: Third derivative over the loads at an end of a curve below which a cusp is looked for there.
NEARLY = 1e-2


@dataclass(frozen=True, eq=False)
class FoldCurve:
    """A curve on which equilibria merge; arrays over its points, in order."""

    x: Floats  #: values of the first parameter
    y: Floats  #: values of the second one
    phi: Floats  #: where they merge [rad]
    theta: Floats  #: [rad]
    closed: bool  #: the last point is the first one
    merges: str  #: what merges with a saddle: ``minimum`` (a resting position disappears) or ``maximum``
    kind: str  #: ``fold``: two vanish; ``pitchfork``: by symmetry one splits into three
    residual: float  #: largest scaled residual of gradient and Hessian's determinant on the curve


@dataclass(frozen=True, eq=False)
class CuspPoint:
    """Where two folds meet and three equilibria merge."""

    x: float
    y: float
    phi: float  #: [rad]
    theta: float  #: [rad]
    residual: float  #: scaled


@dataclass(frozen=True, eq=False, repr=False)
class FoldSet(Drawn):
    """The folds of a plane of two parameters."""

    names: tuple[str, str]
    curves: tuple[FoldCurve, ...]
    cusps: tuple[CuspPoint, ...]
    complete: bool  #: it is proved that the rectangle holds no other curve
    reason: str  #: why it is not; empty if it is

    KIND = "fold_curves"
    LAYOUT = "scan_types.map_layout:fold_curves"
    PICTURE = "plots.objects:draw_curves_of"

    def told(self) -> str:
        """How many curves of which kind, and whether these are all."""
        kinds = Counter(f"{c.kind} of a {c.merges}" for c in self.curves)
        each = ", ".join(f"{count} {kind}" for kind, count in kinds.items())
        proof = "proved to be all" if self.complete else f"not proved to be all: {self.reason}"
        return (
            f"fold curves over {self.names[0]} and {self.names[1]}: {each or 'none'}\n"
            f"  {counted(len(self.cusps), 'cusp')}; {proof}"
        )


def trace_folds(scene: Scene, x: tuple[str, ArrayLike], y: tuple[str, ArrayLike]) -> FoldSet:
    """All fold curves of ``scene`` in a rectangle of two parameters, with their cusps.

    They are found by branch and prune over positions and parameters (``fastmech.slider.atlas.cover``), which
    proves that none is missing; so the grid of the values does not matter.

    Args:
        scene: gives every other parameter.
        x, y: name and values of a parameter, rising or falling; the first and the last one are the ends.

    Raises:
        InputError: an unknown or repeated name, values that neither rise nor fall or that the scene refuses.
    """
    plane = suited(plane_of(scene, x, y)[1])
    lines: list[Curve] = []
    curves: list[FoldCurve] = []
    cusps: list[Floats] = []
    reasons: list[str] = []
    for kind, equations in families(plane):
        folds, doubts = sifted(plane, solutions(equations, follower(equations, lines)))
        for line in folds:
            points = with_cusps(plane, line, cusps) if kind == "fold" else line.points
            curves.append(fold_curve(plane, points, line.closed, kind))
        lines += folds
        reasons += doubts
    unfinished = sum(not line.finished for line in lines)
    if unfinished:
        reasons.append(f"{unfinished} curves could not be followed to their ends")
    points_of = tuple(cusp_point(plane, z) for z in cusps)
    return FoldSet((x[0], y[0]), tuple(curves), points_of, not reasons, "; ".join(reasons)).of(scene)


def plane_of(
    scene: Scene, x: tuple[str, ArrayLike], y: tuple[str, ArrayLike]
) -> tuple[dict[str, Floats], Plane]:
    """The two axes, checked, and the rectangle that they span; raises as ``trace_folds``."""
    check_pair(x, y)
    axes = {name: check_axis(scene, name, values) for name, values in (x, y)}
    low, high = (tuple(float(values[end]) for values in axes.values()) for end in (0, -1))
    return axes, Plane(scene, tuple(axes), low, high)


def follower(system: DefiningSystem, before: list[Curve]) -> Callable[[Floats], Curve | None]:
    """Follows a system's curves within the rectangle, until all have ``MOST_POINTS``."""
    total = sum(len(line.points) for line in before)

    def follow(z: Floats) -> Curve | None:
        nonlocal total
        start = newton(system, z, reach=1e-3)
        if start is None or not inside(start) or total > MOST_POINTS:
            return None
        line = trace(system, start, inside, finish_on_edge(system), apart)
        total += len(line.points)
        return line

    return follow


def sifted(plane: Plane, found: Covered) -> tuple[list[Curve], list[str]]:
    """The curves of folds among solutions of a family's equations, and why these may not be all, in words.

    The equations of a symmetry have other solutions too, and where equilibria are not isolated every place
    is one.
    """
    folds, doubts = [], []
    for line in found.curves:
        p = point_at(plane, line.points.T)
        if not np.any(p.isolated):
            doubts = [f"equilibria are not isolated near {told(plane, line.points[0])}"]
        elif p.residual < RESIDUAL:
            folds.append(line)
    if len(found.open):
        p, place = point_at(plane, found.open[0]), told(plane, found.open[0])
        if not p.isolated:
            doubts = [f"equilibria are not isolated near {place}"]
        elif found.cut_short:
            doubts.append(f"the search was cut short; not proved near {place} and elsewhere")
        else:
            doubts.append(f"not proved near {place}: folds meet or touch there")
    return folds, doubts


def told(plane: Plane, z: Floats) -> str:
    """The parameters at a place, in words."""
    units = plane.scene.described()
    values = plane.values(z[2:]).items()
    return ", ".join(f"{name} = {value:.6g} {units[name][1]}" for name, value in values)


def with_cusps(plane: Plane, line: Curve, found: list[Floats]) -> Floats:
    """The curve's points with its cusps among them; new ones are added to ``found``.

    At a cusp the pulls change their sign, or two of the three xk (see ``fastmech.slider.atlas.systems``).
    """
    p = point_at(plane, line.points.T)
    sides = np.array([*p.bent, p.pulls[2]]) >= 0.0
    turned = sides[:, 1:] != sides[:, :-1]
    tried: list[tuple[int, Floats, int | None]] = []
    for k in map(int, np.flatnonzero(turned.any(axis=0))):
        middle = 0.5 * (line.points[k] + line.points[k + 1])
        if turned[3, k]:
            tried.append((k, middle, None))
        if turned[:3, k].sum() == 2:
            tried.append((k, middle, int(np.argmin(turned[:3, k]))))
    if not line.closed:
        nearly = np.abs(p.third / p.size) < NEARLY
        ends = [k for k in (0, len(line.points) - 1) if nearly[k]]
        tried += [(k, line.points[k], other) for k in ends for other in (None, 0, 1, 2)]
    places, points = [], [line.points[:0]]
    for k, near, other in tried:
        z = newton(cusp(plane, other), near, reach=2.0 * LONGEST)
        if z is None or np.abs(z[2:] - np.clip(z[2:], 0.0, 1.0)).max() > 1e-9:
            continue
        z[2:] = np.clip(z[2:], 0.0, 1.0)
        if _new(z, found, 1e-6):
            found.append(z)
        if 0 < k + 1 < len(line.points) and not np.array_equal(near, line.points[k]):
            points.append(z[None])
            places.append(k + 1)
    return np.insert(line.points, places, np.concatenate(points), axis=0)


def fold_curve(plane: Plane, points: Floats, closed: bool, kind: str) -> FoldCurve:
    """A traced curve in the parameters' units."""
    p = point_at(plane, points.T)
    x, y, phi, theta = plane.in_units(points)
    return FoldCurve(x, y, phi, theta, closed, merges=merging(p), kind=kind, residual=p.residual)


def merging(p: ParameterPoint) -> str:
    """What merges with a saddle at folds."""
    return "minimum" if float(np.median(p.hessian[0] + p.hessian[2])) > 0.0 else "maximum"


def cusp_point(plane: Plane, z: Floats) -> CuspPoint:
    """A cusp in the parameters' units."""
    p = point_at(plane, z)
    x, y, phi, theta = map(float, plane.in_units(z))
    return CuspPoint(x, y, phi, theta, max(p.residual, float(np.abs(p.third / p.size))))


#: Places this near to one another [rad and parts] that the search could not tell apart count as one; what
#: Newton's method finds from several of them is the same fold within this.
TOGETHER, SAME = 1e-3, 1e-9

#: Third derivative, and derivative by the parameter, over the loads, that count as zero at such a place.
FLAT = 1e-3


@dataclass(frozen=True, repr=False)
class FoldPoint(Printed):
    """A value of a parameter at which equilibria merge."""

    value: float
    phi: float  #: where they merge [rad]
    theta: float
    merges: str  #: what merges with a saddle: ``minimum`` or ``maximum``
    kind: str
    """``fold``: two vanish; ``pitchfork``: by symmetry one splits into three. Only where another parameter is
    right to rounding: ``cusp``: three merge into one; ``transcritical``: two meet and part again."""
    residual: float  #: scaled residual of gradient and Hessian's determinant

    def told(self) -> str:
        """Value, kind and place."""
        return f"{self.value:.12g}: {self.kind} of a {self.merges} at ({self.phi:.6g}, {self.theta:.6g}) rad"


class FoldPoints(Drawn, tuple[FoldPoint, ...]):
    """The folds of a range, in rising order."""

    KIND = "folds"
    LAYOUT = "scan_types.map_layout:fold_points"
    PICTURE = "plots.objects:draw_curves_of"

    parameter: str
    complete: bool  #: it is proved that the range holds no other one
    reason: str  #: why it is not; empty if it is

    def __new__(cls, points: Iterable[FoldPoint], reason: str, parameter: str) -> FoldPoints:
        """The points, why they may not be all, and what changes."""
        self = super().__new__(cls, points)
        self.parameter = parameter
        self.complete, self.reason = not reason, reason
        return self

    def told(self) -> str:
        """How many, whether these are all, and each."""
        proof = "proved to be all" if self.complete else f"not proved to be all: {self.reason}"
        each = [f"  {self.parameter} = {point.told()}" for point in self]
        return "\n".join([f"{counted(len(self), 'fold')} over {self.parameter}, {proof}", *each])


def find_folds(scene: Scene, name: str, values: ArrayLike) -> FoldPoints:
    """All folds of ``scene`` over a range of one parameter, in rising order.

    They are found by branch and prune (``fastmech.slider.atlas.cover``), which proves that none is missing.

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
    for kind, equations in families(plane):
        found = solutions(equations, _alone(equations))
        folds, doubts = sifted(plane, found)
        places: list[Floats] = []
        for curve in folds:
            if _new(curve.points[0], places, SAME):
                places.append(curve.points[0])
        points += [_point(plane, z, kind) for z in places]
        for z in _together(found.open):
            point = _singular(plane, z)
            if point.residual < RESIDUAL and _new(z, places, TOGETHER):
                points.append(point)
        reasons += doubts
    return FoldPoints(sorted(points, key=lambda point: point.value), "; ".join(reasons), name).of(scene)


def _alone(system: DefiningSystem) -> Callable[[Floats], Curve | None]:
    def follow(z: Floats) -> Curve | None:
        there = newton(system, z, reach=1e-3)
        return None if there is None else Curve(there[None], closed=False)

    return follow


def _point(plane: Plane, z: Floats, kind: str) -> FoldPoint:
    p = point_at(plane, z)
    value, _, phi, theta = map(float, plane.in_units(z))
    return FoldPoint(value, phi, theta, merging(p), kind, residual=p.residual)


def _new(z: Floats, places: list[Floats], near: float) -> bool:
    """Whether a place is none of those."""
    return all(float(np.linalg.norm(apart(z, place))) > near for place in places)


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
