"""Which trajectories of a run have steps that cannot be right for them, one by one, and the warning of it.

A step is too long for small motion where motion that should die out grows by more than 1 %
(:data:`fastmech.step_limits.warning.PASSING`) over the steps taken *there*: amplification^steps > 1.01. A
motion that only crosses a configuration takes few steps there, at least one; one that rests takes all steps
of the run. Growth below that does not show: a method's region may end by 1e-9 a step short of the axis, and
thousands of such steps are still right to many digits.

An Adams method has roots that stand for no mode. They multiply its errors, not the motion, and count from a
growth by :data:`SPURIOUS` in all steps of the run: at the start, at the end, and, of a scene whose parameters
all share, at its minima, about which damped motion goes to and fro.

Modes that decay by less than 1e-6 a radian (:data:`fastmech.step_limits.predict.GROWTH_PER_RADIAN`) count as
undamped, and of undamped motion its energy tells whether it has grown, which is the better judge. Each
trajectory is judged by its own parameters, step and states: its companions make no difference.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.integrators.implicit_method import ImplicitRungeKutta
from fastmech.integrators.method import Adams, Method
from fastmech.integrators.methods import find_method
from fastmech.mechanism.coefficients import Coefficients, reduce
from fastmech.scene import Scene
from fastmech.step_limits.amplification import amplification, amplifies, principal_root
from fastmech.step_limits.impulse import impulse_limit
from fastmech.step_limits.local import eigenvalue_bound, eigenvalues, state_matrices, time_near
from fastmech.step_limits.predict import GROWTH_PER_RADIAN, UNDAMPED, is_stable, stable_step
from fastmech.step_limits.warning import (
    GROWS,
    PASSING,
    TURN,
    Limit,
    scene_eigenvalues,
    warn_of_step,
)

Floats = NDArray[np.float64]

#: Growth of an Adams method's errors in a run that counts: those of its starter are far above rounding.
SPURIOUS = 1e4

#: Trajectories judged at once: what is computed on the way stays in the caches.
AT_ONCE = 2**14

#: Steps of a run that are told apart: a year's are fewer.
MOST_STEPS = 2.0**44

#: Sizes of h lambda, falling, and directions of modes that decay (the others are their mirror images), at
#: which a method's region is looked at.
SIZES = 8.0 * 0.95 ** np.arange(180.0)
DIRECTIONS = np.exp(1j * np.linspace(0.5 * np.pi, np.pi, 33))


@dataclass(frozen=True)
class StepsTaken:
    """The steps of a run's trajectories."""

    first: Floats  #: step of each [s] at the start, where force and rates are great, (n,)
    longest: Floats  #: longest step of each [s], (n,)
    number: Floats | NDArray[np.int64]  #: steps of each, (n,)
    until: float  #: end of the run [s]


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


def steps_beyond(
    scene: Scene,
    own: Mapping[str, Floats],
    starts: Floats,
    ends: Floats | None,
    taken: StepsTaken,
    method: str,
) -> NDArray[np.bool_]:
    """Which trajectories (n,) have a step beyond a limit: of stability, of the impulse, of the angle turned.

    Args:
        scene: the mechanism.
        own: values (n,) of parameters that differ between trajectories.
        starts: states (n, 4).
        ends: last finite states (n, 4), ``None``: not known yet. A step that is too long for places where a
            motion never is does it no harm: it must be so at the start, under the force's full strength, or
            where the motion has come to, under what is left of it.
        taken: the steps.
        method: a name from :data:`fastmech.integrators.methods.METHODS`.

    Raises:
        InputError: no such method.
    """
    formula, c = find_method(method), _coefficients(scene, own, len(starts))
    beyond = _turns_too_far(starts[:, 2:], taken.first)
    beyond |= (c.force != 0.0) & (taken.first * c.decay > impulse_limit(formula))
    beyond |= _grows_there(formula, c, starts, taken)
    if ends is not None:
        left: Any = c.force * np.exp(-c.decay * taken.until)
        beyond |= _grows_there(formula, c._replace(force=left), ends, taken)
    if isinstance(formula, Adams) and not own:
        beyond |= _errors_grow_at_rest(formula, scene, taken)
    return beyond


def _errors_grow_at_rest(method: Adams, scene: Scene, taken: StepsTaken) -> NDArray[np.bool_]:
    """Whether errors (n,) grow at the scene's minima, over all steps, by a root that stands for no mode."""
    resting = scene_eigenvalues(scene)[0]
    damped = resting[resting.real < -GROWTH_PER_RADIAN * np.abs(resting)]
    growth = np.zeros(len(taken.longest))
    for dt in np.unique(taken.longest) if damped.size else ():
        growth[taken.longest == dt] = np.log(np.max(amplification(method, dt * damped)))
    return np.asarray(growth * taken.number > np.log(SPURIOUS))


