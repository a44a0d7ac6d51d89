"""Curves on which damping stops reaching a mode at a stable equilibrium: settling takes forever there.

The slider's damper misses a mode where sin phi = 0, where sin(phi + theta) = 0 and where U_theta,theta = C
(see ``fastmech.slider.linearize.reach``): the Hurwitz test is silent and the decay is algebraic.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import binary_opening

from fastmech.arrays import Floats
from fastmech.atlas.continuation import LONGEST, distance, finish_on_edge, inside, newton, regular, trace
from fastmech.objects import Drawn
from fastmech.scene import Scene
from fastmech.slider.atlas.cover import DefiningSystem, apart
from fastmech.slider.atlas.folds import MOST_POINTS, plane_of
from fastmech.slider.atlas.map import EquilibriumMap, map_equilibria
from fastmech.slider.atlas.systems import ParameterPoint, Plane, point_at, system
from fastmech.slider.linearize import SIN_PHI, SIN_PSI, UNLOADED

#: Quantities at whose zeros small motions of a mode do not move the damper, see :func:`~.linearize.reach`.
QUANTITIES: dict[str, Callable[[ParameterPoint], Any]] = {
    SIN_PHI: lambda p: np.sin(p.phi),
    SIN_PSI: lambda p: np.sin(p.phi + p.theta),
    UNLOADED: lambda p: p.hessian[2] - p.loads[1],
}

#: A quantity this small, over its own scale, is zero within rounding.
ZERO = 1e-9

#: A seed this near to a traced curve is explained by it: a tenth of the longest step.
EXPLAINED = 0.1 * LONGEST

#: A curve ends this near to where its equilibrium stops being stable [rad and parts of the ranges].
END = 1e-3


@dataclass(frozen=True, eq=False)
class UndampedCurve:
    """A curve on which the damper misses a mode of a stable equilibrium; arrays over its points, in order."""

    vanishes: str  #: ``sin phi``, ``sin(phi+theta)`` or ``U_theta,theta - C``
    x: Floats  #: values of the first parameter
    y: Floats  #: values of the second one
    phi: Floats  #: [rad]
    theta: Floats  #: [rad]
    residual: float  #: largest scaled residual on the curve


@dataclass(frozen=True, eq=False)
class UndampedSheet:
    """Stable equilibria of which the damper misses a mode all over a part of the plane, not on a curve."""

    vanishes: str  #: as for ``UndampedCurve``
    x: float  #: one of the points
    y: float
    phi: float  #: the stable equilibrium there [rad]
    theta: float  #: [rad]
    share: float  #: of the grid's points


@dataclass(frozen=True, eq=False, repr=False)
class UndampedSet(Drawn):
    """Where, in a plane of two parameters, the damper misses a mode of a stable equilibrium."""

    curves: tuple[UndampedCurve, ...]
    everywhere: tuple[UndampedSheet, ...]
    crossings: int  #: edges of the grid along which one of the quantities changes sign on a stable sheet
    unexplained: int  #: of these, how many have no curve, because none was found or ``MOST_POINTS`` was met
    unfinished: int  #: curves that end where they could not be followed any further
    names: tuple[str, str] = ("x", "y")  #: of the parameters

    KIND = "undamped_curves"
    LAYOUT = "scan_types.map_layout:undamped_curves"
    PICTURE = "plots.objects:draw_curves_of"

    def told(self) -> str:
        """How many curves of which kind, and what none explains."""
        kinds = Counter(curve.vanishes for curve in self.curves)
        each = ", ".join(f"{count} of {what} = 0" for what, count in kinds.items())
        return (
            f"where damping misses a mode, over {self.names[0]} and {self.names[1]}: {each or 'no curve'}\n"
            f"  of {self.crossings:,} changes on the grid {self.unexplained:,} lie on no curve; "
            f"{len(self.everywhere)} sheets miss one throughout"
        )


def trace_undamped(
    scene: Scene, x: tuple[str, ArrayLike], y: tuple[str, ArrayLike], *, threads: int | None = None
) -> UndampedSet:
    """Vanishing-damping curves of ``scene`` in the plane of two parameters.

    The values are the grid of the map that seeds them: a curve passes wherever one of the three quantities
    changes sign between neighbours of one stable sheet. Where a quantity vanishes all over a sheet (with
    c2 = m1 g / l the rod is unloaded whatever F0 and c1 are) there is no curve, and the sheet is named
    instead. A curve along which a quantity touches zero without changing sign (the symmetric positions along
    F0 = 0) is not found, unless grid points lie on it: then it counts as unexplained. Nothing is found
    without a damper (beta = 0).

    Raises:
        InputError: as ``trace_folds``.
    """
    axes, plane = plane_of(scene, x, y)
    if scene.beta == 0.0 and "beta" not in axes:
        return UndampedSet((), (), 0, 0, 0, names=(x[0], y[0])).of(scene)
    atlas = map_equilibria(scene, axes, threads=threads)

    def kept(z: Floats) -> bool:
        """Whether a place is in the rectangle, and U has a minimum there."""
        p = point_at(plane, z)
        return inside(z) and bool(p.determinant > 0.0 and p.hessian[0] > 0.0)

    curves: list[UndampedCurve] = []
    everywhere: list[UndampedSheet] = []
    crossings = unexplained = unfinished = traced = 0
    for name, quantity in QUANTITIES.items():
        equations = missing(plane, quantity)
        lines: list[Floats] = []
        places, sheets = seeds(plane, atlas, name)
        everywhere += sheets
        crossings += len(places)
        for seed in places:
            if any(distance(line, seed, apart)[0] < LONGEST for line in lines):
                continue
            start = newton(equations, seed, reach=0.2) if traced < MOST_POINTS else None
            if start is None or not regular(equations, start) or not kept(start):
                unexplained += 1
                continue
            if any(distance(line, start, apart)[0] < EXPLAINED for line in lines):
                continue
            line = trace(equations, start, kept, finish_on_edge(equations, kept, END), apart)
            lines.append(line.points)
            traced += len(line.points)
            unfinished += not line.finished
        curves += [curve_of(plane, name, equations, line) for line in lines if len(line) > 1]
    own = tuple(curves), tuple(everywhere)
    return UndampedSet(*own, crossings, unexplained, unfinished, names=(x[0], y[0])).of(scene)


def missing(plane: Plane, quantity: Callable[[ParameterPoint], Any]) -> DefiningSystem:
    """gradient = 0 where a quantity vanishes."""
    return system(plane, lambda p: (*p.gradient, quantity(p)))


def seeds(plane: Plane, atlas: EquilibriumMap, name: str) -> tuple[Floats, list[UndampedSheet]]:
    """Points (n, 4) near which the quantity vanishes, by linear interpolation between neighbours.

    Cells of the grid at whose four corners it vanishes are no place of a curve: their sheets are told apart.
    """
    values = np.stack(np.meshgrid(*atlas.axes.values(), indexing="ij"), axis=-1)
    u, v = np.moveaxis(plane.parts(values), -1, 0)
    found, everywhere = [], []
    for sheet in np.flatnonzero(atlas.sheet_morse_index == 0):
        there = atlas.sheet == sheet

        def on_sheet(values: Floats, there: NDArray[np.bool_] = there) -> Floats:
            return np.where(there.any(axis=-1), np.where(there, values, 0.0).sum(axis=-1), np.nan)

        phi, theta = on_sheet(atlas.phi), on_sheet(atlas.theta)
        z = np.stack([phi, theta, u, v], axis=-1)
        p = point_at(plane, np.where(np.isnan(z), 0.0, z).reshape(-1, 4).T)
        size = np.where(np.isnan(phi), np.nan, QUANTITIES[name](p).reshape(phi.shape))
        flat = binary_opening(np.abs(size) < ZERO, np.ones((2, 2)))
        if flat.any():
            middle = z[flat][np.count_nonzero(flat) // 2]
            x, y, _, _ = map(float, plane.in_units(middle))
            place = float(middle[0]), float(middle[1])
            everywhere.append(UndampedSheet(name, x, y, *place, share=float(flat.mean())))
        for one, two in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
            change = (size[one] * size[two] <= 0.0) & ~flat[one] & ~flat[two]
            start, gap = z[one][change], apart(z[two][change], z[one][change])
            a, b = size[one][change], size[two][change]
            found.append(start + (a / np.where(a == b, 1.0, a - b))[:, None] * gap)
    return np.concatenate(found) if found else np.empty((0, 4)), everywhere


def curve_of(plane: Plane, name: str, equations: DefiningSystem, points: Floats) -> UndampedCurve:
    """A traced curve in the parameters' units."""
    residual = max(float(np.max(np.abs(equations(z)[0]))) for z in points)
    x, y, phi, theta = plane.in_units(points)
    return UndampedCurve(name, x, y, phi, theta, residual=residual)
