"""Which trajectories of a run have steps that cannot be right for them, one by one, and the warning of it.

What a run itself shows comes first. No method follows a body that turns by more than 1 rad in a step. An
Adams method lays a polynomial through its history; where the polynomial's last term moves an angle
by more than 0.01 rad (:mod:`fastmech.kernels.whole`), it does not describe the motion, or one of the
method's spurious roots, which stand for no mode, has grown until it shows. By theory alone these are not
judged: a motion that swings is seldom where they grow, and what does not show does no harm.

By theory a step is too long for small motion where motion that should die out grows by more than 1 %
(:data:`fastmech.step_limits.limits.PASSING`) over the steps taken *there*, at the start or where the motion
has come to: amplification^steps > 1.01, of an Adams method by the mode's own root. A motion that only
crosses a configuration takes few steps there, at least one; one that rests takes all steps of the run.
Growth below that does not show: a method's region may end by 1e-9 a step short of the axis, and thousands of
such steps are still right to many digits. Modes that decay by less than 1e-6 a radian
(:data:`fastmech.step_limits.predict.GROWTH_PER_RADIAN`) count as undamped, and of undamped motion its energy
tells whether it has grown, which is the better judge.

Each trajectory is judged by its own parameters, step and states: its companions make no difference. One that
passes may still be wrong, by steps too long for accuracy and within these limits; one that does not may yet
have come to rest in the right place, or be right to many digits by a method of high order that turns it by
more than 1 rad a step. Only a run with shorter steps tells.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.integrators.implicit_method import ImplicitRungeKutta
from fastmech.integrators.methods import find_method
from fastmech.mechanism.coefficients import Coefficients, reduce
from fastmech.scene import Scene
from fastmech.step_limits.amplification import amplifies
from fastmech.step_limits.growth import MOST_STEPS, counted, mark_growing, stiffest_growing
from fastmech.step_limits.impulse import impulse_limit
from fastmech.step_limits.limits import (
    ALLOWED,
    CERTAIN,
    INNOCENT,
    LAST_TERM,
    PASSING,
    ROUNDED,
    TURN,
    steps_there,
)
from fastmech.step_limits.local import eigenvalues, local_motion, part, state_matrices
from fastmech.step_limits.predict import GROWTH_PER_RADIAN, UNDAMPED, is_stable, stable_step
from fastmech.step_limits.region import region, rows_of
from fastmech.step_limits.warning import GROWS, KEPT, Limit, scene_eigenvalues, warn_of_step

Floats = NDArray[np.float64]

#: Divisions of :func:`fastmech.step_limits.crossing.first_crossing` for a limit that is told to two digits.
TOLD = 3

#: Eigenvalues between the grid's configurations may be larger than those at them by this factor.
BETWEEN = 1.15

#: Trajectories of a part where some are looked at closely, and where they are far from a limit.
CLOSE_PART, FAR_PART = 2**12, 2**15

#: Does a work on all of so many trajectories, which share nothing, in parts of so many.
Share = Callable[[Callable[[slice], None], int, int], None]


def alone(work: Callable[[slice], None], n: int, part: int) -> None:
    """All trajectories as one part, in this thread."""
    with np.errstate(invalid="ignore", over="ignore"):  # what is not finite has a status of its own
        work(slice(0, n))


@dataclass(frozen=True)
class StepsTaken:
    """The steps of a run's trajectories."""

    first: Floats  #: step of each [s] at the start, where force and rates are great, (n,)
    longest: Floats  #: longest step of each [s], (n,)
    number: Floats | NDArray[np.int64]  #: steps of each, (n,)
    until: float  #: end of the run [s]
    turned: Floats | None = None  #: greatest turn of a body of each in a step [rad], (n,), if somebody looked
    last_term: Floats = field(default_factory=lambda: np.empty(0))
    #: the same of the last term of an Adams method's predictor in an angle; empty: nobody looked


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


