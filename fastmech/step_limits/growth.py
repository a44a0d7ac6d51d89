"""Which trajectories' small motion grows in the steps taken there though it should die out.

Most are acquitted by a bound on their growth: by the size of h lambda, else by the method's table of
:mod:`fastmech.step_limits.region`. The others' modes are judged by the method's own polynomials.
"""

from __future__ import annotations

from importlib import import_module
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.integrators.implicit_method import ImplicitRungeKutta
from fastmech.integrators.method import Adams, Method
from fastmech.kernels.passes import columns
from fastmech.mechanism.coefficients import Coefficients
from fastmech.step_limits.amplification import amplifies, principal_root
from fastmech.step_limits.local import LocalMotion, eigenvalue_bound, local_motion, part
from fastmech.step_limits.modes import decaying_modes, factored
from fastmech.step_limits.predict import GROWTH_PER_RADIAN
from fastmech.step_limits.region import region, rows_of, sectors_of
from fastmech.step_limits.warning import PASSING

Floats = NDArray[np.float64]
Numbers = NDArray[np.float64] | NDArray[np.int64]

#: Growth of an Adams method's errors in a run that counts: those of its starter are far above rounding.
SPURIOUS = 1e4

#: Trajectories judged at once: what is computed on the way stays in the caches.
AT_ONCE = 2**12

#: Steps of a run that are told apart: a year's are fewer.
MOST_STEPS = 2.0**44

#: Share of a growth that is let pass up to which a bound acquits: the rest is for what a table misses between
#: its places.
CERTAIN = 0.8


class Growth(NamedTuple):
    """What small motion does at most, at some states (n,)."""

    most: Floats  #: logarithm of a decaying mode's growth in a step of the length looked at or a shorter one
    time: Floats  #: time [s] spent there, or inf


def steps_there(time: Floats, dt: Floats, number: Numbers) -> Floats:
    """Steps (n,) of dt [s] that are taken in a time [s], at least one, at most those of the run."""
    most = np.clip(number.astype(np.float64), 1.0, MOST_STEPS)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        return np.minimum(np.maximum(time / dt, 1.0), most)


def acquitted(growth: Growth, dt: Floats, number: Numbers) -> NDArray[np.bool_]:
    """Which motions (n,) surely do not grow by 1 % in the steps there, of dt [s] or less."""
    return np.asarray(growth.most * steps_there(growth.time, dt, number) <= CERTAIN * np.log1p(PASSING))


def bounded(method: Method, c: Coefficients, states: Floats, dt: Floats, number: Numbers) -> Growth:
    """Bounds of the growth at states (n, 4) in steps of dt [s], of which so many are taken in all.

    A motion that is acquitted by the size of h lambda alone is looked at no closer.
    """
    n = len(states)
    growth = Growth(np.zeros(n), np.full(n, np.inf))
    if isinstance(method, ImplicitRungeKutta) or not np.any(c.damping):
        return growth
    bounds = import_module("fastmech.step_limits.bounds")  # a kernel that quiet steps do not need
    states = np.ascontiguousarray(states, dtype=np.float64)
    table, size = region(method.name), np.empty(min(n, AT_ONCE))
    for first in range(0, n, AT_ONCE):
        block = slice(first, min(first + AT_ONCE, n))
        of, there = size[: block.stop - first], Growth(*(values[block] for values in growth))
        with np.errstate(invalid="ignore", over="ignore"):  # what is not finite has a status of its own
            bounds.eigenvalue_bounds(states[block], columns(c, block), of)
        asked = np.isfinite(of) & (np.asarray(c.damping)[block] > 0.0)
        there.most[:] = np.where(asked, table.largest[rows_of(dt[block] * of)], 0.0)
        some = first + np.flatnonzero(~acquitted(there, dt[block], number[block]))
        if some.size:
            motion = local_motion(part(c, some), states[some])
            growth.most[some], growth.time[some] = _bounded(method, motion, dt[some])
    return growth


