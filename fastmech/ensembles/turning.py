"""How far a body turns in a step: what a run tells of its steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.fitting import speed_bound
from fastmech.ensembles.problem import Problem
from fastmech.ensembles.run import Observation
from fastmech.jit import OBSERVER_SIGNATURE, kernel
from fastmech.mechanism.coefficients import Coefficients
from fastmech.step_limits.warning import TURN

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: By how much rounding may make a step longer than the dt that it was to be.
ROUNDED = 1e-6

#: Rows of the record: the greatest turn of an angle in a step [rad], and the angles that the step began with.
TURNED, BEFORE = 0, 1


@kernel(OBSERVER_SIGNATURE)
def observe_turns(t: float, Y: Floats, params: Floats, record: Floats) -> None:
    """Keep the greatest turn of every lane."""
    for angle in range(2):
        for i in range(Y.shape[1]):
            turned = abs(Y[angle, i] - record[BEFORE + angle, i])
            record[TURNED, i] = turned if turned > record[TURNED, i] else record[TURNED, i]
            record[BEFORE + angle, i] = Y[angle, i]


TURNS = Observation(observe_turns, np.zeros(0), np.zeros(3), states=2)


def may_turn(c: Coefficients, starts: Floats, dt: float | Floats, threads: int | None = None) -> Flags:
    """Whether a body may turn by more than :data:`TURN` in a step of ``dt`` [s], by its energy; shape (n,).

    Of rates whose kinetic-energy norm is 1 none is greater than sqrt((mass + 1) / mass): the inverse of
    the mass matrix has no greater diagonal entry in any configuration.
    """
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        turn = speed_bound(c, starts, threads)
        turn *= np.sqrt((c.mass + 1.0) / c.mass)
        turn *= dt
        return np.asarray(turn > TURN)


def watched(problem: Problem, starts: Floats, dt: float, threads: int | None = None) -> Problem:
    """The problem, with turns observed where the steps of ``dt`` [s] are long enough for them."""
    c = problem.coefficients
    some = c is not None and may_turn(c, starts, (1.0 + ROUNDED) * dt, threads).any()
    return replace(problem, observation=TURNS) if some else problem


def counted_turns(
    problem: Problem, starts: Floats, dt: Floats, records: Floats, threads: int | None = None
) -> Floats | None:
    """The turns (n,) in the records of a watched problem with steps of at most ``dt`` (n,) [s].

    Only those count that the energy allows in a trajectory's own steps, else they are 0: they do not depend
    on whether its companions' were a reason to watch. ``None``: nobody is watched.
    """
    c = problem.coefficients
    if c is None or problem.observation is not TURNS:
        return None
    return np.where(may_turn(c, starts, dt, threads), records[TURNED], 0.0)
