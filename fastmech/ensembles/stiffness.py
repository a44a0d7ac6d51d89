"""Where an explicit method's stability, and not accuracy, would set the step.

A damper that acts on light bodies stops them at a rate far above the frequencies of the motion that remains.
An explicit method must then step with that rate although nothing moves so fast; an L-stable one need not
(Hairer, Wanner, *Solving ODEs II*, section IV.1).
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.fitting import QUICK, RUNGS, vibration_frequency
from fastmech.integrators.implicit_method import ImplicitRungeKutta
from fastmech.integrators.method import Method
from fastmech.integrators.methods import find_method
from fastmech.mechanism.coefficients import Coefficients
from fastmech.mechanism.reduced import slider_ratio
from fastmech.step_limits.amplification import amplifies
from fastmech.step_limits.crossing import first_crossing

Floats = NDArray[np.float64]

#: Directions of damped motion: from almost undamped to overdamped.
DIRECTIONS = np.exp(1j * np.linspace(0.5 * np.pi + 0.1, np.pi, 12))

#: Growth a step that rounding explains.
ROUNDED = 1e-11

#: Time of an implicit step of the mechanism in right-hand sides of an explicit one: its iterations with their
#: Jacobians and small linear systems. Measured for ``radau5`` at steps that suit 1e-4 to 1e-8.
IMPLICIT_STEP = 75

#: Why an explicit method was chosen whose step accuracy sets.
LEAST_WORK = "least work at this tolerance and these output times"

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


def work(method: Method, dt: float, outputs: Floats) -> float:
    """Cost of a trajectory that passes the outputs [s], in right-hand sides of an explicit method."""
    intervals = np.diff(outputs, prepend=0.0)
    steps = np.maximum(np.ceil(intervals[intervals > 0.0] / dt), 1.0)
    if isinstance(method, ImplicitRungeKutta):
        return float(steps.sum()) * IMPLICIT_STEP
    if method.start_steps == 0:
        return float(method.evaluations(1) * steps.sum())
    return float(sum(method.evaluations(int(number)) for number in steps))


def total_work(method: Method, dt: Floats, outputs: Floats, lanes: int = 1) -> float:
    """Cost of trajectories with steps ``dt`` (n,) [s], in right-hand sides as :func:`work`'s.

    Those of about equal steps run in common blocks and are counted in whole groups of so many ``lanes``.
    """
    dt = dt[np.isfinite(dt) & (dt > 0.0)]
    rungs, numbers = np.unique(np.rint(RUNGS * np.log2(dt)), return_counts=True)
    whole = -(-numbers // lanes) * lanes
    return sum(
        int(number) * work(method, float(length), outputs)
        for length, number in zip(np.exp2(rungs / RUNGS), whole, strict=True)
    )


def explicit_reason(
    method: Method,
    dt: float,
    share: float,
    rung: float,
    c: Coefficients | None,
    beside: tuple[str, float, float] | None,
) -> str:
    """Why an explicit method was chosen, in one line; where stability sets its step ``dt`` [s], that too.

    ``share`` is its error over the tolerance, ``rung`` the ratio of two steps that were compared, ``c`` a
    scene's coefficients. ``beside`` is the implicit method that was tried because stability sets the step:
    its name, its step [s] and its work over the explicit method's.
    """
    kept = f"least work, though stability keeps {method.name} to {dt:.2g} s"
    if beside is not None:
        name, step, ratio = beside
        return f"{kept}: accuracy allows {name} {step:.2g} s, at {ratio:.2g} times the work"
    allowed = dt * max(share, 1e-30) ** (-1.0 / method.order)
    # A rung was compared with one longer step: where that was beyond the limit, no error is known.
    if (
        c is None
        or share == 0.0
        or allowed <= rung * dt
        or rung**2 * dt < (1.0 - 1e-9) * explicit_limit(method, c)
    ):
        return LEAST_WORK
    return f"{kept}: accuracy would allow {allowed:.2g} s"
