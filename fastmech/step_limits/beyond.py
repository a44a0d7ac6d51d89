"""Which trajectories of a run have steps that cannot be right for them: what was warned of, one by one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fastmech.integrators.methods import find_method
from fastmech.scene import Scene
from fastmech.step_limits.amplification import amplification
from fastmech.step_limits.impulse import impulse_limit
from fastmech.step_limits.predict import UNDAMPED
from fastmech.step_limits.warning import TURN, beyond_stability, local_eigenvalues, step_limit

Floats = NDArray[np.float64]

#: Scenes looked at, at most, and digits of their parameters: fewer where the scenes would be more.
MOST, DIGITS = 500, (3, 2, 1)


def is_beyond(scene: Scene, dt: float, method: str) -> bool:
    """Whether a step [s] makes damped motion grow, and a shorter one would not.

    Without damper the energy of each motion tells whether it has grown, which is the better judge; and where
    every step makes motion grow, as Euler's with a mode that no damper reaches, no step is too long.

    Raises:
        InputError: no such method.
    """
    if scene.beta == 0.0 or dt == 0.0 or not beyond_stability(scene, dt, method):
        return False
    return step_limit(scene, method) > 0.0


def steps_beyond(
    scene: Scene,
    extremes: Sequence[Scene],
    own: Mapping[str, Floats],
    starts: Floats,
    ends: Floats,
    first: Floats,
    longest: Floats,
    method: str,
) -> NDArray[np.bool_]:
    """Which trajectories (n,) have a step beyond a limit: of stability, of the impulse, of the angle turned.

    Args:
        scene: the mechanism.
        extremes: scenes with the extreme values of what differs between trajectories. Where the longest step
            is stable for these, it is for all.
        own: values (n,) of parameters that differ between trajectories.
        starts: states (n, 4).
        ends: last finite states (n, 4). A step that is too long for places where a motion never is does it no
            harm: it must be so at the start or where the motion has come to.
        first: step of each [s] at the start, where the force is great and the start's rates count, (n,).
        longest: longest step of each [s], (n,).
        method: a name from :data:`fastmech.integrators.methods.METHODS`.

    Raises:
        InputError: no such method.
    """
    beyond = _turns_too_far(starts[:, 2:], first)
    alpha = np.asarray(own.get("alpha", scene.alpha), dtype=np.float64)
    acts = np.asarray(own.get("F0", scene.F0), dtype=np.float64) != 0.0
    beyond |= acts & (first * alpha > impulse_limit(find_method(method)))
    if not any(is_beyond(each, float(longest.max(initial=0.0)), method) for each in extremes):
        return beyond
    rows, which = _distinct(longest, own)
    for row, (dt, *values) in enumerate(rows.tolist()):
        each = scene.replace(**dict(zip(own, values, strict=True)))
        if is_beyond(each, dt, method):
            members = np.flatnonzero(which == row)
            beyond[members] |= _grows_there(each, dt, method, starts[members])
            beyond[members] |= _grows_there(each, dt, method, ends[members])
    return beyond


def _grows_there(scene: Scene, dt: float, method: str, states: Floats) -> NDArray[np.bool_]:
    """Whether damped small motion about each configuration (n,) grows, with the force or without."""
    finite = np.isfinite(states).all(axis=1)
    phi, theta = states[finite, :2].T
    grows = np.zeros(len(states), dtype=np.bool_)
    for force in {scene.F0, scene.F0 if scene.alpha == 0.0 else 0.0}:
        values = local_eigenvalues(scene, force, phi, theta)
        decays = values.real < -UNDAMPED * np.abs(values)
        grows[finite] |= (decays & (amplification(find_method(method), dt * values) > 1.0)).any(axis=1)
    return grows


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


def _distinct(longest: Floats, own: Mapping[str, Floats]) -> tuple[Floats, NDArray[np.intp]]:
    """Step and parameters, rounded, of scenes that differ, and which of them each trajectory has."""
    values = np.stack([longest, *own.values()], axis=1)
    with np.errstate(divide="ignore"):
        last = np.where(values == 0.0, 0.0, np.floor(np.log10(np.abs(values))))
    for digits in DIGITS:
        unit = 10.0 ** (last - digits + 1)
        rounded = np.round(values / unit) * unit
        rounded[:, 0] = longest
        rows, which = np.unique(rounded, axis=0, return_inverse=True)
        if len(rows) <= MOST:
            break
    return rows, which.reshape(-1)
