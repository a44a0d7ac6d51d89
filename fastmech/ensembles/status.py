"""What became of a trajectory: distinct statuses, each with its advice."""

from __future__ import annotations

from enum import IntEnum


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
    Status.STEP_TOO_LARGE: "has energy at the end that the motion cannot have; use a smaller dt",
    Status.NOT_CONVERGED: "Newton's iteration found no solution of a step; use a smaller dt",
    Status.START_NOT_FINITE: "the start is NaN or infinite",
}
