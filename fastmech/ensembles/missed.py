"""Why trajectories have missed their tolerance, in one line."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Flags = NDArray[np.bool_]


def missed_line(missed: Flags, grazing: Flags, lost: Flags, unpaid: Flags) -> str:
    """How many of the trajectories have missed, and why; empty where none has."""
    if not missed.any():
        return ""
    grazing, lost = missed & grazing, missed & lost
    unpaid = missed & unpaid & ~grazing & ~lost
    causes = {
        "two resolutions disagree about their stop": grazing,
        "not finite at any step tried": lost,
        "shorter steps would cost too much": unpaid,
        "shorter steps do not reduce their errors as the order says (chaos, a jump or singularity of the "
        "right-hand side, rounding)": missed & ~grazing & ~lost & ~unpaid,
    }
    each = [f"{np.count_nonzero(which):,}: {why}" for why, which in causes.items() if which.any()]
    return f"; {np.count_nonzero(missed):,} of {missed.size:,} miss it ({'; '.join(each)})"
