"""Fold curves and cusps over two parameters, every one that a grid of points gives a sign of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.atlas.axes import check_axis
from fastmech.atlas.continuation import LONGEST, Curve, System, distance, newton, trace
from fastmech.atlas.fold_seeds import fold_seeds, margins_at, settled
from fastmech.atlas.systems import Plane, cusp, fold, point_at
from fastmech.errors import InputError
from fastmech.scene import Scene

Floats = NDArray[np.float64]

#: A seed this near to a traced curve is explained by it: a tenth of the longest step.
EXPLAINED = 0.1 * LONGEST

#: Points after which no further curve is begun; the edges that are left count as unexplained.
MOST_POINTS = 40_000


@dataclass(frozen=True, eq=False)
class FoldCurve:
    """A curve on which two equilibria merge; arrays over its points, in order."""

    x: Floats  #: values of the first parameter
    y: Floats  #: values of the second one
    phi: Floats  #: where they merge [rad]
    theta: Floats  #: [rad]
    closed: bool  #: the last point is the first one
    merges: str  #: what merges with a saddle: ``minimum`` (a resting position disappears) or ``maximum``
    branching: bool  #: by symmetry one equilibrium splits into three instead of two vanishing
    residual: float  #: largest scaled residual of gradient and Hessian's determinant on the curve


@dataclass(frozen=True, eq=False)
class CuspPoint:
    """Where two folds meet and three equilibria merge."""

    x: float
    y: float
    phi: float  #: [rad]
    theta: float  #: [rad]
    residual: float  #: scaled


@dataclass(frozen=True, eq=False)
class FoldSet:
    """All folds found in a plane of two parameters."""

    names: tuple[str, str]
    curves: tuple[FoldCurve, ...]
    cusps: tuple[CuspPoint, ...]
    crossings: int  #: edges of the grid between whose ends the number of equilibria changes
    unexplained: int  #: of these, how many no curve crosses
    unfinished: int  #: curves that end where they could not be followed any further


def trace_folds(scene: Scene, x: tuple[str, ArrayLike], y: tuple[str, ArrayLike]) -> FoldSet:
    """Fold curves of ``scene`` in the plane of two parameters, with their cusps.

    The values are the grid that seeds the curves: wherever the number of equilibria changes between
    neighbours there is a fold, which is located by bisection on the closed-form margin and, unless a curve
    goes through it already, continued in both directions until it closes or leaves the rectangle.

    Args:
        scene: gives every other parameter.
        x, y: name and rising values of a parameter.

    Raises:
        InputError: an unknown or repeated name, values that do not rise or that the scene refuses.
    """
    axes = checked_plane(scene, x, y)
    plane = plane_of(scene, axes)
    seeds, symmetry = fold_seeds(plane, axes)
    lines: list[Curve] = []
    branches: list[bool] = []
    unexplained = 0
    for seed in seeds:
        if any(distance(line.points, seed, apart)[0] < EXPLAINED for line in lines):
            continue
        if sum(len(line.points) for line in lines) > MOST_POINTS:
            unexplained += 1
            continue
        special = symmetry.branching(plane, seed)
        line = trace_branching(plane, seed, *special) if special else trace_fold(plane, seed)
        if line is None:
            unexplained += 1
        else:
            lines.append(line)
            branches.append(special is not None)
    cusps: list[Floats] = []
    curves = []
    for line, branch in zip(lines, branches, strict=True):
        points = line.points if branch else with_cusps(plane, line, cusps)
        curves.append(fold_curve(plane, points, line.closed, branch))
    return FoldSet(
        (x[0], y[0]),
        tuple(curves),
        tuple(cusp_point(plane, z) for z in cusps),
        len(seeds),
        unexplained,
        sum(not line.finished for line in lines),
    )


def checked_plane(scene: Scene, x: tuple[str, ArrayLike], y: tuple[str, ArrayLike]) -> dict[str, Floats]:
    """The two axes, checked.

    Raises:
        InputError: see ``trace_folds``.
    """
    if x[0] == y[0]:
        raise InputError(f"axes: {x[0]} is given twice; two different parameters are needed")
    axes = {name: check_axis(scene, name, values) for name, values in (x, y)}
    for name, values in axes.items():
        if name == "alpha":
            raise InputError(
                "axes.alpha: equilibria do not depend on how fast a force decays; choose another"
            )
        if values.size < 2 or not (np.diff(values) > 0.0).all():
            raise InputError(f"axes.{name}: must be two or more values that rise")
    return axes


def plane_of(scene: Scene, axes: dict[str, Floats]) -> Plane:
    """The rectangle that the axes span."""
    return Plane(
        scene,
        tuple(axes),
        tuple(float(values[0]) for values in axes.values()),
        tuple(float(values[-1]) for values in axes.values()),
    )


def apart(a: Floats, b: Floats) -> Floats:
    """Difference of points (phi, theta, u, v), angles the short way."""
    gap = a - b
    gap[..., :2] = np.mod(gap[..., :2] + np.pi, 2.0 * np.pi) - np.pi
    return gap


def trace_fold(plane: Plane, seed: Floats) -> Curve | None:
    """The fold curve through a seed, None if Newton's method finds none there."""
    equations = fold(plane)
    start = newton(equations, seed, reach=0.05)
    return None if start is None else trace(equations, start, inside, finish_on_edge(equations), apart)


