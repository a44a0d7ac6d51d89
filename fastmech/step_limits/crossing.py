"""The first place at which a function of one positive number turns positive."""

from __future__ import annotations

from collections.abc import Callable

#: Ratio of neighbouring places of the search: finer than any lobe of a stability region.
RATIO = 1.03

#: Halvings of an interval of that ratio after which it is as narrow as rounding.
HALVINGS = 45


def first_crossing(function: Callable[[float], float], start: float, stop: float) -> float:
    """Least x at which ``function`` turns positive; 0.0 if so at ``start``, inf if not up to ``stop``."""
    x = start
    if function(x) > 0.0:
        return 0.0
    while x < stop:
        after = RATIO * x
        if function(after) > 0.0:
            return _halved(function, x, after)
        x = after
    return float("inf")


def _halved(function: Callable[[float], float], below: float, above: float) -> float:
    """Where the function turns positive between two places, by bisection.

    Importing SciPy's root finders takes longer than a first run, and every run asks for a step limit.
    """
    for _ in range(HALVINGS):
        middle = 0.5 * (below + above)
        if function(middle) > 0.0:
            above = middle
        else:
            below = middle
    return above
