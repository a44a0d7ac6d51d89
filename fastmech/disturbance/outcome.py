"""Where a disturbed trajectory has come to at the end of its run."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from fastmech.disturbance.size import size_at
from fastmech.equilibria.find import Equilibria, Equilibrium
from fastmech.errors import InputError
from fastmech.mechanism.lagrange import kinetic_energy, metric, potential_energy, unit
from fastmech.scene import Scene

Floats = NDArray[np.float64]
TURN = 2.0 * np.pi


class Outcome(IntEnum):
    """Where a disturbed trajectory is at the end of the run."""

    RETURNED = 0
    ELSEWHERE = 1
    AT_UNSTABLE = 2
    UNDECIDED = 3
    NOT_FINITE = 4
    STEP_TOO_LARGE = 5
    NOT_CONVERGED = 6

    @property
    def advice(self) -> str:
        """What it means and what to do."""
        return _ADVICE[self]


#: Outcomes of trajectories that have failed.
FAILURES = (Outcome.NOT_FINITE, Outcome.STEP_TOO_LARGE, Outcome.NOT_CONVERGED)

_ADVICE = {
    Outcome.RETURNED: "in the ball of return and without the energy to leave it again, no turns made",
    Outcome.ELSEWHERE: "the same at another stable equilibrium, or at this one some turns further",
    Outcome.AT_UNSTABLE: "still in the ball of an unstable equilibrium: it will leave; use a larger t_end",
    Outcome.UNDECIDED: "still moving at t_end; use a larger t_end",
    Outcome.NOT_FINITE: "became NaN or infinite on the way; use a smaller dt",
    Outcome.NOT_CONVERGED: "Newton's iteration found no solution of a step; use a smaller dt",
    Outcome.STEP_TOO_LARGE: "has energy that it cannot have, or dt is beyond the limit; use a smaller dt",
}


def resting_place(
    scene: Scene, equilibria: Equilibria, final: Floats, radius: float
) -> tuple[NDArray[np.int8], NDArray[np.int64]]:
    """Index of the equilibrium at which each final state (n, 4) rests (-1: none), and the turns made (n, 2).

    A state rests at a minimum if it is in the ball of the given radius [rad] and its energy above the minimum
    is less than any on the ball's surface: energy cannot grow, so it will not leave. At another
    equilibrium, being in the ball is all that can be said.

    Raises:
        InputError: the radius is so large that the balls of two equilibria would meet.
    """
    index = np.full(len(final), -1, dtype=np.int8)
    turns = np.zeros((len(final), 2), dtype=np.int64)
    for i, e in enumerate(equilibria):
        size = size_at(scene, e.phi, e.theta)
        nearest = min(
            (float(size(_apart(e, other))) for other in equilibria if other is not e), default=np.inf
        )
        if radius > 0.5 * nearest:
            raise InputError(
                f"return_radius = {radius:g} rad: must not exceed {0.5 * nearest:.3g} rad, "
                "half the distance of two equilibria"
            )
        departure = final - np.array([e.phi, e.theta, 0.0, 0.0])
        made = np.round(departure[:, :2] / TURN)
        with np.errstate(invalid="ignore"):  # infinite states are nowhere at rest
            departure[:, :2] -= TURN * made
        inside = size(departure) <= radius
        if e.kind == "minimum":
            inside &= excess_energy(scene, e, final) <= confining_energy(scene, e, radius)
        index[inside] = i
        turns[inside] = made[inside].astype(np.int64)
    return index, turns


def excess_energy(scene: Scene, e: Equilibrium, y: Floats) -> Floats:
    """T + U of states (n, 4) above U at an equilibrium [J]."""
    with np.errstate(invalid="ignore", over="ignore"):  # states that are not finite are nowhere at rest
        return kinetic_energy(scene, y) + potential_energy(scene, y[:, :2], scene.F0) - e.energy


def confining_energy(scene: Scene, e: Equilibrium, radius: float) -> float:
    """Energy [J] with which a motion about a minimum stays in the ball of the given radius [rad].

    With the lowest squared frequency s the energy is at least s m2 l^2 size^2 / 2 (the norm's omega is the
    highest frequency), to second order.
    """
    lowest = float(scipy.linalg.eigvalsh(e.hessian, metric(scene, (e.phi, e.theta)))[0])
    return 0.5 * lowest * unit(scene) * radius * radius


def _apart(e: Equilibrium, other: Equilibrium) -> Floats:
    angles = np.array([other.phi - e.phi, other.theta - e.theta])
    return np.append(angles - TURN * np.round(angles / TURN), [0.0, 0.0])
