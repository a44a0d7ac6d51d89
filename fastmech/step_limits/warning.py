"""How long a step may be, by the eigenvalues of small motion, and what is wrong with a longer one.

That is told before the run begins, in one line with the number that would do, and after it.

No method follows a body that turns by more than 1 rad in a step. Where a force decays within a step, its
impulse comes out wrong. Linear theory, which tells where small motion grows though it should die out, warns
and judges no trajectory: one that only passes is not where it holds.

After the run each trajectory is judged by its own parameters, step and states: its companions make no
difference. One that passes may still be wrong, by steps too long for accuracy and within these limits. Only a
run with shorter steps tells.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import cache, lru_cache
from numbers import Real
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Flags, Floats
from fastmech.errors import InputError, StepWarning, shown
from fastmech.integrators.methods import Adams, ImplicitRungeKutta, Method, RungeKutta, find_method
from fastmech.models.mechanism import Mechanism
from fastmech.models.stability import modes, state_matrix
from fastmech.scene import Scene, require_scene
from fastmech.step_limits.amplification import amplifies, first_crossing

#: Error of a mode's growth, a radian, that is let pass. A mode without damping sits on the edge of every
#: region of stability; one that decays by less than this a radian is as good as undamped.
GROWTH_PER_RADIAN = 1e-6

#: Real part, relative to the eigenvalue, that rounding explains.
UNDAMPED = 1e-12

#: Product of step and largest eigenvalue at which the search begins and ends.
NEAREST, FARTHEST = 1e-3, 1e6

#: Shares of a step at which it is tried: regions may have holes.
SHORTER = 0.8 ** np.arange(8.0)


def stable_step(method: Method, eigenvalues: ArrayLike, growth: float = 0.0) -> float:
    """Largest step [s] up to which no decaying mode grows by more than ``growth``; inf if A-stable.

    Growing modes set no limit. A mode that decays by less than :data:`GROWTH_PER_RADIAN` a radian may miss
    its decay by that much, as one without damping may.
    """
    grow, fastest = _growth(method, eigenvalues, growth)
    return first_crossing(grow, NEAREST / fastest, FARTHEST / fastest) if fastest > 0.0 else np.inf


def is_stable(method: Method, eigenvalues: ArrayLike, h: float, growth: float = 0.0) -> bool:
    """Whether no decaying mode grows with a step h [s], nor with some shorter ones: quicker to tell."""
    grow, _ = _growth(method, eigenvalues, growth)
    return not grow(h * SHORTER).any()


def _growth(method: Method, eigenvalues: ArrayLike, growth: float) -> tuple[Callable[[Floats], Flags], float]:
    """With which steps a mode that decays grows by more than it may, and the fastest such mode's rate [1/s].

    Of conjugate eigenvalues one stands for both; an implicit method lets none grow.
    """
    values = np.asarray(eigenvalues, dtype=np.complex128)
    decays = (values.real <= UNDAMPED * np.abs(values)) & (values != 0.0)
    values = values[decays & (not isinstance(method, ImplicitRungeKutta))]
    values = np.unique(np.minimum(values.real, 0.0) + 1j * np.abs(values.imag))
    slack = np.maximum(values.real + GROWTH_PER_RADIAN * np.abs(values), 0.0)

    def grow(h: Floats) -> Flags:
        factor = 1.0 + growth + h[:, None] * slack
        return np.asarray(amplifies(method, h[:, None] * values, factor).any(axis=1))

    return grow, float(np.abs(values).max(initial=0.0))


def largest_stable_step(scene: Scene | Mechanism, equilibrium: Any, method: str) -> float:
    """Largest step [s] at which small motions about a stable equilibrium die out as they should.

    Args:
        scene: the mechanism; a scene's force is the equilibrium's, frozen, other loads are at their means.
        equilibrium: one of :func:`fastmech.find_equilibria`. Where it is unstable, the modes that decay set
            the limit.
        method: a name from :data:`fastmech.integrators.methods.METHODS`.

    Returns:
        inf for an A-stable method.

    Raises:
        InputError: an argument is wrong.
    """
    return stable_step(find_method(method), np.linalg.eigvals(state_matrix(scene, equilibrium)))


#: Growth a step that is let pass where a motion only crosses the configurations that set the limit.
PASSING = 0.01

#: Angle [rad] by which a body may turn in one step.
TURN = 1.0

#: What is wrong with a step beyond stability.
GROWS, UNDAMPED_GROWS = "motions that die out would grow", "undamped motions would grow"

#: Scenes and mechanisms whose limits are remembered.
KEPT = 4096


@lru_cache(KEPT)
def step_limit(scene: Scene | Mechanism, method: str) -> float:
    """Largest step [s] that is stable wherever it can rest, and nearly so at every configuration.

    Where it can rest no motion may grow that should die out; elsewhere, where a scene only passes, by 1 % a
    step, both with the force at full strength and with the force gone.
    """
    formula = find_method(method)
    resting, passing = modes(scene)
    return min(stable_step(formula, resting), stable_step(formula, passing, PASSING))


@lru_cache(KEPT)
def beyond_stability(scene: Scene | Mechanism, dt: float, method: str) -> bool:
    """Whether a step [s] is longer than :func:`step_limit`, which takes longer to find."""
    formula = find_method(method)
    resting, passing = modes(scene)
    return not (is_stable(formula, resting, dt) and is_stable(formula, passing, dt, PASSING))


def step_warning(
    scene: Scene | Mechanism, dt: float, method: str, starts: ArrayLike | None = None
) -> str | None:
    """One line if a step cannot be right for a scene or a mechanism, else ``None``.

    It is too long where a motion that dies out grows instead, where the decaying force's impulse comes out
    wrong, or where a body turns by more than 1 rad in it. Of a mechanism only the small motions about its
    resting places are looked at, and the rates of its angles.

    Args:
        scene: the mechanism.
        dt: step [s].
        method: a name from :data:`fastmech.integrators.methods.METHODS`.
        starts: states phi, theta [rad], phi', theta' [rad/s], shape (n, 4), of a ``Mechanism`` coordinates,
            then rates; the rates count if given.

    Raises:
        InputError: an argument is wrong.
    """
    if not isinstance(scene, Mechanism):
        require_scene(scene)
    fastest = 0.0 if starts is None else _fastest(scene, starts)
    if not isinstance(dt, Real) or isinstance(dt, bool) or not 0.0 < dt <= float(np.finfo(np.float64).max):
        raise InputError(f"dt = {shown(dt)}: must be a finite number of s greater than 0")
    return _told([scene], dt, method, fastest)


def _told(scenes: Sequence[Scene | Mechanism], dt: float, method: str, fastest: float) -> str | None:
    """What is wrong for one of some scenes whose angles turn so fast [rad/s]."""
    limit = min([Limit(np.inf, ""), *(found for scene in scenes for found in _limits(scene, dt, method))])
    if fastest > 0.0:
        reason = f"at {fastest:.3g} rad/s it would turn {dt * fastest:.3g} rad a step"
        limit = min(limit, Limit(TURN / fastest, reason))
    if dt <= limit.step:
        return None
    if limit.step == 0.0:
        return f"dt = {dt:g} s: no step will do for {method} here, undamped motions grow with every one"
    below = float(f"{0.9 * limit.step:.1e}")
    return f"dt = {dt:g} s: too long for {method} here, {limit.reason}; dt = {below:g} s would do"


def warn_of_step(
    scenes: Sequence[Scene], dt: float, method: str, starts: ArrayLike | None = None, stacklevel: int = 2
) -> None:
    """Warn, in the caller's caller, if a step cannot be right for one of some scenes."""
    fastest = 0.0 if starts is None else _fastest(scenes[0], starts)
    told = _told(scenes, dt, method, fastest)
    if told:
        warnings.warn(told, StepWarning, stacklevel=stacklevel + 1)


