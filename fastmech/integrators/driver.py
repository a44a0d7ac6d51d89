"""What every driver is given besides a method's own numbers: a right-hand side and an observer.

They come as :class:`fastmech.callee.Callee`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fastmech.jit import OBSERVER_SIGNATURE, kernel

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
BlockRHS = Callable[[float, Floats, Floats, Floats], None]
Observer = Callable[[float, Floats, Floats, Floats], None]


@kernel(OBSERVER_SIGNATURE)
def observe_nothing(t: float, Y: Floats, params: Floats, record: Floats) -> None:
    """The observer of runs that keep nothing but states."""
