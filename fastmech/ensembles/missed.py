"""Why trajectories have missed their tolerance, in one line."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Flags = NDArray[np.bool_]


def missed_line(missed: Flags, causes: Mapping[str, Flags]) -> str:
    """How many of the trajectories (n,) have missed, and why: who for which cause. Empty where none has."""
    if not missed.any():
        return ""
    each = [f"{np.count_nonzero(which):,}: {why}" for why, which in causes.items() if which.any()]
    return f"; {np.count_nonzero(missed):,} of {missed.size:,} miss it ({'; '.join(each)})"
