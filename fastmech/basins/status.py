"""What is known in the end about a start of a basin map: distinct statuses, each with its advice."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray


class BasinStatus(IntEnum):
    """Status of a start."""

    CAPTURED = 0
    UNDECIDED = 1
    AT_SADDLE = 2
    NOT_FINITE = 3
    STEP_TOO_LARGE = 4
    START_NOT_FINITE = 5
    NOT_CONVERGED = 6

    @property
    def advice(self) -> str:
        """What it means and what to do."""
        return _ADVICE[self]


#: Statuses of starts whose motion has failed.
FAILURES = (
    BasinStatus.NOT_FINITE,
    BasinStatus.STEP_TOO_LARGE,
    BasinStatus.NOT_CONVERGED,
    BasinStatus.START_NOT_FINITE,
)

_ADVICE = {
    BasinStatus.CAPTURED: "proved to end in its well: energy and position leave no other way",
    BasinStatus.UNDECIDED: "not captured by t_end (use a larger one), or too fast or too near a boundary for "
    "the finest steps to agree (no t_end helps)",
    BasinStatus.AT_SADDLE: "comes to an unstable equilibrium, and the finest steps disagree on what follows",
    BasinStatus.NOT_FINITE: "became NaN or infinite with every step tried; use a smaller dt",
    BasinStatus.STEP_TOO_LARGE: "every step tried is beyond the method's limit, or brings the motion to an "
    "energy that it cannot have; use a smaller dt",
    BasinStatus.NOT_CONVERGED: "Newton's iteration found no solution of a step, with every step tried; "
    "use a smaller dt",
    BasinStatus.START_NOT_FINITE: "the start is NaN, infinite or more than 500 million turns away",
}


def counts(status: NDArray[np.int8]) -> dict[str, int]:
    """How many starts have each status, by its name in lower case."""
    return {kind.name.lower(): int(np.count_nonzero(status == kind)) for kind in BasinStatus}
