"""Stopping conditions: what an observer keeps of a trajectory that has stopped."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastmech.jit import inlined

#: Rows of the record: the stop's code (0: runs on), its time [s], then the state at that time.
STOP_CODE, STOP_TIME, STOP_STATE = 0, 1, 2


@inlined
def note_stop(code: float, t: float, Y: NDArray[np.float64], record: NDArray[np.float64], i: int) -> None:
    """Keep code, time and state of lane ``i`` when its code is not zero for the first time.

    A state that is not finite stops nothing, whatever its code: the trajectory has failed before.
    """
    if code != 0.0 and record[STOP_CODE, i] == 0.0:
        for d in range(Y.shape[0]):
            if not np.isfinite(Y[d, i]):
                return
        record[STOP_CODE, i], record[STOP_TIME, i] = code, t
        for d in range(Y.shape[0]):
            record[STOP_STATE + d, i] = Y[d, i]
