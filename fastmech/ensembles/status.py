"""What became of a trajectory: distinct statuses, each with its advice."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

Flags = NDArray[np.bool_]


class Status(IntEnum):
    """Status of an integrated trajectory."""

    OK = 0
    NOT_FINITE = 1
    STEP_TOO_LARGE = 2
    START_NOT_FINITE = 3
    NOT_CONVERGED = 4

    @property
    def advice(self) -> str:
        """What it means and what to do."""
        return _ADVICE[self]


_ADVICE = {
    Status.OK: "reached the end of the run, or its stopping condition",
    Status.NOT_FINITE: "became NaN or infinite on the way; use a smaller dt",
    Status.STEP_TOO_LARGE: "dt is beyond the method's limit or too long for the motion, or it ends with an "
    "energy that it cannot have; use a smaller dt (with fit or tol, unless it begins too fast for any steps)",
    Status.NOT_CONVERGED: "Newton's iteration found no solution of a step; use a smaller dt",
    Status.START_NOT_FINITE: "the start is NaN or infinite",
}


def failure_counts(status: ArrayLike, failing: Iterable[IntEnum]) -> dict[str, int]:
    """How many trajectories have which of the ``failing`` statuses, by name; what none has is left out."""
    values = np.asarray(status)
    found = {kind.name.lower(): int(np.count_nonzero(values == kind)) for kind in failing}
    return {name: count for name, count in found.items() if count}


def failure_line(counts: Mapping[str, int], total: int) -> str:
    """For example ``3 of 4,096 trajectories failed: 2 not_finite, 1 step_too_large; use a smaller dt``.

    Empty where ``counts`` is.
    """
    if not counts:
        return ""
    each = ", ".join(f"{count:,} {name}" for name, count in counts.items())
    advice = "" if set(counts) == {Status.START_NOT_FINITE.name.lower()} else "; use a smaller dt"
    return f"{sum(counts.values()):,} of {total:,} trajectories failed: {each}{advice}"


def missed_line(missed: Flags, causes: Mapping[str, Flags]) -> str:
    """How many of the trajectories (n,) have missed, and why: who for which cause. Empty where none has."""
    if not missed.any():
        return ""
    each = [f"{np.count_nonzero(which):,}: {why}" for why, which in causes.items() if which.any()]
    return f"; {np.count_nonzero(missed):,} of {missed.size:,} miss it ({'; '.join(each)})"
