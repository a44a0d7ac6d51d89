"""Which trajectories of a run have steps that were too long for them: what the run itself shows.

No method follows a body that turns by more than 1 rad in a step. Where a force decays within a step, its
impulse comes out wrong. An Adams method lays a polynomial through its history; where the polynomial's last
term moves an angle by more than 0.01 rad (:mod:`fastmech.kernels.whole`), it does not describe the
motion, or one of the method's spurious roots has grown until it shows. (That a motion ends with an energy
that it cannot have is told by :mod:`fastmech.ensembles.plausible`.)

Linear theory, which tells where small motion grows though it should die out, warns before a run
(:mod:`fastmech.step_limits.warning`) and judges no trajectory: one that only passes is not where it holds.

Each trajectory is judged by its own parameters, step and states: its companions make no difference. One that
passes may still be wrong, by steps too long for accuracy and within these limits. Only a run with shorter
steps tells.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fastmech.integrators.method import ImplicitRungeKutta, Method
from fastmech.integrators.methods import find_method
from fastmech.mechanism.coefficients import Coefficients
from fastmech.scene import Scene
from fastmech.step_limits.amplification import amplifies
from fastmech.step_limits.impulse import impulse_limit
from fastmech.step_limits.predict import GROWTH_PER_RADIAN, UNDAMPED
from fastmech.step_limits.warning import PASSING, TURN, scene_eigenvalues

Floats = NDArray[np.float64]

#: Last term of an Adams method's predictor in an angle [rad] that is let pass.
LAST_TERM = 0.01


@dataclass(frozen=True)
class StepsTaken:
    """The steps of a run's trajectories."""

    first: Floats  #: step of each [s] at the start, where force and rates are great, (n,)
    turned: Floats | None = None  #: greatest turn of a body of each in a step [rad], (n,), if somebody looked
    last_term: Floats = field(default_factory=lambda: np.empty(0))
    #: the same of the last term of an Adams method's predictor in an angle; empty: nobody looked


def too_long(method: Method, c: Coefficients, starts: Floats, taken: StepsTaken) -> NDArray[np.bool_]:
    """Which trajectories (n,) of states (n, 4) have steps that a run shows to be too long.

    ``c`` are reduced coefficients, numbers or of shape (n,).
    """
    with np.errstate(invalid="ignore", over="ignore"):  # starts that are not finite have their own status
        beyond = np.asarray(np.abs(starts[:, 2:]).max(axis=1, initial=0.0) * taken.first > TURN)
        if np.any(c.decay):
            beyond |= (c.force != 0.0) & (taken.first * c.decay > impulse_limit(method))
    if taken.turned is not None:
        beyond |= taken.turned > TURN
    if taken.last_term.size:
        beyond |= taken.last_term > LAST_TERM
    return beyond


def is_beyond(scene: Scene, dt: float, steps: float, method: str) -> bool:
    """Whether so many steps of dt [s] make damped motion grow that rests, or one step motion that passes.

    It is asked at the minima and all over the torus; the rule is that of :mod:`fastmech.step_limits.beyond`.

    Raises:
        InputError: no such method.
    """
    return _grows_in(scene, dt, steps, method, -GROWTH_PER_RADIAN)


def drives_rest(scene: Scene, dt: float, steps: float, method: str) -> bool:
    """Whether so many steps of dt [s] make motion grow, damped or not: where it rests is then their doing.

    Raises:
        InputError: no such method.
    """
    return _grows_in(scene, dt, steps, method, UNDAMPED)


def _grows_in(scene: Scene, dt: float, steps: float, method: str, direction: float) -> bool:
    formula = find_method(method)
    if isinstance(formula, ImplicitRungeKutta) or dt == 0.0:
        return False
    for values, growth in zip(scene_eigenvalues(scene), (PASSING / max(steps, 1.0), PASSING), strict=True):
        decaying = values[values.real <= direction * np.abs(values)]
        if amplifies(formula, dt * decaying, 1.0 + growth).any():
            return True
    return False
