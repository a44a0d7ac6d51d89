"""The wells of a scene: which saddles part them, or their copies, on the unwrapped plane.

The plane of unwrapped angles repeats every 2 pi in both directions, and a well's copies count their turns.
Flooding it, every saddle joins the two sides below it, and nothing else does (Morse): so a well first meets
another one, or a copy of itself, at the lowest saddle that leads down to it on one side only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fastmech.arrays import Floats
from fastmech.capture.wells import Wells
from fastmech.errors import InputError
from fastmech.jit import interpreted
from fastmech.scene import Scene
from fastmech.slider.atlas.map import barriers
from fastmech.slider.coefficients import reduce
from fastmech.slider.descent import convex_radius
from fastmech.slider.equilibria import find_equilibria
from fastmech.slider.solve import solve_rows
from fastmech.slider.theorem import MOST


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
    c, index, energy = np.array(reduce(scene, equilibria.force)), equilibria.morse_index, equilibria.energy
    wells = np.flatnonzero(index == 0).tolist()
    solution, opened = solve_rows(c[None], compiled=False), np.empty((1, MOST))
    with np.errstate(all="ignore"):
        radius = np.array([convex_radius(c, *equilibria[well].position) for well in wells])
        interpreted(barriers)(c[None], solution, opened)
    over = [
        np.flatnonzero((solution.energy[0] == opened[0, well]) & (solution.index[0] == 1)) for well in wells
    ]
    if not ((radius > 0.0).all() and all(map(len, over))):
        raise InputError("scene: a minimum and a saddle are too near to each other to tell their sides apart")
    passes = [int(saddles[0]) for saddles in over]
    return BarrierTree(equilibria, tuple(wells), energy[passes], tuple(passes), radius)