def _bounded(method: Method, motion: LocalMotion, step: Floats) -> Growth:
    """Bounds by the table's sectors, in steps [s]."""
    table = region(method.name)
    factors = factored(motion)
    most = np.zeros(step.size)
    with np.errstate(invalid="ignore", over="ignore"):
        for slope, offset in ((factors.a, factors.b), (factors.c, factors.d)):
            # Of real modes the faster: the table's bounds are those of smaller ones too.
            middle, square = -0.5 * slope, 0.25 * slope * slope - offset
            root, pair = np.sqrt(np.abs(square)), square < 0.0
            real, imaginary = np.where(pair, middle, middle - root), np.where(pair, root, 0.0)
            size = np.where(pair, np.sqrt(np.abs(offset)), np.abs(real))
            worst = table.sector[rows_of(step * size), sectors_of(real, imaginary)]
            # Half, as the factors are not exact.
            most = np.maximum(most, np.where(real < -0.5 * GROWTH_PER_RADIAN * size, worst, 0.0))
    return Growth(np.where(factors.found, most, np.inf), motion.time)


def growing(
    method: Method,
    c: Coefficients,
    states: Floats,
    dt: Floats,
    number: Numbers,
    known: Growth | None = None,
) -> NDArray[np.bool_]:
    """Whether damped small motion about each state (n, 4) grows by 1 % over the steps of dt [s] taken there.

    ``known`` are bounds of the growth at these states in steps of that length or longer ones.
    """
    grows = np.zeros(len(states), dtype=np.bool_)
    if known is not None:  # bounds for longer steps are less good than those for the steps taken
        some = np.flatnonzero(~acquitted(known, dt, number))
        if some.size:
            grows[some] = growing(method, part(c, some), states[some], dt[some], number[some])
        return grows
    rest = np.flatnonzero(~acquitted(bounded(method, c, states, dt, number), dt, number))
    for first in range(0, rest.size, AT_ONCE):
        some = rest[first : first + AT_ONCE]
        grows[some] = _grow(method, part(c, some), states[some], dt[some], number[some])
    return grows


def stiffest_growing(
    method: Method, c: Coefficients, states: Floats, dt: Floats, number: Numbers, known: Growth
) -> int | None:
    """Of the motions that :func:`growing` tells of, if any, the one whose eigenvalues' bound is greatest.

    ``known`` are the bounds of the growth in these steps.
    """
    rest = np.flatnonzero(~acquitted(known, dt, number))
    rest = rest[np.argsort(-eigenvalue_bound(local_motion(part(c, rest), states[rest])), kind="stable")]
    first, after = 0, 256  # most often it is one of the first
    while first < rest.size:
        some = rest[first:after]
        grows = _grow(method, part(c, some), states[some], dt[some], number[some])
        if grows.any():
            return int(some[np.argmax(grows)])
        first, after = after, after + AT_ONCE
    return None


def _grow(method: Method, c: Coefficients, states: Floats, dt: Floats, number: Numbers) -> NDArray[np.bool_]:
    """What :func:`growing` tells, without bounds.

    A mode grows by more than is let pass in the steps there, or errors do in all.
    """
    table, motion = region(method.name), local_motion(c, states)
    there = steps_there(motion.time, dt, number)

    def suspect(lane: NDArray[np.int64], values: NDArray[np.complex128]) -> NDArray[np.bool_]:
        place = rows_of(dt[lane] * np.abs(values)), sectors_of(values.real, values.imag)
        return np.asarray(table.sector[place] * there[lane] > CERTAIN * np.log1p(PASSING))

    lane, values = decaying_modes(c, states, motion, GROWTH_PER_RADIAN, suspect)
    z, factor = dt[lane] * values, (1.0 + PASSING) ** (1.0 / there[lane])
    grow = amplifies(method, z, factor)
    if isinstance(method, Adams) and grow.any():
        # Of what is amplified: errors in all steps, else the mode itself.
        some = np.flatnonzero(grow)
        most = np.clip(number[lane[some]].astype(np.float64), 1.0, MOST_STEPS)
        grow[some] = amplifies(method, z[some], SPURIOUS ** (1.0 / most))
        some = some[~grow[some]]
        if some.size:
            grow[some] = np.abs(principal_root(method, z[some])) > factor[some]
    grows = np.zeros(len(states), dtype=np.bool_)
    grows[lane[grow]] = True
    return grows
