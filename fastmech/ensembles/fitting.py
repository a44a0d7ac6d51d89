"""Steps that fit: the faster a trajectory can become, the shorter its own fixed step.

Energy bounds the motion before it starts: with a constant force T + U never grows, and a decaying force adds
at most its greatest work. Half the square of the rates' kinetic-energy norm is T over m2 l^2, so no rate of
that norm can exceed sqrt(2 (E - U_min)). A trajectory slower than the linear vibrations of the mechanism
gains nothing from a longer step; a faster one needs a shorter one.

A damper that acts on light bodies stops them at a rate far above the frequencies of the motion that remains.
An explicit method must then step with that rate although nothing moves so fast; an L-stable one need not
(Hairer, Wanner, *Solving ODEs II*, section IV.1).
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.energy_bounds import highest_energies
from fastmech.ensembles.lanes import finite_rows
from fastmech.integrators.method import ImplicitRungeKutta, Method
from fastmech.integrators.methods import find_method
from fastmech.mechanism.coefficients import Coefficients
from fastmech.mechanism.reduced import slider_ratio
from fastmech.step_limits.amplification import amplifies, first_crossing

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

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


def fitted_steps(
    c: Coefficients, starts: Floats, dt: float, exponent: float, threads: int | None = None
) -> Floats:
    """The step [s] of every trajectory, shape (n,), at most ``dt``, from states (n, 4).

    ``dt`` belongs to motions as slow as the linear vibrations; the others have it divided by
    (speed bound / vibration's frequency)^``exponent``, rounded up to a power of 2^(1/4). A trajectory's step
    depends on its own start and parameters alone.
    """
    return dt * _shares(c, speed_bound(c, starts, threads), exponent)


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
    """Steps for the motions of states (n, 4) until ``t_end`` [s], as :func:`fitted_steps`, and who gets none.

    ``dt`` [s] is the longest step of all or of each (n,). Whether a start is set aside depends on it and on
    the settings alone.
    """
    bound = speed_bound(c, starts, threads)
    with np.errstate(invalid="ignore", over="ignore"):
        aside = np.asarray(~(bound * t_end <= MOST_ANGLE))
    shares = _shares(c, bound, exponent)
    asked = t_end / np.asarray(dt, dtype=np.float64)
    most = np.minimum(np.maximum(MOST_FITTED, MOST_TIMES * asked), MOST_ASKED)
    aside |= (shares * most < asked) & (asked <= MOST_ASKED)
    return Fitted(shares, aside & finite_rows(starts))


def _shares(c: Coefficients, bound: Floats, exponent: float) -> Floats:
    """The part of the longest step that motions of these speed bounds take, in the place of the bounds."""
    shares = bound
    with np.errstate(invalid="ignore", over="ignore"):
        shares /= vibration_frequency(c)
        np.log2(np.maximum(shares, 1.0, out=shares), out=shares)
        shares *= RUNGS * exponent
        shares -= 1e-9
        np.ceil(shares, out=shares)
    shares[~np.isfinite(shares)] = 0.0
    shares /= -RUNGS
    return np.exp2(shares, out=shares)


def speed_bound(c: Coefficients, starts: Floats, threads: int | None = None) -> Floats:
    """Bound (n,) on the kinetic-energy norm of the rates, sqrt(2 T / (m2 l^2)) [rad/s], for all time."""
    highest = highest_energies(c, starts, threads)
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
