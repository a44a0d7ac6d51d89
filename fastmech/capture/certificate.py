"""The capture certificate of a scene: from which energy on, and where, a motion belongs to a well for good.

A motion whose bounding energy is below B(w) and whose position lies in w's component of {U < B(w)} ends in
w, since it can never have the energy to leave that component; B(w) is the well's barrier on the plane of
unwrapped angles (``barriers``). The certificate is about the path as it was computed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.atlas.wells import ROUNDING
from fastmech.capture.barriers import BarrierTree, barrier_tree, frozen_coefficients
from fastmech.capture.locate import FIRST_WELL, INTERVAL, fill_cells, pack
from fastmech.capture.observe import (
    LEVEL,
    ROWS,
    TURNS_PHI,
    TURNS_THETA,
    observe_capture,
    observe_capture_decaying,
)
from fastmech.ensembles import checks
from fastmech.ensembles.ends import STOP_CODE
from fastmech.ensembles.run import CALL_STEPS_WITH_STOPS, Observation
from fastmech.mechanism.coefficients import reduce
from fastmech.mechanism.lagrange import unit
from fastmech.scene import Scene, require_scene

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Captured:
    """Wells that states belong to for good; arrays over n states."""

    well: NDArray[np.int8]  #: index among the scene's equilibria, -1: not captured
    turns: NDArray[np.int32]  #: full turns of phi and theta of that well from its listed place, (n, 2)


@dataclass(frozen=True)
class Certificate:
    """The barrier tree of a scene, ready for observers."""

    scene: Scene
    tree: BarrierTree

    @property
    def decays(self) -> bool:
        """Whether the force decays."""
        return self.scene.F0 != 0.0 and self.scene.alpha != 0.0

    @property
    def amplitudes(self) -> float:
        """Sum of the potential's amplitudes over m2 l^2 [1/s^2]: the scale of its rounding."""
        c = reduce(self.scene)
        return abs(c.lift) + c.spring + c.gravity + 2.0 * abs(c.force)

    @property
    def levels(self) -> Floats:
        """Energy over m2 l^2, less the springs' constant, below which each well captures [1/s^2]."""
        return self.reduced(self.tree.barrier) - ROUNDING * self.amplitudes

    def reduced(self, energy: Floats) -> Floats:
        """Energies [J] as kernels count them [1/s^2]."""
        scene = self.scene
        return np.asarray((energy - (scene.c1 + scene.c2) * scene.l**2) / unit(scene))

    def params(self, levels: Floats) -> Floats:
        """The observers' vector (see ``locate.pack``) with proved cells; its interval is still empty."""
        wells, equilibria = list(self.tree.wells), self.tree.equilibria
        amplitude, rate = (reduce(self.scene).force, self.scene.alpha) if self.decays else (0.0, 0.0)
        params = pack(
            frozen_coefficients(self.scene, equilibria),
            amplitude,
            rate,
            equilibria.phi[wells],
            equilibria.theta[wells],
            self.tree.radius,
            levels,
        )
        fill_cells(params)
        return params

    @cached_property
    def packed(self) -> Floats:
        """The observers' vector of the wells' own levels."""
        return self.params(self.levels)

    def observation(
        self, params: Floats, interval: float, call_steps: int = CALL_STEPS_WITH_STOPS
    ) -> Observation:
        """An observer that stops captured lanes at multiples of ``interval`` [s].

        They leave after at most ``call_steps`` steps. ``params`` is what the method of this name gives.
        """
        own = params.copy()
        own[INTERVAL] = interval
        wells = len(self.tree.wells)
        record = np.zeros(ROWS)
        record[LEVEL] = params[FIRST_WELL + 3 * wells : FIRST_WELL + 4 * wells].max()
        observe = observe_capture_decaying if self.decays else observe_capture
        return Observation(observe, own, record, stops=True, call_steps=call_steps)

    def captured(self, states: Floats) -> Captured:
        """Which states (n, 4) at t = 0 are captured already."""
        observation = self.observation(self.packed, 1.0)
        record = np.repeat(observation.record[:, None], len(states), axis=1)
        observation.observe(0.0, np.ascontiguousarray(states.T), observation.params, record)
        return self.decode(record)

    def decode(self, record: Floats) -> Captured:
        """Wells and turns from an observer's record (rows, n)."""
        code = record[STOP_CODE].astype(np.int64)
        well = np.append(-1, self.tree.wells)[code].astype(np.int8)
        return Captured(well, record[[TURNS_PHI, TURNS_THETA]].T.astype(np.int32))


@lru_cache(maxsize=16)
def certificate_of(scene: Scene) -> Certificate:
    """The capture certificate of a scene, kept for the next starts of the same scene.

    Raises:
        InputError: the scene's wells are not certain (see :func:`fastmech.capture.barriers.barrier_tree`).
    """
    return Certificate(scene, barrier_tree(scene))


def trapped(scene: Scene, states: ArrayLike) -> Captured:
    """Which states at t = 0 can never leave their well, whatever the damper does: the certificate at once.

    With ``beta = 0`` nothing comes to rest, and this is all that can be said about wells.

    Args:
        scene: the mechanism. Where its force decays, the wells are those of springs and weights.
        states: phi, theta [rad], phi', theta' [rad/s], shape (n, 4) or (4,).

    Raises:
        InputError: not states, or the scene's wells are not certain.
    """
    require_scene(scene)
    return certificate_of(scene).captured(checks.states("states", states, 4))
