"""Ways between neighbouring regions of a map through channels of parameters that are narrower than its grid.

Towards a cusp two folds come together like a horn, and the grid's points between them fall apart into
islands. Whether two islands are one region is decided by walking from one to the other between the folds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastmech.atlas.axes import coefficient_columns
from fastmech.atlas.margin import margins
from fastmech.atlas.regions import Edges, Forest, Place, Points, label_points
from fastmech.equilibria.outcome import Outcome
from fastmech.equilibria.search import MOST
from fastmech.equilibria.solution import solve_rows
from fastmech.equilibria.solve import Solution
from fastmech.scene import Scene

Floats = NDArray[np.float64]
Labels = NDArray[np.int32]

#: Islands further apart than this many cells of the grid are not joined.
REACH = 4

#: Steps of a way, a cell of the grid.
STEPS = 32

#: How far, in cells, a way may bend aside, and the number of places that are tried across it.
ASIDE, ACROSS = 2.0, 17

#: Halvings of the distance between the places tried, to find the widest part of the channel.
SHARPENINGS = 40


@dataclass(frozen=True)
class Ground:
    """Parameters between the points of a grid, linear in the points' numbers."""

    scene: Scene
    axes: Mapping[str, Floats]

    def coefficients(self, places: Floats) -> Floats:
        """Reduced coefficients (n, 8) at places (n, axes) counted in cells; NaN outside the grid."""
        values = {}
        inside = np.ones(len(places), dtype=bool)
        for place, (name, axis) in zip(places.T, self.axes.items(), strict=True):
            values[name] = np.interp(place, np.arange(axis.size), axis)
            inside &= (place >= 0.0) & (place <= axis.size - 1)
        columns = coefficient_columns(self.scene, values)
        rows = [np.broadcast_to(np.asarray(column, dtype=np.float64), len(places)) for column in columns]
        return np.where(inside[:, None], np.stack(rows, axis=1), np.nan)

    def depth(self, places: Floats, sign: float) -> Floats:
        """How deep (..., axes) is within the channel: the margin to the fold, times its sign [rad]."""
        flat = margins(np.ascontiguousarray(self.coefficients(places.reshape(-1, places.shape[-1]))))[0]
        return np.where(np.isnan(flat), -np.inf, sign * flat).reshape(places.shape[:-1])


def way(ground: Ground, start: Floats, end: Floats, count: int) -> Floats | None:
    """Places (n, axes) from a point of the grid to another, everywhere with ``count`` equilibria.

    The straight way, pushed aside across its main direction to where the channel is deepest wherever it
    leaves the channel. None: there is no such way.
    """
    sign = 1.0 if count == MOST else -1.0
    main = int(np.argmax(np.abs(end - start)))
    steps = STEPS * int(np.abs(end - start).max())
    places = start + np.linspace(0.0, 1.0, steps + 1)[:, None] * (end - start)
    lost = np.flatnonzero(ground.depth(places, sign) <= 0.0)
    sides = [axis for axis in range(len(start)) if axis != main]
    if lost.size and not sides:
        return None
    tried = places[lost]
    for _ in range(len(sides)):  # one round finds the deepest place across one axis, two across two
        for axis in sides:
            tried = deepest(ground, tried, axis, sign)
    places[lost] = tried
    return places if (ground.depth(places, sign) > 0.0).all() else None


def deepest(ground: Ground, places: Floats, axis: int, sign: float) -> Floats:
    """The places (n, axes), moved along one axis to where the channel is deepest."""
    half = ASIDE
    offsets = np.linspace(-half, half, ACROSS)
    for _ in range(SHARPENINGS):
        line = np.repeat(places[:, None], offsets.size, axis=1)
        line[..., axis] += offsets
        depth = ground.depth(line, sign)
        places = line[np.arange(len(places)), np.argmax(depth, axis=1)]
        if (depth.max(axis=1) > 0.0).all() and half < ASIDE:
            break
        half *= 0.5
        offsets = half * np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
    return places


def continued(ground: Ground, start: Floats, end: Floats, count: int) -> tuple[Solution, Labels] | None:
    """The equilibria all along a way, and their labels: equal ones continue one another; None: no way."""
    places = way(ground, start, end, count)
    if places is None:
        return None
    rows = np.ascontiguousarray(ground.coefficients(places))
    found = solve_rows(rows)
    if not ((found.outcome == Outcome.COMPLETE) & (found.count == count)).all():
        return None
    n = len(rows)
    label = np.empty((n, MOST), dtype=np.int32)
    forest = Forest()
    forest.make_room(n)
    edges = Edges(np.empty((n, 2), np.int64), np.empty((n, MOST), np.int8), np.empty(1, np.int64))
    points = Points(rows, found.phi, found.theta, found.index, found.count)
    line = Place(0, 0, np.ones(1, dtype=np.int64), np.array([n]))
    regions = label_points(points, line, 0, forest.trees, label, edges)
    return (found, label) if regions == 1 else None
