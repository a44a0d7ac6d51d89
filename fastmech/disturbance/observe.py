"""What is kept of a disturbed trajectory while it runs: no histories, some numbers a lane."""

from __future__ import annotations

import math

from fastmech.arrays import Floats
from fastmech.jit import OBSERVER_SIGNATURE, kernel

#: Rows of the record, which begins with zeros and ends with the state that the step began with; the
#: excursions' rows go on with the other coordinates, and SWUNG is when the last of them was reached.
LAST_OUTSIDE, BEGUN, SWUNG, EXCURSION = range(4)


@kernel(OBSERVER_SIGNATURE)
def observe_departure(t: float, Y: Floats, params: Floats, record: Floats) -> None:
    """Keep the last time outside the ball of return and the largest departures of the coordinates.

    A coordinate that turns round within a step departs there by Hermite's cubic through both ends.
    ``params``: place of the equilibrium (n,); the norm's metric (n, n); 1/omega^2; square of the ball's
    radius (see :class:`fastmech.disturbance.size.Size`).
    """
    n = Y.shape[0] // 2
    before = EXCURSION + n
    inverse_square, radius_square = params[n + n * n], params[n + n * n + 1]
    for i in range(Y.shape[1]):
        square, h = 0.0, t - record[BEGUN, i]
        for j in range(n):
            away = Y[j, i] - params[j]
            for k in range(n):
                a = params[n + n * j + k]
                square += a * (away * (Y[k, i] - params[k]) + inverse_square * Y[n + j, i] * Y[n + k, i])
            most = max(abs(away), record[EXCURSION + j, i])
            first, last = h * record[before + n + j, i], h * Y[n + j, i]
            # The cubic's slope is first + b s + (last - first - b) s^2, s from 0 to 1.
            if first * last < 0.0:
                moved = Y[j, i] - record[before + j, i]
                b = 6.0 * moved - 4.0 * first - 2.0 * last
                root = math.sqrt(b * b - 4.0 * first * (last - first - b))
                s = 2.0 * first / (-b + math.copysign(root, first))
                turned = away - moved + s * (first + s * (0.5 * b + s * (last - first - b) / 3.0))
                most = max(most, abs(turned))
            record[SWUNG, i] = t if most > record[EXCURSION + j, i] else record[SWUNG, i]
            record[EXCURSION + j, i] = most
        record[LAST_OUTSIDE, i] = t if square > radius_square else record[LAST_OUTSIDE, i]
        record[BEGUN, i] = t
    for d in range(2 * n):
        for i in range(Y.shape[1]):
            record[before + d, i] = Y[d, i]
