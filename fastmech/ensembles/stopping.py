"""Stopping conditions: the rows that an observer keeps of a trajectory which has stopped."""

from __future__ import annotations

#: Rows of the record: the stop's code (0: runs on), its time [s], then the state at that time.
STOP_CODE, STOP_TIME, STOP_STATE = 0, 1, 2