def trace_branching(plane: Plane, seed: Floats, equations: System, largest: int) -> Curve | None:
    """The branching curve through a seed, None if Newton's method finds none there."""
    start = newton(equations, seed[2:], reach=0.05)
    if start is None:
        return None
    flat = trace(equations, start, inside, finish_on_edge(equations), lambda a, b: a - b)
    _, _, phi, theta = margins_at(plane, flat.points)
    angles = settled(plane, np.unwrap(np.column_stack([phi, theta]), axis=0), flat.points, largest)
    return Curve(np.column_stack([angles, flat.points]), flat.tangents, flat.closed, flat.finished)


def inside(z: Floats) -> bool:
    """Within the rectangle of the two parameters."""
    return bool(((z[-2:] >= 0.0) & (z[-2:] <= 1.0)).all())


def finish_on_edge(equations: System) -> Callable[[Floats, Floats], Floats]:
    """How a curve ends: on the side of the rectangle that it crosses."""

    def finish(last: Floats, beyond: Floats) -> Floats:
        for k in (-2, -1):
            if 0.0 <= beyond[k] <= 1.0 or last[k] == beyond[k]:
                continue
            side = 0.0 if beyond[k] < 0.0 else 1.0
            guess = last + (beyond - last) * (side - last[k]) / (beyond[k] - last[k])
            normal = np.zeros(last.size)
            normal[k] = 1.0
            end = newton(equations, guess, 0.5 * LONGEST, normal)
            if end is not None and inside(np.where(np.arange(last.size) == last.size + k, side, end)):
                end[k] = side
                return end
        return last

    return finish


def with_cusps(plane: Plane, line: Curve, found: list[Floats]) -> Floats:
    """The curve's points with its cusps among them; new ones are added to ``found``.

    At a cusp the curve stands still in the plane of the parameters and turns back.
    """
    t = line.tangents[:, 2:]
    pieces = [line.points[:1]]
    for k in range(len(line.points) - 1):
        if t[k] @ t[k + 1] < 0.0:
            middle = 0.5 * (line.points[k] + line.points[k + 1])
            z = newton(cusp(plane), middle, reach=2.0 * LONGEST)
            if z is not None:
                pieces.append(z[None])
                if inside(z) and all(np.linalg.norm(apart(z, other)) > 1e-6 for other in found):
                    found.append(z)
        pieces.append(line.points[k + 1 : k + 2])
    return np.concatenate(pieces)


def fold_curve(plane: Plane, points: Floats, closed: bool, symmetric: bool) -> FoldCurve:
    """A traced curve in the parameters' units."""
    p = point_at(plane, points.T)
    values = plane.values(points[:, 2:].T)
    x, y = (np.asarray(values[name]) for name in plane.names)
    residual = np.max(np.abs([*p.gradient, p.determinant]))
    stable = float(np.median(p.hessian[0] + p.hessian[2])) > 0.0
    phi, theta = (np.mod(points[:, k] + np.pi, 2.0 * np.pi) - np.pi for k in (0, 1))
    return FoldCurve(x, y, phi, theta, closed, "minimum" if stable else "maximum", symmetric, float(residual))


def cusp_point(plane: Plane, z: Floats) -> CuspPoint:
    """A cusp in the parameters' units."""
    p = point_at(plane, z[:, None])
    residual = float(np.max(np.abs([*p.gradient, p.determinant, p.third])))
    x, y = (float(value) for value in plane.values(z[2:]).values())
    phi, theta = np.mod(z[:2] + np.pi, 2.0 * np.pi) - np.pi
    return CuspPoint(x, y, float(phi), float(theta), residual)
