"""Folds over one parameter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.atlas.axes import check_axis, coefficient_columns, grid_coefficients
from fastmech.atlas.continuation import newton
from fastmech.atlas.fold_seeds import HALVINGS, margins
from fastmech.atlas.systems import Plane, fold, point_at
from fastmech.errors import InputError
from fastmech.scene import Scene

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class FoldPoint:
    """A value of a parameter at which two equilibria merge."""

    value: float
    phi: float  #: where they merge [rad]
    theta: float
    merges: str  #: what merges with a saddle: ``minimum`` or ``maximum``
    residual: float  #: scaled residual of gradient and Hessian's determinant


def find_folds(scene: Scene, name: str, values: ArrayLike) -> tuple[FoldPoint, ...]:
    """Folds of ``scene`` over one parameter, in rising order.

    Args:
        scene: gives every other parameter.
        name: the parameter.
        values: rising; a fold is found wherever the number of equilibria changes between neighbours.

    Raises:
        InputError: an unknown name, values that do not rise or that the scene refuses.
    """
    axis = check_axis(scene, name, values)
    if axis.size < 2 or not (np.diff(axis) > 0.0).all():
        raise InputError(f"axes.{name}: must be two or more values that rise")
    margin = margins(grid_coefficients(scene, {name: axis})[0])[0]
    plane = Plane(scene, (name,), (float(axis[0]),), (float(axis[-1]),))
    change = np.flatnonzero((margin[:-1] >= 0.0) != (margin[1:] >= 0.0))
    found = []
    for k in change[np.isfinite(margin[change]) & np.isfinite(margin[change + 1])]:
        low, high = float(axis[k]), float(axis[k + 1])
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if (_at(scene, name, middle)[0] >= 0.0) == (margin[k] >= 0.0):
                low = middle
            else:
                high = middle
        _, _, phi, theta = _at(scene, name, high)
        z = np.array([phi, theta, *plane.parts([high])])
        # Where symmetry makes the fold a branching the Jacobian is singular and the bisection has to do.
        polished = newton(fold(plane), z, reach=0.01)
        z = z if polished is None else polished
        p = point_at(plane, z[:, None])
        residual = float(np.max(np.abs([*p.gradient, p.determinant])))
        stable = float(p.hessian[0][0] + p.hessian[2][0]) > 0.0
        angles = np.mod(z[:2] + np.pi, 2.0 * np.pi) - np.pi
        value = float(plane.values(z[2:])[name])
        found.append(
            FoldPoint(value, float(angles[0]), float(angles[1]), "minimum" if stable else "maximum", residual)
        )
    return tuple(found)


def _at(scene: Scene, name: str, value: float) -> tuple[float, float, float, float]:
    columns = coefficient_columns(scene, {name: value})
    row = np.array([[float(column) for column in columns]])
    margin, symmetry, phi, theta = (float(array[0]) for array in margins(row))
    return margin, symmetry, phi, theta
