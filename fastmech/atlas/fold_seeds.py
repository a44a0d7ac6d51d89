"""Where fold curves start: every edge of a grid along which the number of equilibria changes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastmech.atlas.axes import coefficient_columns, grid_coefficients
from fastmech.atlas.continuation import System
from fastmech.atlas.margin import fold_margins
from fastmech.atlas.systems import Plane, branching, exchange, point_at
from fastmech.scene import Scene

Floats = NDArray[np.float64]

#: |cos D|, or a relative difference of amplitudes, that is this small all over a plane is zero by symmetry.
SYMMETRIC = 1e-12

#: Points whose margins are computed at a time.
PIECE = 1 << 18

#: Bisections of an edge of the grid, down to rounding.
HALVINGS = 60


@dataclass(frozen=True)
class Symmetry:
    """What holds all over a plane and turns its folds into branchings."""

    mirror: bool  #: the scene is its own mirror image
    equal: tuple[int, ...]  #: of which amplitudes the two others agree

    def branching(self, plane: Plane, seed: Floats) -> tuple[System, int] | None:
        """The branching that a fold at the seed is, and ``largest`` for ``settled``; None: just a fold."""
        A = np.array([float(a[0]) for a in point_at(plane, seed[:, None]).amplitudes])
        if self.mirror:
            return branching(plane, int(np.argmin(A))), -1
        largest = int(np.argmax(A))
        return (exchange(plane, largest), largest) if largest in self.equal else None


def fold_seeds(plane: Plane, axes: dict[str, Floats]) -> tuple[Floats, Symmetry]:
    """Fold points (n, 4) on the edges of the grid, and the plane's symmetry."""
    sign, symmetry = margin_signs(plane.scene, axes)
    u = plane.parts(np.stack([axes[plane.names[0]], np.full(sign.shape[0], plane.low[1])], axis=-1))[:, 0]
    v = plane.parts(np.stack([np.full(sign.shape[1], plane.low[0]), axes[plane.names[1]]], axis=-1))[:, 1]
    i, j = np.nonzero(sign[:-1] * sign[1:] < 0)
    k, m = np.nonzero(sign[:, :-1] * sign[:, 1:] < 0)
    start = np.concatenate([np.column_stack([u[i], v[j]]), np.column_stack([u[k], v[m]])])
    end = np.concatenate([np.column_stack([u[i + 1], v[j]]), np.column_stack([u[k], v[m + 1]])])
    low, high = np.zeros(len(start)), np.ones(len(start))
    rising = margins_at(plane, start)[0] < 0.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        below = (margins_at(plane, start + middle[:, None] * (end - start))[0] < 0.0) == rising
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    parts = start + high[:, None] * (end - start)
    _, _, phi, theta = margins_at(plane, parts)
    return np.column_stack([phi, theta, parts]), symmetry


def margin_signs(scene: Scene, axes: dict[str, Floats]) -> tuple[NDArray[np.int8], Symmetry]:
    """1 where six equilibria exist, -1 where four, 0 where they are not isolated; and the symmetry."""
    (x, first), (y, second) = axes.items()
    sign = np.empty((first.size, second.size), dtype=np.int8)
    mirror, equal = True, {0, 1, 2}
    planes = max(1, PIECE // second.size)
    for k in range(0, first.size, planes):
        coefficients = grid_coefficients(scene, {x: first[k : k + planes], y: second})[0]
        margin, turn, _, _ = margins(coefficients)
        piece = np.where(np.isnan(margin), 0, np.where(margin >= 0.0, 1, -1))
        sign[k : k + planes] = piece.reshape(-1, second.size)
        lift, spring, gravity, force = coefficients[:, 2:6].T
        A = (np.hypot(lift, force), np.hypot(gravity, force), spring)
        small = SYMMETRIC * np.max(A, axis=0)
        equal = {n for n in equal if (np.abs(A[(n + 1) % 3] - A[(n + 2) % 3]) <= small).all()}
        mirror = mirror and bool(np.nanmax(turn, initial=0.0) < SYMMETRIC)
    return sign, Symmetry(mirror, tuple(equal))


def margins(coefficients: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Margin, symmetry, phi and theta of rows of reduced coefficients; see ``fold_margins``."""
    out = np.empty((4, len(coefficients)))
    fold_margins(coefficients, *out)
    return out[0], out[1], out[2], out[3]


def margins_at(plane: Plane, parts: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """The same at points (n, 2) of the plane."""
    columns = coefficient_columns(plane.scene, plane.values(parts.T))
    rows = [np.broadcast_to(np.asarray(column, dtype=np.float64), len(parts)) for column in columns]
    return margins(np.ascontiguousarray(np.stack(rows, axis=1)))


def settled(plane: Plane, angles: Floats, parts: Floats, largest: int) -> Floats:
    """Places (n, 2) of branching equilibria, made exact.

    Rounding displaces them along the Hessian's null direction, where the gradient is of third order. Where
    two amplitudes agree (the third is ``largest``; -1: the scene is its mirror image) their pulls are at
    their peaks: two of the angles y of ``balance`` are multiples of pi. Else the stiff direction is left.
    """
    if largest >= 0:
        a, _, b, f = (np.asarray(c, dtype=np.float64) for c in plane.coefficients(parts.T))
        phases = np.broadcast_arrays(np.arctan2(f, a), np.arctan2(b, f), 0.0 * a * f)
        phi, theta = angles.T
        y = [phi - phases[0], theta - phases[1], -(phi + theta)]
        at = [np.pi * np.round(y[k] / np.pi) + phases[k] for k in range(3)]
        if largest == 2:
            return np.column_stack([at[0], at[1]])
        return np.column_stack([-at[2] - at[1], at[1]] if largest == 0 else [at[0], -at[2] - at[0]])
    for _ in range(2):
        p = point_at(plane, np.concatenate([angles, parts], axis=1).T)
        h11, h12, h22 = p.hessian
        hessian = np.moveaxis(np.array([[h11, h12], [h12, h22]]), -1, 0)
        step = np.linalg.pinv(hessian, rcond=1e-4, hermitian=True) @ np.array(p.gradient).T[..., None]
        angles = angles - step[..., 0]
    return angles
