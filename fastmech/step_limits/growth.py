"""Which trajectories' small motion grows in the steps taken there though it should die out."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from fastmech.integrators.implicit_method import ImplicitRungeKutta
from fastmech.integrators.method import Adams, Method, RungeKutta
from fastmech.integrators.methods import find_method
from fastmech.kernels.passes import columns
from fastmech.mechanism.coefficients import Coefficients
from fastmech.step_limits.amplification import stability_polynomial
from fastmech.step_limits.limits import (
    ALLOWED,
    CERTAIN,
    GROWS,
    INNOCENT,
    ROUNDED,
    SPURIOUS,
    UNSURE,
    steps_there,
)
from fastmech.step_limits.local import eigenvalue_bound, eigenvalues, local_motion, part, state_matrices
from fastmech.step_limits.predict import GROWTH_PER_RADIAN
from fastmech.step_limits.region import region, size_within
from fastmech.step_limits.verdicts import judge_modes, judge_states

Floats = NDArray[np.float64]
Numbers = NDArray[np.float64] | NDArray[np.int64]

#: Steps of a run that are told apart: a year's are fewer.
MOST_STEPS = 2.0**44


def counted(number: Numbers) -> Floats:
    """Numbers of steps as they count."""
    return np.clip(number.astype(np.float64), 1.0, MOST_STEPS)


def mark_growing(
    method: Method,
    c: Coefficients,
    states: Floats,
    dt: Floats,
    number: Numbers,
    verdicts: NDArray[np.int8],
) -> None:
    """Mark those whose damped small motion about a state (n, 4) grows over the steps of dt [s] taken there.

    Of an Adams method's roots only the mode's own counts.

    Args:
        method: how the steps are taken.
        c: reduced coefficients, numbers or one a trajectory.
        states: where.
        dt: step of each [s], (n,).
        number: steps of each in all, (n,).
        verdicts: those of :mod:`fastmech.step_limits.limits`, (n,); who is not innocent stays so.
    """
    if isinstance(method, ImplicitRungeKutta) or not np.any(c.damping) or not len(states):
        return
    number = counted(number)
    _judged(method, c, states, dt, number, np.inf, False, verdicts)
    _settle(method, c, states, dt, number, np.inf, verdicts)


def stiffest_growing(
    method: Method, c: Coefficients, states: Floats, dt: float, number: float
) -> tuple[int | None, bool]:
    """Of the motions that :func:`mark_growing` marks, the one whose eigenvalues' bound is greatest.

    All take so many steps of dt [s]. Here an Adams method's errors count too, from a growth by
    :data:`fastmech.step_limits.limits.SPURIOUS` in all steps.

    Returns:
        its place, ``None`` if there is none; and whether all are acquitted by the size of h lambda alone,
        which tells of shorter steps too if there are no more of them, a part of one apart.
    """
    if isinstance(method, ImplicitRungeKutta) or not np.any(c.damping) or not len(states):
        return None, True
    verdicts = np.zeros(len(states), dtype=np.int8)
    steps = counted(np.array([number]))
    place, closer = _judged(method, c, states, np.array([dt]), steps, SPURIOUS, True, verdicts)
    unsure = np.flatnonzero(verdicts == UNSURE)
    if unsure.size:
        each = np.full(len(states), dt), np.full(len(states), steps[0])
        _settle(method, c, states, *each, SPURIOUS, verdicts)
        unsure = unsure[verdicts[unsure] == GROWS]
    found = np.append(unsure, place) if place >= 0 else unsure
    if not found.size:
        return None, not closer
    bounds = eigenvalue_bound(local_motion(part(c, found), states[found]))
    return int(found[bounds == bounds.max()].min()), False


def _judged(
    method: Method,
    c: Coefficients,
    states: Floats,
    dt: Floats,
    number: Floats,
    spurious: float,
    stiffest: bool,
    verdicts: NDArray[np.int8],
) -> tuple[int, int]:
    """What :func:`fastmech.step_limits.verdicts.judge_states` gives."""
    table = region(method.name)
    most = np.ceil(float(number.max())) * (1.0 + ROUNDED)
    place, closer = judge_states(
        np.ascontiguousarray(states, dtype=np.float64),
        columns(c, slice(0, len(states))),
        np.ascontiguousarray(dt),
        number,
        *_formula(method.name),
        *table,
        size_within(table.largest, CERTAIN * ALLOWED / most),
        spurious,
        stiffest,
        verdicts,
    )
    return place, closer


@cache
def _formula(name: str) -> tuple[Floats, Floats, Floats]:
    """R's coefficients of a Runge-Kutta method, predictor and corrector of an Adams method; else empty."""
    method, none = find_method(name), np.zeros(0)
    if isinstance(method, Adams):
        return none, method.predictor, method.corrector
    assert isinstance(method, RungeKutta)
    return stability_polynomial(method), none, none


def _settle(
    method: Method,
    c: Coefficients,
    states: Floats,
    dt: Floats,
    number: Floats,
    spurious: float,
    verdicts: NDArray[np.int8],
) -> None:
    """Judge those of which the pass was unsure, with LAPACK's eigenvalues."""
    unsure = np.flatnonzero(verdicts == UNSURE)
    if not unsure.size:
        return
    own, at = part(c, unsure), states[unsure]
    values = eigenvalues(state_matrices(own, *at[:, :2].T)).ravel()
    which = np.repeat(np.arange(unsure.size), 4)
    decays = (values.real < -GROWTH_PER_RADIAN * np.abs(values)) & (values.imag >= 0.0)
    values, which = values[decays], which[decays]
    there = steps_there(local_motion(own, at).time, dt[unsure], number[unsure])[which]
    z = dt[unsure][which] * values
    grow = np.empty(z.size, dtype=np.bool_)
    judge_modes(
        z.real.copy(), z.imag.copy(), there, number[unsure][which], *_formula(method.name), spurious, grow
    )
    verdicts[unsure] = INNOCENT
    verdicts[unsure[which[grow]]] = GROWS
