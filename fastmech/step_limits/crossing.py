"""The first place at which a function of one positive number turns positive."""

from __future__ import annotations

from collections.abc import Callable

from scipy.optimize import brentq

#: Ratio of neighbouring places of the search: finer than any lobe of a stability region.
RATIO = 1.03


def first_crossing(function: Callable[[float], float], start: float, stop: float) -> float:
    """Least x at which ``function`` turns positive; 0.0 if so at ``start``, inf if not up to ``stop``."""
    x = start
    if function(x) > 0.0:
        return 0.0
    while x < stop:
        after = RATIO * x
        if function(after) > 0.0:
            return float(brentq(function, x, after, xtol=1e-13 * x, rtol=1e-12))
        x = after
    return float("inf")
