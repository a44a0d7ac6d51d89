"""How far a body turns in a step: what a run by a one-step method tells of its steps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastmech.ensembles.run import Observation
from fastmech.jit import OBSERVER_SIGNATURE, kernel

Floats = NDArray[np.float64]

#: Rows of the record: the greatest turn of an angle in a step [rad], and the angles that the step began with.
TURNED, BEFORE = 0, 1


@kernel(OBSERVER_SIGNATURE)
def observe_turns(t: float, Y: Floats, params: Floats, record: Floats) -> None:
    """Keep the greatest turn of every lane; before the first step nothing is known, which is NaN."""
    for angle in range(2):
        for i in range(Y.shape[1]):
            turned = abs(Y[angle, i] - record[BEFORE + angle, i])
            record[TURNED, i] = turned if turned > record[TURNED, i] else record[TURNED, i]
            record[BEFORE + angle, i] = Y[angle, i]


TURNS = Observation(observe_turns, np.zeros(0), np.array([0.0, np.nan, np.nan]))
