"""How a scan may end before its result is there."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class Stopped(KeyboardInterrupt):
    """A scan was stopped by Ctrl-C or by SIGTERM; the message says what is kept.

    Attributes:
        signal_number: which signal it was.
    """

    def __init__(self, message: str, signal_number: int = signal.SIGINT) -> None:
        super().__init__(message)
        self.signal_number = signal_number


class CrashedTilesError(Exception):
    """Some tiles could not be computed; the message names the first and says how to compute it alone."""


class _Terminated(KeyboardInterrupt):
    """SIGTERM has come."""


@contextmanager
def terminable() -> Iterator[None]:
    """Let SIGTERM interrupt like Ctrl-C does; only the main thread can change that."""

    def terminate(number: int, frame: FrameType | None) -> None:
        raise _Terminated

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous = signal.signal(signal.SIGTERM, terminate)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous)


def signal_of(interrupt: KeyboardInterrupt) -> int:
    """Which signal an interrupt stands for."""
    return signal.SIGTERM if isinstance(interrupt, _Terminated) else signal.SIGINT