class Limit(NamedTuple):
    """The longest step that is fine [s], and what is wrong with a longer one."""

    step: float
    reason: str


def _fastest(scene: Scene | Mechanism, starts: ArrayLike) -> float:
    """The greatest finite rate [rad/s] of an angle in states (n, states) or (states,)."""
    count = len(scene.state)
    angles = [k + count // 2 for k, name in enumerate(scene.state[: count // 2]) if name not in scene.lengths]
    try:
        states = np.asarray(starts, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"starts: must be numbers of shape (n, {count})") from None
    if states.ndim not in (1, 2) or states.shape[-1] != count:
        raise InputError(f"starts: has shape {states.shape}, must be (n, {count})")
    rates = np.abs(states[..., angles])
    fastest = float(np.max(rates, initial=0.0))
    if not np.isfinite(fastest):  # what is not has a status of its own
        fastest = float(np.max(rates[np.isfinite(rates)], initial=0.0))
    return fastest


def _limits(scene: Scene | Mechanism, dt: float, method: str) -> Iterator[Limit]:
    """What linear theory and a decaying force allow."""
    formula = find_method(method)
    if beyond_stability(scene, dt, method):
        yield Limit(step_limit(scene, method), GROWS if scene.damped else UNDAMPED_GROWS)
    if scene.fading > 0.0:
        ratio = impulse_ratio(formula, dt * scene.fading)
        reason = f"the decaying force would give {ratio:.3g} times its impulse"
        yield Limit(impulse_limit(formula) / scene.fading, reason)


def too_long(method: Method, fading: Floats, starts: Floats, dt: Floats) -> Flags:
    """Which trajectories of states (n, dim) begin with steps ``dt`` (n,) [s] too long for them, (n,).

    Then force and rates are great. A load decays at a rate ``fading`` [1/s], of all or of each (n,).
    """
    rates = starts[:, starts.shape[1] // 2 :]
    with np.errstate(invalid="ignore", over="ignore"):  # starts that are not finite have their own status
        beyond = np.asarray(np.abs(rates).max(axis=1, initial=0.0) * dt > TURN)
        if np.any(fading):
            beyond |= dt * fading > impulse_limit(method)
    return beyond


def grows(scene: Scene | Mechanism, dt: float, steps: float, method: str, damped: bool = True) -> bool:
    """Whether so many steps of dt [s] make motion grow that rests, or one step motion that passes.

    It is asked of motion that is ``damped`` or else of any.
    """
    direction = -GROWTH_PER_RADIAN if damped else UNDAMPED
    formula = find_method(method)
    if isinstance(formula, ImplicitRungeKutta) or dt == 0.0:
        return False
    for values, growth in zip(modes(scene), (PASSING / max(steps, 1.0), PASSING), strict=True):
        decaying = values[values.real <= direction * np.abs(values)]
        if amplifies(formula, dt * decaying, 1.0 + growth).any():
            return True
    return False


#: Relative error of the impulse that a step may make.
TOLERATED = 1e-2


def impulse_ratio(method: Method, x: ArrayLike) -> Floats:
    """Impulse by the method over the true one, for x = h alpha > 0, of a run that starts with the force.

    F0 exp(-alpha t) gives F0/alpha in all. A method sees the force at its nodes only; where it decays within
    a step, almost nothing of that is the true impulse: RK4 at x = 1e4 takes the first node's share, h F0 / 6.
    """
    x = np.asarray(x, dtype=np.float64)

    def summed(weights: ArrayLike, times: ArrayLike) -> Floats:
        return np.asarray(np.exp(-np.multiply.outer(x, np.asarray(times))) @ np.asarray(weights))

    if isinstance(method, Adams):
        starter, taken = method.starter, method.start_steps
        weights, newest = (method.corrector, 1.0) if method.corrects else (method.predictor, 0.0)
        beyond = summed(weights, taken + (newest - np.arange(float(weights.size))))
    else:
        assert isinstance(method, RungeKutta | ImplicitRungeKutta)
        starter, taken = method.tableau, 0
        beyond = summed(starter.b, starter.c)
    first = summed(starter.b, starter.c)
    return np.asarray(x * (first * -np.expm1(-taken * x) + beyond) / -np.expm1(-x))


@cache
def impulse_limit(method: Method) -> float:
    """Largest h alpha up to which the impulse is right to :data:`TOLERATED`; every run asks for it."""
    return first_crossing(lambda x: np.abs(impulse_ratio(method, x) - 1.0) > TOLERATED, 1e-3, 1e3)
