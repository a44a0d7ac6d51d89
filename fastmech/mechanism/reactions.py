"""Forces in the rods and the slider's normal reaction along a motion: what the constraints must carry.

The rods are light, so each carries an axial force only; Newton's equations of the three masses give them
one after another. Tension is positive.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Floats
from fastmech.errors import InputError, shown
from fastmech.mechanism.coefficients import force
from fastmech.mechanism.geometry import accelerations, positions, velocities
from fastmech.mechanism.lagrange import angular_accelerations
from fastmech.scene import Scene


class Reactions(NamedTuple):
    """Constraint forces [N], each of the shape of the states given."""

    rod_om1: Floats  #: axial force in rod O-M1, tension positive
    rod_m1m2: Floats  #: axial force in rod M1-M2, tension positive
    rod_m1m3: Floats  #: axial force in rod M1-M3, tension positive
    slider_normal: Floats  #: force of the guide on the slider, upwards positive


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
        raise InputError(
            f"y, t: have shapes {np.shape(y)} and {np.shape(t)}, must be numbers (..., 4) and (...)"
        )
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
    need_x = (
        scene.m1 * a.x1 + scene.c2 * r.x1 - rod_m1m2 * (r.x2 - r.x1) / l - rod_m1m3 * (r.x3 - r.x1) / (2 * l)
    )
    need_y = scene.m1 * (a.y1 + g) - scene.c2 * (l - r.y1)
    need_y = need_y - rod_m1m2 * (r.y2 - r.y1) / l - rod_m1m3 * (r.y3 - r.y1) / (2 * l)
    rod_om1 = -(need_x * r.x1 + need_y * r.y1) / l
    return Reactions(rod_om1, rod_m1m2, rod_m1m3, slider_normal)
