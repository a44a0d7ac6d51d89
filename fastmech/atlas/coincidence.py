"""Where equilibria meet, in their angles or only in phi."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numba import types
from numpy.typing import NDArray

from fastmech.equilibria.balance import wrap
from fastmech.equilibria.outcome import Outcome
from fastmech.equilibria.solve import INDICES, MERGE, SINGULAR
from fastmech.jit import MATRIX, STATUSES, kernel
from fastmech.mechanism.reduced import potential_hessian

Floats = NDArray[np.float64]
Codes = NDArray[np.int8]


class Coincidence(IntEnum):
    """What is special about a point of a map within rounding."""

    NONE = 0
    FOLD = 1
    """Two equilibria merge; the outcome of the proof is ``AT_FOLD``."""

    CUSP = 2
    """Three equilibria merge (two folds meet); the outcome of the proof is ``AT_FOLD``."""

    DOUBLE_PROJECTION = 3
    """Two equilibria share phi, a double root of the degree-6 polynomial, and are proved to differ."""


NONE, FOLD, CUSP, DOUBLE_PROJECTION = (int(code) for code in Coincidence)
AT_FOLD = int(Outcome.AT_FOLD)
COMPLETE = int(Outcome.COMPLETE)


@kernel(types.void(MATRIX, MATRIX, MATRIX, MATRIX, INDICES, STATUSES, STATUSES, STATUSES))
def coincidences(
    coefficients: Floats,
    phi: Floats,
    theta: Floats,
    radius: Floats,
    index: Codes,
    count: Codes,
    outcome: Codes,
    special: Codes,
) -> None:
    """Write the ``Coincidence`` of every row into ``special``; arguments as in ``solve``.

    At a fold with null direction v of the Hessian the third derivative of U along v is 3 P v1 v2 (v1 + v2),
    where P is the common pull of paper (17); it vanishes at a cusp. Rounding leaves the merged equilibrium's
    place uncertain by ``MERGE`` rad, hence the third derivative by as much of the loads.
    """
    for row in range(coefficients.shape[0]):
        special[row] = NONE
        _, _, lift, spring, gravity, force, _, _ = coefficients[row]
        if outcome[row] == AT_FOLD:
            special[row] = FOLD
            for i in range(count[row]):
                if index[row, i] != SINGULAR:
                    continue
                s1, c1, s2, c2 = (
                    np.sin(phi[row, i]),
                    np.cos(phi[row, i]),
                    np.sin(theta[row, i]),
                    np.cos(theta[row, i]),
                )
                s12, c12 = s1 * c2 + c1 * s2, c1 * c2 - s1 * s2
                h11, h12, h22 = potential_hessian(s1, c1, s2, c2, s12, lift, spring, gravity, force)
                v1, v2 = (h12, -h11) if abs(h11) > abs(h22) else (h22, -h12)
                size = np.hypot(v1, v2)
                third = 3.0 * spring * c12 * v1 * v2 * (v1 + v2)
                loads = abs(lift) + gravity + 2.0 * spring + 2.0 * abs(force)
                if abs(third) <= MERGE * loads * size**3:
                    special[row] = CUSP
        elif outcome[row] == COMPLETE:
            for i in range(count[row]):
                for j in range(i):
                    if abs(wrap(phi[row, i] - phi[row, j])) <= radius[row, i] + radius[row, j]:
                        special[row] = DOUBLE_PROJECTION
