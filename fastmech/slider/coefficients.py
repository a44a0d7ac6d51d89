"""The scene in the seven coefficients (and the decay rate) that its motion depends on.

Dividing the equations of motion by m2 l^2 leaves fewer numbers than the scene has parameters. Everything
in this sub-package that moves or balances the mechanism works with them ("reduced" quantities, those of
the mechanism divided by m2 l^2); energies and forces in SI units are m2 l^2 times as large.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.scene import Scene


class Coefficients(NamedTuple):
    """Reduced coefficients of a scene; ``np.array(coefficients)`` is what kernels are given."""

    mass: float  #: m1/m2
    slider: float  #: m3/m2
    lift: float  #: ((m1 + m2) g l - c2 l^2) / (m2 l^2) [1/s^2], the pull on phi
    spring: float  #: c1/m2 [1/s^2]
    gravity: float  #: g/l [1/s^2]
    force: float  #: F0/(m2 l) [1/s^2]
    damping: float  #: beta/m2 [1/s]
    decay: float  #: alpha [1/s]


def reduce(scene: Scene, frozen: float | None = None) -> Coefficients:
    """Reduced coefficients of a scene (equations of motion over m2 l^2); a frozen force [N] is put for F0."""
    m1, m2, l = scene.m1, scene.m2, scene.l
    return Coefficients(
        mass=m1 / m2,
        slider=scene.m3 / m2,
        lift=((m1 + m2) * scene.g / l - scene.c2) / m2,
        spring=scene.c1 / m2,
        gravity=scene.g / l,
        force=(scene.F0 if frozen is None else frozen) / (m2 * l),
        damping=scene.beta / m2,
        decay=scene.alpha,
    )


def force(scene: Scene, t: ArrayLike) -> NDArray[np.float64]:
    """Force F(t) = F0 exp(-alpha t) on M2 along +x [N] (paper, section 2)."""
    return scene.F0 * np.exp(-scene.alpha * np.asarray(t, dtype=np.float64))
