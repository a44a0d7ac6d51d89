"""The wells of a scene: which saddles part them, or their copies, on the unwrapped plane.

The plane of unwrapped angles repeats every 2 pi in both directions, and a well's copies count their turns.
Flooding it, every saddle joins the two sides below it, and nothing else does (Morse): so a well first meets
another one, or a copy of itself, at the lowest saddle that leads down to it on one side only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fastmech.arrays import Floats
from fastmech.capture.certificate import Wells
from fastmech.errors import InputError
from fastmech.scene import Scene
from fastmech.slider.coefficients import reduce
from fastmech.slider.descent import convex_radius, descend, step_off
from fastmech.slider.equilibria import Equilibria, find_equilibria


@dataclass(frozen=True, eq=False, repr=False)
class BarrierTree(Wells):
    """How the wells of a scene are connected; the barriers count copies of a well as others."""

    radius: Floats  #: of every well [rad]: U is convex in a ball of this radius


def barrier_tree(scene: Scene) -> BarrierTree:
    """The barrier tree of U = Pi - F x2, or of Pi alone where the force decays.

    Raises:
        InputError: the scene's equilibria are not proved to be complete, or no ball about a minimum is
            proved to be convex (too near a fold).
    """
    equilibria = find_equilibria(scene)
    if not equilibria.certificate.complete:
        raise InputError(f"scene: its wells are not certain: {equilibria.certificate.sentence}")
    c, index = frozen_coefficients(scene, equilibria), equilibria.morse_index
    wells = np.flatnonzero(index == 0).tolist()
    phis, thetas = equilibria.phi[wells], equilibria.theta[wells]
    exits: list[list[int]] = [[] for _ in wells]
    with np.errstate(all="ignore"):
        radius = np.array([convex_radius(c, *place) for place in zip(phis, thetas, strict=True)])
        for saddle in np.flatnonzero(index == 1).tolist():
            phi, theta = equilibria[saddle].position
            off = [step_off(c, phi, theta, side) for side in (1.0, -1.0)]
            one, other = (descend(c, *q, phis, thetas, radii=radius, count=len(wells)) for q in off)
            if not (radius > 0.0).all() or min(one[0], other[0]) < 0:
                told = "a minimum and a saddle are too near to each other to tell their sides apart"
                raise InputError(f"scene: {told}")
            if one != other:
                exits[one[0]].append(saddle)
                exits[other[0]].append(saddle)
    energy = equilibria.energy
    passes = [min(saddles, key=energy.__getitem__) for saddles in exits]
    return BarrierTree(equilibria, tuple(wells), energy[passes], tuple(passes), radius)


def frozen_coefficients(scene: Scene, equilibria: Equilibria) -> Floats:
    """Reduced coefficients (8,) with the force that the equilibria hold for."""
    return np.array(reduce(scene)._replace(force=equilibria.force / (scene.m2 * scene.l)), dtype=np.float64)
