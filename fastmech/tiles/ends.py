"""How a scan may end before its result is there."""

from __future__ import annotations

from fastmech.interrupts import Interrupt


class Stopped(Interrupt):
    """A scan was stopped by Ctrl-C or by SIGTERM; the message says what is kept."""


class CrashedTilesError(Exception):
    """Some tiles could not be computed; the message names the first and says how to compute it alone."""
