"""What one call of a method is given: blocks of lanes and the times that they pass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Batch:
    """Equally wide blocks of lanes that pass the same times; the method writes all but the first three.

    A block lies together in memory, so that all it needs stays in the caches while it runs.
    """

    times: NDArray[np.float64]  #: start, then the end of every piece [s]
    steps: NDArray[np.int64]  #: steps of every piece
    params: Floats  #: parameters of the lanes, shape (blocks, count, lanes)
    observer_params: NDArray[np.float64]  #: parameters of the observer
    Y: Floats  #: states, advanced in place, shape (blocks, dim, lanes)
    record: NDArray[np.float64]  #: what the observer keeps, shape (blocks, rows, lanes)
    out: Floats  #: states at the end of every piece, shape (blocks, pieces, dim, lanes)
