"""What became of a trajectory: one enumeration for all that follows motions, each value with its advice."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Flags


class Status(IntEnum):
    """Status of an integrated trajectory, of the label of a start, or of a disturbance."""

    advice: str  #: what it means and what to do

    def __new__(cls, value: int, advice: str = "") -> Status:
        """A number with its advice."""
        made = int.__new__(cls, value)
        made._value_, made.advice = value, advice
        return made

    OK = 0, "reached the end of the run, or its stopping condition"
    NOT_FINITE = (
        1,
        "became NaN or infinite on the way; use a smaller dt (with tol quantile=1.0), unless it goes to "
        "infinity",
    )
    STEP_TOO_LARGE = (
        2,
        "dt is beyond the method's limit or too long for the motion, or it comes to an energy that it cannot "
        "have; use a smaller dt (with fit or tol, unless it begins too fast for any steps)",
    )
    START_NOT_FINITE = 3, "the start is NaN or infinite, or too many turns away for a label"
    NOT_CONVERGED = 4, "Newton's iteration found no solution of a step; use a smaller dt"
    CAPTURED = 5, "proved to end in its well: energy and position leave no other way"
    UNDECIDED = (
        6,
        "nothing is proved by t_end (use a larger one), or it is too fast or too near a boundary for the "
        "finest steps to agree, or moves on without coming back to its system's section (no t_end helps)",
    )
    AT_SADDLE = 7, "comes to an unstable equilibrium, and what follows is not decided"
    RETURNED = 8, "proved to end at its equilibrium without a full turn"
    ELSEWHERE = 9, "proved to end at another stable equilibrium, or at its own some turns further"
    OUT_OF_RANGE = 10, "leaves the range of a coordinate, beyond which the mechanism is not described"
    ESCAPED = 11, "goes far beyond all attractors that were found, or stops where its system says so"
    UNSURE = 12, "runs with different steps part: near a boundary, or in chaos that lasts long"


#: Statuses of motions that have failed; of labels; of where disturbances end, and of ends that are known.
FAILURES = (Status.NOT_FINITE, Status.STEP_TOO_LARGE, Status.NOT_CONVERGED, Status.START_NOT_FINITE)
LABELS = (
    Status.CAPTURED,
    Status.UNDECIDED,
    Status.AT_SADDLE,
    Status.OUT_OF_RANGE,
    Status.ESCAPED,
    Status.UNSURE,
    *FAILURES,
)
ENDS = (Status.RETURNED, Status.ELSEWHERE, Status.AT_SADDLE, Status.UNDECIDED, Status.OUT_OF_RANGE, *FAILURES)
KNOWN_ENDS = (Status.RETURNED, Status.ELSEWHERE, Status.OUT_OF_RANGE)


def counts(status: ArrayLike, kinds: Iterable[IntEnum]) -> dict[str, int]:
    """How many have which status, by its name in lower case."""
    values = np.asarray(status)
    return {kind.name.lower(): int(np.count_nonzero(values == kind)) for kind in kinds}


def failure_counts(status: ArrayLike, failing: Iterable[IntEnum] = FAILURES) -> dict[str, int]:
    """The same of the ``failing`` ones; what none has is left out."""
    return {name: count for name, count in counts(status, failing).items() if count}


def failure_line(counts: Mapping[str, int], total: int, advice: str = "") -> str:
    """For example ``3 of 4,096 trajectories failed: 2 not_finite, 1 step_too_large; use a smaller dt``.

    Empty where ``counts`` is. ``advice`` is what helps in place of a smaller dt.
    """
    if not counts:
        return ""
    each = ", ".join(f"{count:,} {name}" for name, count in counts.items())
    if not advice:
        infinite = Status.NOT_FINITE.name.lower() in counts
        advice = "use a smaller dt" + ", unless motions go to infinity" * infinite
    told = "" if set(counts) == {Status.START_NOT_FINITE.name.lower()} else f"; {advice}"
    return f"{sum(counts.values()):,} of {total:,} trajectories failed: {each}{told}"


def missed_line(missed: Flags, causes: Mapping[str, Flags]) -> str:
    """How many of the trajectories (n,) have missed, and why: who for which cause. Empty where none has."""
    if not missed.any():
        return ""
    each = [f"{np.count_nonzero(which):,}: {why}" for why, which in causes.items() if which.any()]
    return f"; {np.count_nonzero(missed):,} of {missed.size:,} miss it ({'; '.join(each)})"
