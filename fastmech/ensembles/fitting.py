"""Steps that fit: the faster a trajectory can become, the shorter its own fixed step.

Energy bounds the motion before it starts: with a constant force T + U never grows, and a decaying force adds
at most its greatest work. Half the square of the rates' kinetic-energy norm is T over m2 l^2, so no rate of
that norm can exceed sqrt(2 (E - U_min)). A trajectory slower than the linear vibrations of the mechanism
gains nothing from a longer step; a faster one needs a shorter one.

A damper that acts on light bodies stops them at a rate far above the frequencies of the motion that remains.
An explicit method must then step with that rate although nothing moves so fast; an L-stable one need not
(Hairer, Wanner, *Solving ODEs II*, section IV.1).

Energy bounds that no motion of a scene breaks, only too large a step; told in compiled passes over lanes.
Under a constant force T + U never grows, and without damper it is conserved; under a decaying force T + Pi
grows by at most F0 (2 l - sgn(F0) x2), the work done if M2 went to the far end of its reach at full force,
and without damper falls by at most F0 (2 l + sgn(F0) x2).

A pass goes through :data:`LANES` trajectories at a time, the last time through copies of the last one too:
loops that always have that length are packed instructions for all of them, so a trajectory's numbers depend
neither on its place nor on its companions.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import types

from fastmech.arrays import Flags, Floats
from fastmech.ensembles.lanes import finite_rows
from fastmech.ensembles.threads import in_parts
from fastmech.integrators.methods import ImplicitRungeKutta, Method, find_method
from fastmech.jit import MATRIX, kernel
from fastmech.kernels.sincos import REDUCTION_LIMIT, sincos
from fastmech.slider.coefficients import Coefficients
from fastmech.slider.reduced import kinetic, metric_11, potential, slider_ratio
from fastmech.step_limits.amplification import amplifies, first_crossing

#: States (n, 4), which a user may have locked.
STATES = types.Array(types.float64, 2, "C", readonly=True)

#: Trajectories that are in the caches together; whole vectors of any processor.
LANES = 64

#: Share of the energy's scale by which a bound may be missed: integration errors are far below it as long as
#: the step resolves the motion.
SLACK = 1e-2


@kernel(types.void(STATES, MATRIX, MATRIX))
def tell_energies(states: Floats, own: Floats, told: Floats) -> None:
    """:func:`energies` of states (n, 4) with coefficients ``own`` (8, n), or (8, 1) where all share them."""
    n, shared = states.shape[0], own.shape[1] == 1
    Y, p, found = np.empty((8, LANES)), np.empty((8, LANES)), np.empty((4, LANES))
    for first in range(0, n, LANES):
        for i in range(LANES):
            row = min(first + i, n - 1)
            for d in range(4):
                Y[d, i] = states[row, d]
            for k in range(8):
                p[k, i] = own[k, 0 if shared else row]
        for angle in range(2):
            beyond = 0
            for i in range(LANES):
                beyond |= abs(Y[angle, i]) > REDUCTION_LIMIT
                Y[4 + 2 * angle, i], Y[5 + 2 * angle, i] = sincos(Y[angle, i])
            if beyond:
                for i in range(LANES):
                    if abs(Y[angle, i]) > REDUCTION_LIMIT:
                        Y[4 + 2 * angle, i], Y[5 + 2 * angle, i] = np.sin(Y[angle, i]), np.cos(Y[angle, i])
        for i in range(LANES):
            s1, c1, s2, c2 = Y[4, i], Y[5, i], Y[6, i], Y[7, i]
            s12, force = s1 * c2 + c1 * s2, p[5, i]
            constant = force if p[7, i] == 0.0 else 0.0
            T = kinetic(metric_11(p[0, i], p[1, i], slider_ratio(s1, c1)[0]), s12, Y[2, i], Y[3, i])
            u = potential((s1, c1, s2, c2), s12, (p[2, i], p[3, i], p[4, i]), constant)
            most, way = abs(force - constant), 2.0 - (c1 - s2 if force > 0.0 else s2 - c1)
            found[0, i], found[1, i], found[2, i] = T + u, most * way, most * (4.0 - way)
            found[3, i] = T + abs(p[2, i]) + p[4, i] + p[3, i] + 2.0 * abs(force)
        for i in range(min(LANES, n - first)):
            for k in range(4):
                told[k, first + i] = found[k, i]


def energies(c: Coefficients, states: Floats, members: slice = slice(None)) -> Floats:
    """T + U of states (n, 4), of all or of some, and what it may become; over m2 l^2 [1/s^2], shape (4, n).

    A row each: T + U with U = Pi - F x2 of a constant force and Pi of one that decays; the most that a
    decaying force can add to it; the most that it can take; the scale to compare it with, the sum of its
    terms. ``c`` are reduced coefficients, numbers or one a trajectory.
    """
    values: Any = [np.asarray(value) for value in c]
    some = np.ascontiguousarray(states[members], dtype=np.float64)
    if any(value.ndim and value.strides[0] for value in values):
        own = np.empty((len(values), len(some)))
        for row, value in zip(own, values, strict=True):
            row[:] = value[members] if value.ndim else value
    else:
        own = np.array([value.flat[0] for value in values], dtype=np.float64)[:, None]
    told = np.empty((4, len(some)))
    tell_energies(some, own, told)
    return told


def breaks_energy_bounds(c: Coefficients, start: Floats, final: Floats, threads: int | None = 1) -> Flags:
    """Which trajectories from states (n, 4) end in states with an energy that they cannot have (n,)."""
    broken, damped = np.empty(len(start), dtype=np.bool_), np.broadcast_to(c.damping, len(start)) != 0.0

    def tell(part: slice) -> None:
        (before, gain, fall, scale), after = energies(c, start, part), energies(c, final, part)[0]
        # An energy beyond a double's range is none that a motion can have.
        broken[part] = ~np.isfinite(after) | (after - before - gain > SLACK * scale)
        broken[part] |= ~damped[part] & (before - after - fall > SLACK * scale)

    in_parts(tell, len(start), threads)
    return broken


#: How the step shrinks with the bound on the speed: where it is fitted once, and where it is fitted again as
#: the motion slows down. The local error alone asks for 1; fast trajectories also pass saddles, which magnify
#: their errors. Measured on ensembles from rest and with rates up to 10 rad/s.
EXPONENT_ONCE, EXPONENT_AGAIN = 1.0, 1.5

#: A force that decays by a factor e in this time over the vibrations' is a motion of its own.
QUICK = 3.0

#: Decay times after which a force is gone: exp(-40) is less than a double's rounding.
GONE = 40.0

#: Angle [rad] that a motion may turn through, by its bound on the speed, for steps to be fitted to it: with
#: more its angles' rounding would show.
MOST_ANGLE = 2.0**28

#: Steps that a motion may take by itself: so many, or so many times those of slow motion where that is more.
#: Doubles could follow more, but one trajectory has a vector of lanes to itself: these are 2 s of a core with
#: a cheap method and 20 s with an expensive one, for which all others wait.
MOST_FITTED, MOST_TIMES = 2.0**24, 2.0**8

#: Steps beyond which not even slow motion is worth its wait: of longer runs nothing is set aside.
MOST_ASKED = 2.0**30

#: Steps of a factor 2 between the longest and the next: trajectories of equal step run in common blocks.
RUNGS = 4


class Fitted(NamedTuple):
    """Steps fitted to motions."""

    shares: Floats  #: what part of the longest step each takes, (n,)
    aside: Flags  #: finite starts to whose motions no steps can be fitted, (n,)


def fit_steps(
    c: Coefficients,
    starts: Floats,
    dt: float | Floats,
    t_end: float,
    exponent: float,
    threads: int | None = None,
) -> Fitted:
    """Steps for the motions of states (n, 4) until ``t_end`` [s], and who gets none.

    ``dt`` [s], of all or of each (n,), belongs to motions as slow as the linear vibrations; others have it
    divided by (speed bound / vibration's frequency)^``exponent``, rounded up to a power of 2^(1/4). Step, and
    whether a start is set aside, depend on it, its parameters and the settings alone.
    """
    shares = speed_bound(c, starts, threads)
    with np.errstate(invalid="ignore", over="ignore"):
        aside = np.asarray(~(shares * t_end <= MOST_ANGLE))
        shares /= vibration_frequency(c)
        np.log2(np.maximum(shares, 1.0, out=shares), out=shares)
        shares *= RUNGS * exponent
        shares -= 1e-9
        np.ceil(shares, out=shares)
    shares[~np.isfinite(shares)] = 0.0
    shares /= -RUNGS
    np.exp2(shares, out=shares)
    asked = t_end / np.asarray(dt, dtype=np.float64)
    most = np.minimum(np.maximum(MOST_FITTED, MOST_TIMES * asked), MOST_ASKED)
    aside |= (shares * most < asked) & (asked <= MOST_ASKED)
    return Fitted(shares, aside & finite_rows(starts))


def speed_bound(c: Coefficients, starts: Floats, threads: int | None = None) -> Floats:
    """Bound (n,) on the kinetic-energy norm of the rates, sqrt(2 T / (m2 l^2)) [rad/s], for all time."""
    highest = np.empty(len(starts))  # T + U to which a motion can come

    def tell(part: slice) -> None:
        total, gain, _, _ = energies(c, starts, part)
        np.add(total, gain, out=highest[part])

    in_parts(tell, len(starts), threads)
    force = np.where(np.asarray(c.decay) == 0.0, c.force, 0.0)
    # U = lift sin phi - force cos phi + force sin theta - gravity cos theta - spring sin(phi + theta)
    lowest = -np.hypot(c.lift, force) - np.hypot(c.gravity, force) - np.abs(c.spring)
    with np.errstate(invalid="ignore", over="ignore"):
        highest -= lowest
        np.maximum(highest, 0.0, out=highest)
        highest *= 2.0
    return np.sqrt(highest, out=highest)


def vibration_frequency(c: Coefficients) -> Floats:
    """Scale [rad/s] of the linear vibrations' frequencies, never zero: curvatures of U over their inertia."""
    phi = (np.hypot(c.lift, c.force) + np.abs(c.spring)) / (c.mass + 1.0)
    theta = np.hypot(c.gravity, c.force) + np.abs(c.spring)
    return np.asarray(np.sqrt(np.maximum(np.maximum(phi, theta), np.finfo(np.float64).tiny)))


def fading_force(c: Coefficients, t_end: float) -> tuple[tuple[float, float], ...]:
    """Where a force decays far faster than vibrations: until when [s], and what share of the step.

    Until then steps are as short for the decay as they are for the vibrations later. Nothing where no force
    does so before ``t_end``.
    """
    slowest, rate = vibration_frequency(c), np.where(np.asarray(c.force) != 0.0, c.decay, 0.0)
    quick = rate[rate > QUICK * slowest] if np.ndim(rate) else rate[None][rate > QUICK * np.max(slowest)]
    if not quick.size or GONE / quick.min() >= t_end:
        return ()
    return ((GONE / float(quick.min()), float(np.min(slowest) / quick.max())),)


#: Directions of damped motion: from almost undamped to overdamped.
DIRECTIONS = np.exp(1j * np.linspace(0.5 * np.pi + 0.1, np.pi, 12))

#: Growth a step that rounding explains.
ROUNDED = 1e-11

_PHI = np.linspace(0.0, np.pi, 1001)

#: Largest square of the slider's speed over the crank's, in units of l.
_SLIDER_RATIO = float(np.max(np.asarray(slider_ratio(np.sin(_PHI), np.cos(_PHI))[0]) ** 2))


@cache
def stability_radius(name: str) -> float:
    """Largest r such that damped modes with step times eigenvalue of size r die out; inf if implicit."""
    method = find_method(name)
    if isinstance(method, ImplicitRungeKutta):
        return math.inf
    return first_crossing(
        lambda r: np.any(amplifies(method, r[:, None] * DIRECTIONS, 1.0 + ROUNDED), axis=1), 1e-3, 1e3
    )


def damping_rate(c: Coefficients) -> Floats:
    """Bound [1/s] on the rate at which the damper stops motion, over all configurations; 0 without damper."""
    square = _SLIDER_RATIO
    return np.asarray(c.damping * square / (c.mass + c.slider * square))


def initial_layer(c: Coefficients, starts: Floats) -> tuple[tuple[float, float], ...]:
    """Times [s] until which steps are shorter, and by what share, where the damper stops motion at first.

    Starts that move lose the damped part of their motion at once. A step far longer than that takes them to
    the right slow motion, but not to its right place: an error that falls with the step only when the step
    is as short as the layer (Hairer, Wanner, *Solving ODEs II*, section VI.1). So steps grow with the time,
    from the layer's length to the vibrations'. Nothing where nothing moves, or no damping is that quick.
    """
    slow, rate = float(np.min(vibration_frequency(c))), float(np.max(damping_rate(c)))
    if not rate > QUICK * slow or not np.any(starts[:, 2:]):
        return ()
    doublings = np.arange(math.ceil(math.log2(2.0 * rate / slow)))
    return tuple((float(t), slow * float(t)) for t in 0.5 / rate * 2.0**doublings)


def explicit_limit(method: Method, c: Coefficients) -> float:
    """Step [s] at which every mode of every trajectory is stable."""
    rate = np.maximum(damping_rate(c), vibration_frequency(c))
    return stability_radius(method.name) / float(np.max(rate))
