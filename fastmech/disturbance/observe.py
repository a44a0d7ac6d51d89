"""What is kept of a disturbed trajectory while it runs: no histories, three numbers a lane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastmech.jit import OBSERVER_SIGNATURE, kernel

Floats = NDArray[np.float64]

#: Rows of the record, which begins with zeros; the excursions' rows go on with the other coordinates.
LAST_OUTSIDE, EXCURSION = 0, 1


@kernel(OBSERVER_SIGNATURE)
def observe_departure(t: float, Y: Floats, params: Floats, record: Floats) -> None:
    """Keep the last time outside the ball of return and the largest departures of the coordinates.

    ``params``: place of the equilibrium (n,); the norm's metric (n, n); 1/omega^2; square of the ball's
    radius (see :class:`fastmech.disturbance.size.Size`).
    """
    n = Y.shape[0] // 2
    inverse_square, radius_square = params[n + n * n], params[n + n * n + 1]
    for i in range(Y.shape[1]):
        square = 0.0
        for j in range(n):
            away = Y[j, i] - params[j]
            for k in range(n):
                a = params[n + n * j + k]
                square += a * (away * (Y[k, i] - params[k]) + inverse_square * Y[n + j, i] * Y[n + k, i])
            away = abs(away)
            record[1 + j, i] = away if away > record[1 + j, i] else record[1 + j, i]
        record[0, i] = t if square > radius_square else record[0, i]
