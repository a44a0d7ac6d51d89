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

from fastmech.ensembles.fitting import QUICK, vibration_frequency
from fastmech.integrators.method import ImplicitRungeKutta, Method
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
