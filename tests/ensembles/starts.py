"""Starts that the tests of ensembles share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def random_starts(n: int, seed: int = 0) -> Floats:
    random = np.random.default_rng(seed)
    return np.concatenate([random.uniform(-3, 3, (n, 2)), random.uniform(-4, 4, (n, 2))], axis=1)
