"""What became of a trajectory: distinct statuses, each with its advice."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """Status of an integrated trajectory."""

    OK = 0
    NOT_FINITE = 1

    @property
    def advice(self) -> str:
        """What it means and what to do."""
        return _ADVICE[self]


_ADVICE = {
    Status.OK: "reached the end of the run",
    Status.NOT_FINITE: "NaN or infinity: a start that is not finite, or a step too large; use a smaller dt",
}
