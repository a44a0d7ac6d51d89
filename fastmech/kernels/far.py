"""Lanes far out: motions whose angles leave the range of the fast trigonometry.

Whole steps do not look at every angle. Where a stretch of steps begins it is asked whether a lane is so far
out, or turns so fast, that one of its angles may leave the range on the way; such a lane goes through the
stretch stage by stage. So its own state alone decides what a lane is given.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastmech.jit import inlined
from fastmech.kernels.sincos import REDUCTION_LIMIT

Floats = NDArray[np.float64]
Marks = NDArray[np.bool_]

#: Angles [rad], and turns of an angle in a step [rad], within which no angle of a stretch leaves the range of
#: the fast trigonometry: weights of tableaus' rows and of predictors have sizes that sum to under 900. (A
#: motion that becomes much faster in a stretch could: its steps are for nothing.)
FARTHEST, TURNED = 0.5 * REDUCTION_LIMIT, 0.0005 * REDUCTION_LIMIT

#: Steps of a stretch.
STRETCH = 8


@inlined
def is_far(Y: Floats, i: int, h: float) -> bool:
    """Whether a stretch of steps h [s] from a lane's state may need angles beyond the fast trigonometry.

    A lane with NaN does not: nothing mends it. Comparisons only: its verdict is the same in any compiled
    code.
    """
    lost = (Y[0, i] != Y[0, i]) | (Y[1, i] != Y[1, i]) | (Y[2, i] != Y[2, i]) | (Y[3, i] != Y[3, i])
    turned = (abs(Y[0, i]) > FARTHEST) | (abs(Y[1, i]) > FARTHEST)
    turned |= (h * abs(Y[2, i]) > TURNED) | (h * abs(Y[3, i]) > TURNED)
    return turned & (not lost)


@inlined
def may_be_far(Y: Floats, h: float) -> bool:
    """Whether lanes of a block (4, lanes) may be far: a sum of squares tells it in a few instructions."""
    beyond = 0
    turn = FARTHEST / TURNED * h
    for i in range(Y.shape[1]):
        turned, bent = turn * Y[2, i], turn * Y[3, i]
        reach = Y[0, i] * Y[0, i] + Y[1, i] * Y[1, i] + turned * turned + bent * bent
        beyond |= reach > 0.5 * FARTHEST * FARTHEST
    return beyond != 0


@inlined
def mark_far(Y: Floats, h: float, far: Marks) -> bool:
    """Mark the lanes (lanes,) of a block that are far; whether there are any."""
    found = False
    if may_be_far(Y, h):
        for i in range(Y.shape[1]):
            far[i] = is_far(Y, i, h)
            found |= far[i]
    return found
