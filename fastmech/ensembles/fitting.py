"""Steps that fit: the faster a trajectory can become, the shorter its own fixed step.

Energy bounds a scene's motion before it starts. A trajectory slower than the linear vibrations of the
mechanism gains nothing from a longer step; a faster one needs a shorter one.

A damper that acts on light bodies stops them at a rate far above the frequencies of the motion that remains.
An explicit method must then step with that rate although nothing moves so fast; an L-stable one need not
(Hairer, Wanner, *Solving ODEs II*, section IV.1).
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any, NamedTuple, Protocol

import numpy as np

from fastmech.arrays import Flags, Floats, Integers
from fastmech.ensembles.lanes import finite_rows
from fastmech.integrators.methods import ImplicitRungeKutta, Method, find_method
from fastmech.step_limits.amplification import amplifies, first_crossing


class Bounds(Protocol):
    """What a scene knows of its motions before they begin; numbers are of all trajectories, or one of each.

    The first half of a state are angles, the other half their rates.
    """

    operations: float  #: of its equations, counted as in :mod:`fastmech.ensembles.work_precision`

    @property
    def frequency(self) -> Floats:
        """Scale [rad/s] of the vibrations' frequencies, never zero."""

    @property
    def damping(self) -> Floats:
        """Bound [1/s] on the rate at which dampers stop motion."""

    @property
    def fading(self) -> Floats:
        """Rate [1/s] at which a load decays, 0: none does."""

    @property
    def turn(self) -> Floats:
        """Bound on an angle's rate over the speed."""

    def speed(self, starts: Floats, threads: int | None = None) -> Floats:
        """Bound (n,) on a norm of the rates [rad/s] after starts (n, dim), for all time."""


class Moving(Protocol):
    """What scenes and mechanisms hand to the engine."""

    @property
    def inverse(self) -> Any:
        """Solves an implicit method's systems, see :data:`fastmech.jit.INVERSE_SIGNATURE`; None: nothing."""

    @property
    def bounds(self) -> Bounds | None:
        """What is known beforehand."""

    @property
    def rests(self) -> float:
        """Time [s] from which on :meth:`impossible` tells of states; inf: never."""

    def impossible(self, start: Floats, final: Floats, threads: int | None = 1) -> Flags:
        """Which motions (n,) have an energy that they cannot have.

        They come from states (n, dim) to others of that shape, or to several such (looks, n, dim).
        """

    def equations(self, formulation: str) -> tuple[Any, tuple[Floats, ...], Any]:
        """Block right-hand side, its parameters, each a number or one of each trajectory, and the system.

        The system is one that a user might have written. "lagrange" is of rates, "hamilton" of momenta.
        """

    def part(self, members: Integers) -> Moving:
        """That of some trajectories, where each has its own parameters."""

    def to_momenta(self, y: Floats) -> Floats:
        """Coordinates and momenta (..., n, dim) from coordinates and rates."""

    def to_rates(self, y: Floats) -> Floats:
        """The other way round."""


#: Share of energies by which a bound on them may be missed: far above errors of steps that resolve a motion.
SLACK = 1e-2

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
    bounds: Bounds,
    starts: Floats,
    dt: float | Floats,
    t_end: float,
    exponent: float,
    threads: int | None = None,
) -> Fitted:
    """Steps for the motions of states (n, dim) until ``t_end`` [s], and who gets none.

    ``dt`` [s], of all or of each (n,), belongs to motions as slow as the linear vibrations; others have it
    divided by (speed bound / vibration's frequency)^``exponent``, rounded up to a power of 2^(1/4). Step, and
    whether a start is set aside, depend on it, its parameters and the settings alone.
    """
    shares = bounds.speed(starts, threads)
    with np.errstate(invalid="ignore", over="ignore"):
        aside = np.asarray(~(shares * t_end <= MOST_ANGLE))
        shares /= bounds.frequency
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


def fading_load(bounds: Bounds, t_end: float) -> tuple[tuple[float, float], ...]:
    """Where a load decays far faster than vibrations: until when [s], and what share of the step.

    Until then steps are as short for the decay as they are for the vibrations later. Nothing where no load
    does so before ``t_end``.
    """
    slowest, rate = np.broadcast_arrays(np.atleast_1d(bounds.frequency), bounds.fading)
    quick = rate[rate > QUICK * slowest]
    if not quick.size or GONE / quick.min() >= t_end:
        return ()
    return ((GONE / float(quick.min()), float(np.min(slowest) / quick.max())),)


#: Directions of damped motion: from almost undamped to overdamped.
DIRECTIONS = np.exp(1j * np.linspace(0.5 * np.pi + 0.1, np.pi, 12))

#: Growth a step that rounding explains.
ROUNDED = 1e-11


@cache
def stability_radius(name: str) -> float:
    """Largest r such that damped modes with step times eigenvalue of size r die out; inf if implicit."""
    method = find_method(name)
    if isinstance(method, ImplicitRungeKutta):
        return math.inf
    return first_crossing(
        lambda r: np.any(amplifies(method, r[:, None] * DIRECTIONS, 1.0 + ROUNDED), axis=1), 1e-3, 1e3
    )


def initial_layer(bounds: Bounds, starts: Floats) -> tuple[tuple[float, float], ...]:
    """Times [s] until which steps are shorter, and by what share, where the damper stops motion at first.

    Starts that move lose the damped part of their motion at once. A step far longer than that takes them to
    the right slow motion, but not to its right place: an error that falls with the step only when the step
    is as short as the layer (Hairer, Wanner, *Solving ODEs II*, section VI.1). So steps grow with the time,
    from the layer's length to the vibrations'. Nothing where nothing moves, or no damping is that quick.
    """
    slow, rate = float(np.min(bounds.frequency)), float(np.max(bounds.damping))
    if not rate > QUICK * slow or not np.any(starts[:, starts.shape[1] // 2 :]):
        return ()
    doublings = np.arange(math.ceil(math.log2(2.0 * rate / slow)))
    return tuple((float(t), slow * float(t)) for t in 0.5 / rate * 2.0**doublings)


def explicit_limit(method: Method, bounds: Bounds) -> float:
    """Step [s] at which every mode of every trajectory is stable."""
    rate = np.maximum(bounds.damping, bounds.frequency)
    return stability_radius(method.name) / float(np.max(rate))
