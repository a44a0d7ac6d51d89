"""What a method makes of the impulse of a force that decays: F0 exp(-alpha t) gives F0/alpha in all.

A method sees the force at its nodes only. Where it decays within a step, almost nothing of that is the true
impulse: RK4 at h alpha = 1e4 takes the first node's share, h F0 / 6.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.integrators.method import Adams, ImplicitRungeKutta, Method, RungeKutta
from fastmech.integrators.methods import METHODS
from fastmech.step_limits.crossing import first_crossing

Floats = NDArray[np.float64]

#: Relative error of the impulse that a step may make.
TOLERATED = 1e-2


def impulse_ratio(method: Method, x: float) -> float:
    """Impulse by the method over the true one, for x = h alpha > 0, of a run that starts with the force."""
    return float(_ratios(method, np.array([x]))[0])


def _ratios(method: Method, x: Floats) -> Floats:
    """The same for many x (m,)."""

    def summed(weights: ArrayLike, times: ArrayLike) -> Floats:
        return np.asarray(np.exp(-np.multiply.outer(x, np.asarray(times))) @ np.asarray(weights))

    if isinstance(method, Adams):
        starter, taken = method.starter, method.start_steps
        ages = np.arange(float(method.predictor.size))
        if method.corrects:
            weights, times = method.corrector, 1.0 - np.arange(float(method.corrector.size))
        else:
            weights, times = method.predictor, -ages
        beyond = summed(weights, taken + times)
    else:
        assert isinstance(method, RungeKutta | ImplicitRungeKutta)
        starter, taken = method.tableau, 0
        beyond = summed(starter.b, starter.c)
    first = summed(starter.b, starter.c)
    share = -np.expm1(-x)
    return np.asarray(x * (first * -np.expm1(-taken * x) + beyond) / share)


def impulse_limit(method: Method) -> float:
    """Largest h alpha up to which the impulse is right to :data:`TOLERATED`."""
    return _limit_of(method.name)


@cache
def _limit_of(name: str) -> float:
    """The same by the registry's name: every run asks for it."""
    method = METHODS[name]
    return first_crossing(lambda x: np.abs(_ratios(method, x) - 1.0) > TOLERATED, 1e-3, 1e3)
