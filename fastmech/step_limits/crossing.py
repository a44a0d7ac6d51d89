"""The first place at which something begins along the positive numbers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Ratio of neighbouring places of the search: finer than any lobe of a stability region.
RATIO = 1.03

#: Places that are looked at in one call.
AT_ONCE = 64

#: Divisions of an interval of that ratio by 17 after which it is as narrow as rounding.
PARTS, DIVISIONS = 17, 11


def first_crossing(
    beyond: Callable[[Floats], NDArray[np.bool_]], start: float, stop: float, divisions: int = DIVISIONS
) -> float:
    """Least x at which ``beyond`` turns true; 0.0 if so at ``start``, inf if not up to ``stop``.

    From places that grow by :data:`RATIO` it is narrowed down by so many divisions. ``beyond`` is asked of
    many places (m,) in one call: it pays to compute with arrays.
    """
    last = max(int(np.ceil(np.log(stop / start) / np.log(RATIO))), 0)
    for first in range(0, last + 1, AT_ONCE):
        places = start * RATIO ** np.arange(first, min(first + AT_ONCE, last + 1.0))
        found = np.flatnonzero(beyond(places))
        if found.size:
            at = float(places[found[0]])
            return 0.0 if first + found[0] == 0 else _narrowed(beyond, at / RATIO, at, divisions)
    return float("inf")


def _narrowed(
    beyond: Callable[[Floats], NDArray[np.bool_]], below: float, above: float, divisions: int
) -> float:
    """Where it turns true between two places: in the first part whose end is beyond, again and again.

    Importing SciPy's root finders takes longer than a first run, and every run asks for a step limit.
    """
    for _ in range(divisions):
        places = below + (above - below) * np.arange(1, PARTS) / PARTS
        found = np.flatnonzero(beyond(places))
        first = int(found[0]) if found.size else places.size
        ends = [below, *places.tolist(), above]
        below, above = ends[first], ends[first + 1]
    return below