def warn_of_steps(
    scene: Scene,
    extremes: Sequence[Scene],
    own: Mapping[str, Floats],
    starts: Floats,
    dt: float,
    steps: float,
    method: str,
    stacklevel: int = 2,
) -> None:
    """Warn, in the caller's caller, of a step [s] that is too long for one of many trajectories.

    Looked at are the extreme scenes at every configuration, the rates of all starts, and every trajectory
    with its own parameters at its start, by the rule of :func:`steps_beyond`. Not looked at is where
    trajectories of other scenes will come to: that has its status after the run.

    Raises:
        InputError: no such method.
    """
    n = len(starts)
    taken = StepsTaken(np.full(n, dt), np.full(n, dt), np.full(n, steps), 0.0)
    others: list[Limit] = []
    scenes = list(extremes)
    beyond = np.flatnonzero(steps_beyond(scene, own, starts, None, taken, method))
    if beyond.size:
        c = _part(_coefficients(scene, own, n), beyond)
        bound = eigenvalue_bound(state_matrices(c, *starts[beyond, :2].T))
        stiffest = np.argmax(np.where(np.isfinite(bound), bound, -1.0))
        shortest = np.argmax(np.where(c.force != 0.0, c.decay, -1.0))
        for k in {int(beyond[stiffest]), int(beyond[shortest])}:
            scenes.append(scene.replace(**{name: float(values[k]) for name, values in own.items()}))
            others += _own_limit(find_method(method), scenes[-1], starts[k], dt, steps)
    warn_of_step(scenes, dt, method, starts, stacklevel + 1, others)


def _own_limit(method: Method, scene: Scene, start: Floats, dt: float, steps: float) -> list[Limit]:
    """The longest step [s] at the start of a trajectory for which dt is too long; none if it is not."""
    c, state = _coefficients(scene, {}, 1), start[None]
    matrices = state_matrices(c, *state[:, :2].T)
    if not np.isfinite(matrices).all():
        return []
    growth = PASSING / float(np.clip(time_near(c, state)[0] / dt, 1.0, max(steps, 1.0)))
    values = eigenvalues(matrices)
    if scene.beta == 0.0 or is_stable(method, values, dt, growth):  # told at once, the limit is not
        return []
    limit = stable_step(method, values, growth)
    return [Limit(limit, GROWS)] if limit > 0.0 else []


def _coefficients(scene: Scene, own: Mapping[str, Floats], n: int) -> Coefficients:
    """Reduced coefficients, each of shape (n,)."""
    scenes: Any = SimpleNamespace(**(scene.model_dump() | dict(own)))
    values: Any = (np.broadcast_to(np.asarray(value, dtype=np.float64), n) for value in reduce(scenes))
    return Coefficients(*values)


def _part(c: Coefficients, members: Any) -> Coefficients:
    values: Any = (np.asarray(value)[members] for value in c)
    return Coefficients(*values)


def _grows_there(method: Method, c: Coefficients, states: Floats, taken: StepsTaken) -> NDArray[np.bool_]:
    """Whether damped small motion about each configuration (n,) grows by 1 % over the steps taken there."""
    grows = np.zeros(len(states), dtype=np.bool_)
    if isinstance(method, ImplicitRungeKutta) or not np.any(c.damping):
        return grows
    most = float(taken.number.max(initial=1))
    quiet = quiet_size(method.name, int(np.ceil(np.log2(min(max(most, 1.0), MOST_STEPS)))))
    for first in range(0, len(states), AT_ONCE):
        members = np.arange(first, min(first + AT_ONCE, len(states)))
        matrices = state_matrices(_part(c, members), *states[members, :2].T)
        bound = eigenvalue_bound(matrices) * taken.longest[members]
        # What is not finite has a status of its own.
        asked = (bound > quiet) & np.isfinite(bound) & (np.asarray(c.damping)[members] > 0.0)
        if asked.any():
            some = members[asked]
            values = taken.longest[some, None] * eigenvalues(matrices[..., asked])
            number: Floats = np.clip(taken.number[some].astype(np.float64), 1.0, MOST_STEPS)
            there = np.clip(time_near(_part(c, some), states[some]) / taken.longest[some], 1.0, number)
            # Conjugate eigenvalues say the same.
            damped = values.real < -GROWTH_PER_RADIAN * np.abs(values)
            lane, mode = np.nonzero(damped & (values.imag >= 0.0))
            grows[some[lane[_grow(method, values[lane, mode], there[lane], number[lane])]]] = True
    return grows


def _grow(method: Method, z: NDArray[np.complex128], there: Floats, number: Floats) -> NDArray[np.bool_]:
    """Which modes (n,), z = h lambda, grow by more than is let pass in the steps there, or errors in all."""
    factor = (1.0 + PASSING) ** (1.0 / there)
    grow = amplifies(method, z, factor)
    if isinstance(method, Adams) and grow.any():
        own = np.abs(principal_root(method, z[grow])) > factor[grow]
        grow[grow] = own | amplifies(method, z[grow], SPURIOUS ** (1.0 / number[grow]))
    return grow


@lru_cache(1024)
def quiet_size(method: str, doublings: int) -> float:
    """Size of h lambda up to which no mode that decays grows by 0.5 % in 2^doublings steps.

    Between the directions looked at a method's amplification changes by less than what is left to 1 %. By the
    maximum principle what holds on the boundary of a half disk holds within.
    """
    growth = 0.5 * PASSING / 2.0**doublings
    grows = amplifies(find_method(method), SIZES[:, None] * DIRECTIONS, 1.0 + growth).any(axis=1)
    last = np.flatnonzero(grows)
    smaller = int(last[-1]) + 1 if last.size else 0
    return float(SIZES[smaller]) if smaller < SIZES.size else 0.0


def _turns_too_far(rates: Floats, first: Floats) -> NDArray[np.bool_]:
    """Which motions (n,) turn a body by more than 1 rad in a step if they stay as fast as at first."""
    too_far = np.zeros(len(rates), dtype=np.bool_)
    with np.errstate(
        invalid="ignore", over="ignore"
    ):  # starts that are not finite have a status of their own
        fastest = max(rates.max(initial=0.0), -rates.min(initial=0.0))
        if not fastest * first.max(initial=0.0) <= TURN:
            too_far |= first * np.abs(rates).max(axis=1) > TURN
    return too_far