class StepJudge:
    """The judge of a run's steps: before the run in words, after it trajectory by trajectory.

    Args:
        scene: the mechanism.
        own: values (n,) of parameters that differ between trajectories.
        starts: states (n, 4).
        method: a name from :data:`fastmech.integrators.methods.METHODS`.

    Raises:
        InputError: no such method.
    """

    def __init__(self, scene: Scene, own: Mapping[str, Floats], starts: Floats, method: str) -> None:
        self._scene, self._own, self._starts = scene, own, starts
        self._method = find_method(method)
        self._coefficients = _coefficients(scene, own)
        self._still: tuple[float, float] | None = (
            None  # step [s] and number that leave starts far from growth
        )

    def warn(self, extremes: Sequence[Scene], dt: float, steps: float, stacklevel: int = 2) -> None:
        """Warn, in the caller's caller, of a step [s] that is too long for one of many trajectories.

        Looked at are the extreme scenes at every configuration, the rates of all starts, and every trajectory
        with its own parameters at its start, by the rule of :meth:`beyond`. Not looked at is where
        trajectories of other scenes will come to: that has its status after the run.

        Args:
            extremes: the scenes of :func:`fastmech.ensembles.problem.extreme_scenes`.
            dt: longest step [s].
            steps: how many of them make the run.
            stacklevel: of the warning, 1 for the caller of this function.
        """
        method, c = self._method, self._coefficients
        asked: set[int] = set()
        if len(self._starts) and not self._is_quiet(
            dt, steps
        ):  # else there is one scene, which is looked at in any case
            stiffest, still = stiffest_growing(method, c, self._starts, dt, steps)
            self._still = ((1.0 + ROUNDED) * dt, float(np.ceil(steps))) if still else None
            asked |= set() if stiffest is None else {stiffest}
            fading: Any = np.where(c.force != 0.0, c.decay, 0.0)
            asked |= {int(np.argmax(fading))} if fading.any() else set()
        others: list[Limit] = []
        scenes = dict.fromkeys(extremes)
        for k in asked:
            scene = self._scene.replace(**{name: float(values[k]) for name, values in self._own.items()})
            scenes[scene] = None
            others += _own_limit(method.name, scene, tuple(self._starts[k].tolist()), dt, steps)
        warn_of_step(list(scenes), dt, method.name, self._starts, stacklevel + 1, others)

    def beyond(self, ends: Floats | None, taken: StepsTaken, share: Share = alone) -> NDArray[np.bool_]:
        """Which trajectories (n,) have a step beyond a limit: of stability, the impulse, the angle turned.

        Args:
            ends: last finite states (n, 4), ``None``: not known yet. A step that is too long for places where
                a motion never is does it no harm: it must be so at the start, under the force's full
                strength, or where the motion has come to, under what is left of it.
            taken: the steps.
            share: does the work, in threads if need be.
        """
        method, c, starts = self._method, self._coefficients, self._starts
        beyond = _begins_too_fast(starts[:, 2:], taken.first)
        if np.any(c.decay):
            beyond |= (c.force != 0.0) & (taken.first * c.decay > impulse_limit(method))
        if taken.turned is not None:
            beyond |= taken.turned > TURN
        if taken.last_term.size:
            beyond |= taken.last_term > LAST_TERM
        longest, most = taken.longest.max(initial=0.0), taken.number.max(initial=0)
        if self._is_quiet(longest, most):
            return beyond
        verdicts = beyond.astype(np.int8)
        left: Any = c.force * np.exp(-c.decay * taken.until)
        places = [] if self._still and longest <= self._still[0] and most <= self._still[1] else [(c, starts)]
        places += [] if ends is None else [(c._replace(force=left), ends)]

        def judge(members: slice) -> None:
            for own, states in places:
                steps = taken.longest[members], taken.number[members]
                mark_growing(method, part(own, members), states[members], *steps, verdicts[members])

        share(judge, len(starts), FAR_PART if self._still else CLOSE_PART)
        return verdicts != INNOCENT

    def _is_quiet(self, dt: float, steps: float) -> bool:
        """Whether steps of dt [s] are so short that small motion grows nowhere, however long it stays."""
        if self._own or isinstance(self._method, ImplicitRungeKutta):
            return False
        most = region(self._method.name).largest[rows_of(np.array(dt * fastest_decaying(self._scene)))]
        return bool(most * np.clip(steps, 1.0, MOST_STEPS) <= CERTAIN * ALLOWED)


@lru_cache(KEPT)
def fastest_decaying(scene: Scene) -> float:
    """Bound [1/s] on the eigenvalues of decaying small motion about all configurations of a scene.

    Those of a grid, and a margin for what lies between. What is left of a force that decays makes none of
    them larger: of a matrix linear in the force the largest eigenvalue is a convex function of it.
    """
    values = np.concatenate(scene_eigenvalues(scene))
    return BETWEEN * float(np.abs(values[values.real < 0.0]).max(initial=0.0))


@lru_cache(KEPT)
def _own_limit(
    method: str, scene: Scene, start: tuple[float, ...], dt: float, steps: float
) -> tuple[Limit, ...]:
    """The longest step [s] at the start of a trajectory for which dt is too long; none if it is not."""
    c, state, formula = reduce(scene), np.array([start]), find_method(method)
    matrices = state_matrices(c, *state[:, :2].T)
    if not np.isfinite(matrices).all():
        return ()
    growth = PASSING / float(steps_there(local_motion(c, state).time[0], dt, counted(np.array(steps))))
    values = eigenvalues(matrices)
    if scene.beta == 0.0 or is_stable(formula, values, dt, growth):  # told at once, the limit is not
        return ()
    limit = stable_step(formula, values, growth, TOLD)
    return (Limit(limit, GROWS),) if limit > 0.0 else ()


def _coefficients(scene: Scene, own: Mapping[str, Floats]) -> Coefficients:
    """Reduced coefficients, numbers or of shape (n,)."""
    return reduce(SimpleNamespace(**(scene.model_dump() | dict(own))))  # type: ignore[arg-type]


def _begins_too_fast(rates: Floats, first: Floats) -> NDArray[np.bool_]:
    """Which motions (n,) turn a body by more than 1 rad in a step if they stay as fast as at first."""
    with np.errstate(invalid="ignore", over="ignore"):  # starts that are not finite have their own status
        fastest = np.abs(rates[:, 0])
        np.maximum(fastest, np.abs(rates[:, 1]), out=fastest)
        fastest *= first
        return np.asarray(fastest > TURN)
