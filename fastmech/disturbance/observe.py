"""What is kept of a disturbed trajectory while it runs: no histories, three numbers a lane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastmech.jit import OBSERVER_SIGNATURE, kernel

Floats = NDArray[np.float64]

#: Rows of the record and their start values.
LAST_OUTSIDE, EXCURSION_PHI, EXCURSION_THETA = 0, 1, 2


@kernel(OBSERVER_SIGNATURE)
def observe_departure(t: float, Y: Floats, params: Floats, record: Floats) -> None:
    """Keep the last time outside the ball of return and the largest departures of both angles.

    ``params``: equilibrium phi, theta; metric a11, a12, a22 over m2 l^2; 1/omega^2; square of the ball's
    radius (see :class:`fastmech.disturbance.size.Size`).
    """
    phi, theta, a11, a12, a22 = params[0], params[1], params[2], params[3], params[4]
    inverse_square, radius_square = params[5], params[6]
    for i in range(Y.shape[1]):
        xi1, xi2, eta1, eta2 = Y[0, i] - phi, Y[1, i] - theta, Y[2, i], Y[3, i]
        rates = a11 * eta1 * eta1 + 2.0 * a12 * eta1 * eta2 + a22 * eta2 * eta2
        square = a11 * xi1 * xi1 + 2.0 * a12 * xi1 * xi2 + a22 * xi2 * xi2 + inverse_square * rates
        record[0, i] = t if square > radius_square else record[0, i]
        record[1, i] = abs(xi1) if abs(xi1) > record[1, i] else record[1, i]
        record[2, i] = abs(xi2) if abs(xi2) > record[2, i] else record[2, i]
