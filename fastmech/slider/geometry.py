"""Positions, velocities, accelerations and constraints of the mechanism's points, paper (2)-(7); reactions.

States ``y`` have shape (..., 4): phi, theta [rad], phi', theta' [rad/s]; results have the shape (...). The
rods are light, so each carries an axial force only; Newton's equations of the three masses give them one
after another. Tension is positive.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Floats
from fastmech.errors import InputError, shown
from fastmech.objects import Field, Printed
from fastmech.scene import Scene
from fastmech.slider.coefficients import force
from fastmech.slider.lagrange import angular_accelerations
from fastmech.slider.reduced import slider_ratio


class Points(NamedTuple):
    """A vector quantity of M1, M2 and the slider M3, each component of shape (...)."""

    x1: Floats
    y1: Floats
    x2: Floats
    y2: Floats
    x3: Floats
    y3: Floats


def positions(scene: Scene, y: ArrayLike) -> Points:
    """Coordinates of the points [m], paper (6)."""
    phi, theta = _components(y)[:2]
    s1, c1 = np.sin(phi), np.cos(phi)
    l = scene.l
    x1, y1 = l * c1, l * s1
    x3 = l * (c1 + np.sqrt(4.0 - s1 * s1))
    return Points(x1, y1, x1 - l * np.sin(theta), y1 - l * np.cos(theta), x3, y3=np.zeros_like(x3))


def velocities(scene: Scene, y: ArrayLike) -> Points:
    """Velocities of the points [m/s], time derivative of paper (6); their squares are paper (7)."""
    phi, theta, phi_dot, theta_dot = _components(y)
    s1, c1 = np.sin(phi), np.cos(phi)
    l = scene.l
    k, _ = slider_ratio(s1, c1)
    x1, y1 = -l * s1 * phi_dot, l * c1 * phi_dot
    x2, y2 = x1 - l * np.cos(theta) * theta_dot, y1 + l * np.sin(theta) * theta_dot
    x3 = -l * k * phi_dot
    return Points(x1, y1, x2, y2, x3, y3=np.zeros_like(x3))


def accelerations(scene: Scene, y: ArrayLike, angular: ArrayLike) -> Points:
    """Accelerations of the points [m/s2]; ``angular`` (..., 2) holds phi'', theta'' [rad/s2]."""
    phi, theta, phi_dot, theta_dot = _components(y)
    phi_ddot, theta_ddot = _components(angular)
    s1, c1, s2, c2 = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    l = scene.l
    k, dk = slider_ratio(s1, c1)
    x1 = -l * (s1 * phi_ddot + c1 * phi_dot**2)
    y1 = l * (c1 * phi_ddot - s1 * phi_dot**2)
    x2 = x1 - l * (c2 * theta_ddot - s2 * theta_dot**2)
    y2 = y1 + l * (s2 * theta_ddot + c2 * theta_dot**2)
    x3 = -l * (k * phi_ddot + dk * phi_dot**2)
    return Points(x1, y1, x2, y2, x3, y3=np.zeros_like(x3))


def constraints(scene: Scene, points: Points) -> Floats:
    """Residuals of the constraints (2)-(5), shape (4, ...): m^2, m^2, m, m^2.

    The paper's (2) prints x2 where x1 belongs.
    """
    x1, y1, x2, y2, x3, y3 = points
    l2 = scene.l**2
    swing, rod = (x2 - x1) ** 2 + (y2 - y1) ** 2 - l2, (x3 - x1) ** 2 + (y3 - y1) ** 2 - 4.0 * l2
    return np.stack([x1**2 + y1**2 - l2, swing, y3, rod])


def _components(values: ArrayLike) -> Floats:
    """The last axis in front, as float64."""
    return np.moveaxis(np.asarray(values, dtype=np.float64), -1, 0)


class _Forces(NamedTuple):
    rod_om1: Floats  #: axial force in rod O-M1, tension positive
    rod_m1m2: Floats  #: axial force in rod M1-M2, tension positive
    rod_m1m3: Floats  #: axial force in rod M1-M3, tension positive
    slider_normal: Floats  #: force of the guide on the slider, upwards positive


class Reactions(Printed, _Forces):
    """Constraint forces [N], each of the shape of the states given; a pull in a rod is positive."""

    FIELDS = {
        "rod_om1": Field("", "N", "pull in rod O-M1"),
        "rod_m1m2": Field("", "N", "in M1-M2"),
        "rod_m1m3": Field("", "N", "in M1-M3"),
        "slider_normal": Field("", "N", "force of the guide on the slider, upwards"),
    }


def reactions(scene: Scene, y: ArrayLike, t: ArrayLike) -> Reactions:
    """Rod forces and the slider's normal reaction at states ``y`` (..., 4) and times ``t`` [s].

    Raises:
        InputError: no scene, no such states, or times that do not belong to them.
    """
    if not isinstance(scene, Scene):
        raise InputError(f"scene = {shown(scene)}: must be a Scene")
    try:
        y, t = np.asarray(y, dtype=np.float64), np.asarray(t, dtype=np.float64)
        fits = y.shape[-1:] == (4,) and np.broadcast_shapes(y.shape[:-1], t.shape) is not None
    except (TypeError, ValueError, OverflowError):
        fits = False
    if not fits:
        told = f"y, t: have shapes {np.shape(y)} and {np.shape(t)}"
        raise InputError(f"{told}, must be numbers (..., 4) and (...)")
    r, v = positions(scene, y), velocities(scene, y)
    a = accelerations(scene, y, angular_accelerations(scene, y, t))
    l, g = scene.l, scene.g
    # M2: inertia less weight, spring and force is what rod M1M2 supplies along itself.
    need_x = scene.m2 * a.x2 + scene.c1 * r.x2 - force(scene, t)
    need_y = scene.m2 * (a.y2 + g) + scene.c1 * r.y2
    rod_m1m2 = (need_x * (r.x1 - r.x2) + need_y * (r.y1 - r.y2)) / l
    # M3 moves along x only: its rod's horizontal part moves it, its vertical part loads the guide.
    rod_m1m3 = (scene.m3 * a.x3 + scene.beta * v.x3) * 2.0 * l / (r.x1 - r.x3)
    slider_normal = scene.m3 * g - rod_m1m3 * r.y1 / (2.0 * l)
    # M1: what weight, spring and the two other rods leave to rod OM1.
    need_x = scene.m1 * a.x1 + scene.c2 * r.x1
    need_x = need_x - rod_m1m2 * (r.x2 - r.x1) / l - rod_m1m3 * (r.x3 - r.x1) / (2 * l)
    need_y = scene.m1 * (a.y1 + g) - scene.c2 * (l - r.y1)
    need_y = need_y - rod_m1m2 * (r.y2 - r.y1) / l - rod_m1m3 * (r.y3 - r.y1) / (2 * l)
    rod_om1 = -(need_x * r.x1 + need_y * r.y1) / l
    return Reactions(rod_om1, rod_m1m2, rod_m1m3, slider_normal)
