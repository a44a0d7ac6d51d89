"""What an impulse does to a point of the resting mechanism: rates, the point's velocity, energy.

An impulse J [N s] on a point with the Jacobian B = d(velocity)/d(rates) gives the rates a^-1 B^T J with the
metric a of paper (11), the point's velocity W J with its mobility W = B a^-1 B^T, and the energy J.W J / 2.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Floats
from fastmech.scene import Scene
from fastmech.slider.geometry import velocities
from fastmech.slider.lagrange import metric
from fastmech.slider.reduced import metric_determinant, slider_ratio

#: Points that can be struck.
POINTS = ("M1", "M2", "M3")

#: Sines and cosines below this are rounding: there the point cannot be struck so.
ROUNDING = 1e-12


class Mobility(NamedTuple):
    """W of a point by its eigenvalues [1/kg] and the direction of the greatest [rad]."""

    greatest: Floats
    least: Floats
    direction: Floats

    def along(self, angle: ArrayLike) -> Floats:
        """u.W u [1/kg] for the unit vector u at an angle [rad]; 0 where rounding leaves nothing of it."""
        away = np.asarray(angle) - self.direction
        value = self.greatest * np.cos(away) ** 2 + self.least * np.sin(away) ** 2
        return np.where(value > ROUNDING**2 * self.greatest, value, 0.0)

    def speed(self, angle: ArrayLike) -> Floats:
        """|W u| [1/kg]: the speed that an impulse of 1 N s at an angle [rad] gives the point."""
        away = np.asarray(angle) - self.direction
        return np.hypot(self.greatest * np.cos(away), self.least * np.sin(away))


def mobility(
    m2: ArrayLike, mass: ArrayLike, slider: ArrayLike, phi: ArrayLike, theta: ArrayLike, on: str
) -> Mobility:
    """Mobility of a point in closed form.

    M1 moves across its rod OM1, M3 along x, and at its dead centres M3 does not move.
    M2 hangs at M1 by a rod: struck across M1M2 it swings alone, struck along it drags M1 and the slider with
    it, and does not move at all where crank and rod are in line.

    Args:
        m2: [kg]; here and below arrays may have any shapes that fit each other.
        mass, slider: m1/m2 and m3/m2.
        phi, theta: [rad].
        on: one of :data:`POINTS`.
    """
    k, _ = slider_ratio(np.sin(phi), np.cos(phi))
    cosine = np.cos(np.add(phi, theta))
    inertia = m2 * metric_determinant(mass, slider, k, cosine)
    none = np.zeros_like(inertia)
    if on == "M1":
        return Mobility(1.0 / inertia, none, np.add(phi, 0.5 * np.pi))
    if on == "M2":
        return Mobility(none + 1.0 / np.asarray(m2), cosine * cosine / inertia, np.negative(theta))
    return Mobility(np.where(np.abs(k) > ROUNDING, k * k, 0.0) / inertia, none, none)


def impulse_for(energy: ArrayLike, mobility: ArrayLike) -> Floats:
    """Impulse [N s] that gives an energy [J] where u.W u is ``mobility`` [1/kg]; NaN where that is 0."""
    given, eased = np.asarray(energy), np.asarray(mobility)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(eased > 0.0, np.sqrt(2.0 * given / eased), np.nan)


def rates_after(scene: Scene, q: ArrayLike, on: str, impulse: ArrayLike) -> Floats:
    """Rates a^-1 B^T J [rad/s] (..., 2) that impulses J (..., 2) [N s] give the resting mechanism.

    Args:
        scene: the mechanism.
        q: where it rests, phi and theta [rad].
        on: one of :data:`POINTS`.
        impulse: x and y components.
    """
    moved = velocities(scene, np.column_stack([np.tile(q, (2, 1)), np.eye(2)]))
    number = on[1]
    B = np.array([getattr(moved, f"x{number}"), getattr(moved, f"y{number}")])
    return np.asarray(np.asarray(impulse) @ B @ np.linalg.inv(metric(scene, q)))
