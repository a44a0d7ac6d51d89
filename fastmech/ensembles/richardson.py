"""Errors from runs with different steps: Richardson's extrapolation, with the order that the runs show.

For a method of order p, e(h) ~ h^p: a run with steps longer by r differs by (r^p - 1) times its own error
(Hairer, Norsett, Wanner, *Solving ODEs I*, section II.4). That holds for smooth right-hand sides. A jump
makes the order 1, whatever the method's; where the difference does not fall at all, it is itself the error.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

#: Lengths of the steps of two runs that are compared.
RATIO = math.sqrt(2.0)

#: Differences [the state's units] below this may be rounding, magnified by the motion, and show no order.
ROUNDING = 1e-9

#: Orders below this are none: the difference of two runs is the error.
LEAST_ORDER = 0.5

#: Where less than this share of the method's order is seen, errors are reckoned with what is seen.
SHARE = 1.0 / 3.0


def distances(a: Floats, b: Floats) -> Floats:
    """Largest difference of two runs (outputs, n, dim), shape (n,); infinite where one is not finite."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.nan_to_num(np.abs(a - b).max(axis=(0, 2)), nan=np.inf, posinf=np.inf)


def order_statistic(errors: Floats, level: float) -> float:
    """The error that a share ``level`` of the trajectories does not exceed."""
    return float(np.sort(errors)[math.ceil(level * errors.size) - 1]) if errors.size else 0.0


def order_seen(before: Floats, after: Floats, shorter: ArrayLike, order: int) -> Floats:
    """Order (n,) of each trajectory from its distances at two steps, the second ``shorter`` times shorter.

    The method's ``order`` where that is about what is seen, or where nothing can be seen (rounding, or runs
    of which one is not finite).
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        seen = np.log(before / after) / np.log(shorter)
    told = np.isfinite(before) & np.isfinite(after) & (after > ROUNDING) & (seen < SHARE * order)
    return np.where(told, np.maximum(seen, 0.0), float(order))


def error_of_shorter(distance: Floats, order: ArrayLike) -> Floats:
    """Errors (n,) of runs from their distances to those with steps longer by :data:`RATIO`."""
    q = np.asarray(order, dtype=np.float64)
    return distance / np.where(q < LEAST_ORDER, 1.0, RATIO ** np.maximum(q, LEAST_ORDER) - 1.0)


def error_of_longer(distance: Floats, order: ArrayLike) -> Floats:
    """Errors (n,) of runs from their distances to those with steps shorter by :data:`RATIO`."""
    q = np.asarray(order, dtype=np.float64)
    return distance / np.where(q < LEAST_ORDER, 1.0, 1.0 - RATIO ** -np.maximum(q, LEAST_ORDER))


def half_over(order: ArrayLike) -> Floats:
    """Distance to a run of half the step over that to one of steps longer by :data:`RATIO`, at an order."""
    q = np.asarray(order, dtype=np.float64)
    return np.asarray((1.0 - RATIO ** (-2.0 * q)) / (RATIO**q - 1.0))


def unseen(half: Floats, longer: Floats, order: int) -> Floats:
    """Errors (n,) from distances to runs of half the step, and to runs with steps longer by :data:`RATIO`.

    The first is nearly all of the error at a high order, and half of it where both show order 1.
    """
    orders = np.linspace(1.0, max(order, 1.0), 64)
    missing, ratios = 1.0 - RATIO ** (-2.0 * orders), half_over(orders)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = half / longer
    told = np.isfinite(ratio) & (half > ROUNDING)
    seen = np.interp(np.where(told, ratio, 0.0), ratios[::-1], missing[::-1])
    return half / seen
