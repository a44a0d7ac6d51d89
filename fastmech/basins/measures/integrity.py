"""Dynamical integrity of a basin on a map: GIM, LIM and IF.

Measures by Soliman and Thompson, J. Sound Vib. 135 (1989) 453, and Rega and Lenci, Nonlinear Analysis 63
(2005) 902:

- GIM, global integrity measure: the hypervolume of the basin within the window of the map.
- LIM, local integrity measure: the radius of the largest ball round the attractor that lies in the basin.
- IF, integrity factor: the radius of the largest ball in the basin, wherever its centre.

They use them relative to a reference (the basin without excitation); divide two results for that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import KDTree

from fastmech.arrays import Floats
from fastmech.basins.measures.labels import (
    LabelsLike,
    check_axes,
    check_map,
    check_point,
    norm_on,
    state_index,
)
from fastmech.disturbance.motion import kinetic_norm
from fastmech.ensembles import checks
from fastmech.errors import InputError, necessary
from fastmech.models.equilibria import RestingPlace
from fastmech.models.mechanism import Mechanism
from fastmech.objects import Printed
from fastmech.scene import STATE, Scene
from fastmech.slider.equilibria import Equilibrium


@dataclass(frozen=True, repr=False)
class Integrity(Printed):
    """Integrity of one basin on one map. Radii are lengths in the stated norm."""

    gim: float  #: share of the map's points: the basin's volume over the window's
    gim_at_most: float  #: if all points without a label were in the basin
    lim: float  #: radius round the attractor; 0: the map's nearest point does not belong to the basin
    lim_at_window: bool  #: the window's edge limits it, not the basin's boundary: the true one is larger
    lim_at_most: float  #: the same for LIM; if greater, they limit it
    factor: float  #: IF
    factor_at_window: bool  #: the same for IF
    factor_at_most: float  #: the same for IF
    centre: Floats  #: of the largest ball, a point of the map or the attractor, (axes,); NaN: no basin
    resolution: float  #: length of a cell's longest diagonal

    def told(self) -> str:
        """How much of the map, and the largest balls, with what leaves them open."""
        share = f" to {self.gim_at_most:.1%}, by points without a label" * (self.gim_at_most > self.gim)
        centre = ", ".join(f"{x:.4g}" for x in self.centre)
        about = _told(self.lim, self.lim_at_most, self.lim_at_window)
        anywhere = _told(self.factor, self.factor_at_most, self.factor_at_window)
        return (
            f"the basin is {self.gim:.1%}{share} of the map (GIM)\n"
            f"  largest ball in it: {about} about the attractor (LIM)\n"
            f"  {anywhere} anywhere (IF), about ({centre})\n"
            f"  radii in the norm, in which a cell of the map is {self.resolution:.3g} wide"
        )


def _told(radius: float, at_most: float, at_window: bool) -> str:
    """A radius in words."""
    missing = f" to {at_most:.4g}, by points without a label" * (at_most > radius)
    return f"radius {radius:.4g}{missing}" + ", up to the map's edge," * at_window


@necessary(
    axes="the map's axes, rising, one for each dimension of the labels",
    label="the basin's label, a whole number",
    attractor="a point of the map's space, or one of fm.find_equilibria(...), such as E[0]",
)
def integrity(
    labels: LabelsLike,
    axes: Sequence[ArrayLike] | Mapping[str, ArrayLike],
    label: int,
    attractor: ArrayLike | Equilibrium | RestingPlace,
    norm: ArrayLike | None = None,
    *,
    scene: Scene | Mechanism | None = None,
) -> Integrity:
    """GIM, LIM and IF of the basin ``label`` on a map, and how large points without a label leave them.

    A ball lies in the basin if no point of the map in its inside has another label or none, and its inside is
    within the window (the span of the axes: nothing is known beyond). So a radius is the distance from the
    centre to the nearest such point or edge, exact on the map; the true boundary is nearer by up to
    ``resolution``, and filaments of another basin thinner than a cell are not seen.

    Args:
        labels: on the grid, any number of axes; negative: no label, not in the basin, which can make all
            three too small. What ends in ``_at_most`` is with all such points in it.
        axes: coordinates along every axis, rising in equal steps; of a scene or a mechanism by the names
            of its states, as :class:`fastmech.basins.map.BasinMap` has them.
        label: of the basin.
        attractor: its coordinates on the map's axes (axes,), within the window; or an equilibrium
            of ``scene``.
        norm: matrix N (axes, axes): ``|d @ N|`` is the length of a departure d along the axes. By default,
            for an equilibrium of ``scene``, the kinetic-energy norm there, on the axes.
        scene: the scene or the mechanism, for the default norm.

    Raises:
        InputError: an argument is wrong, or the attractor lies outside the window.
    """
    array = check_map(labels)
    names = list(axes) if isinstance(axes, Mapping) else []
    if isinstance(attractor, Equilibrium | RestingPlace):
        states = STATE if scene is None else scene.state
        chosen = [state_index(name, states) for name in names]
        if norm is None and scene is not None:
            norm = norm_on(kinetic_norm(scene, attractor), len(states), chosen)
        attractor = np.concatenate([attractor.position, np.zeros_like(attractor.position)])[chosen]
    if norm is None:
        raise InputError("norm: missing; by default it is that of an equilibrium and a scene")
    lines = check_axes(axes, array.shape)
    label = checks.whole_number("label", label, least=0)
    place = check_point("attractor", attractor, array.ndim)
    first, last = np.array([line[0] for line in lines]), np.array([line[-1] for line in lines])
    if (place < first).any() or (place > last).any():
        raise InputError(f"attractor = {place.tolist()}: must lie within the map's window")
    matrix = norm_on(norm, array.ndim)
    points = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)
    nearest = tuple(int(np.abs(line - x).argmin()) for line, x in zip(lines, place, strict=True))
    own, possible = array == label, (array == label) | (array < 0)
    about, largest, centre = _balls(points, own, place, nearest, matrix)
    most_about, most = about, largest
    if (array < 0).any():
        most_about, most, _ = _balls(points, possible, place, nearest, matrix)
    widest = np.array([np.diff(line).max() for line in lines])
    signs = np.array(list(product([-1.0, 1.0], repeat=array.ndim)))
    return Integrity(
        gim=float(own.mean()),
        gim_at_most=float(possible.mean()),
        lim=about.radius,
        lim_at_window=about.at_window,
        lim_at_most=most_about.radius,
        factor=largest.radius,
        factor_at_window=largest.at_window,
        factor_at_most=most.radius,
        centre=centre,
        resolution=float(np.linalg.norm(signs * widest @ matrix, axis=1).max()),
    )


class _Ball(NamedTuple):
    radius: float
    at_window: bool  # the window's edge is nearer than any point outside the basin


def _balls(
    points: Floats, inside: NDArray[np.bool_], place: Floats, nearest: tuple[int, ...], matrix: Floats
) -> tuple[_Ball, _Ball, Floats]:
    """The largest ball round ``place`` in the points ``inside``, the largest anywhere, and its centre."""
    others = points[~inside] @ matrix
    tree = KDTree(others) if len(others) else None
    corners = points.reshape(-1, place.size)
    first, last = corners[0], corners[-1]
    # The distance to a face of the box is measured along the norm's own normal.
    reach = np.sqrt(np.diag(np.linalg.inv(matrix @ matrix.T)))

    centres = np.concatenate([points[inside], place[None]])
    edge = (np.minimum(centres - first, last - centres) / reach).min(axis=1)
    boundary = tree.query(centres @ matrix)[0] if tree else np.full(len(centres), np.inf)
    radius, at_window = np.minimum(boundary, edge), edge < boundary
    if not inside[nearest]:
        radius[-1], at_window[-1] = 0.0, False
    best = int(radius.argmax())
    about, largest = (_Ball(float(radius[k]), bool(at_window[k])) for k in (-1, best))
    return about, largest, centres[best] if inside.any() else np.full(place.size, np.nan)
