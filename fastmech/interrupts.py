"""Ctrl-C and SIGTERM on the command line: noted when they come, acted on where that is safe.

Python's own handler raises ``KeyboardInterrupt`` wherever the main thread is. Within a callback from compiled
code (LLVM asks Numba for kept machine code that way) the exception is lost or tears the compiler apart. Here
a signal is noted first. The exception follows at once where only ordinary code is interrupted, else at the
next `check`: before a kernel is compiled, between calls of an integration, whenever progress is told.

Only the command line calls `listen`. In a notebook Python's own handling stays as it is and `check` does
nothing. A thread may also say itself how long its work is wanted, see `work_while`.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from types import FrameType, SimpleNamespace

#: Packages whose code is never left by an exception out of nowhere: they are called back from compiled code,
#: or leave half a module behind.
UNBROKEN = ("numba", "llvmlite", "ctypes", "h5py", "importlib", "_frozen_importlib_external")

#: Seconds in which signals count as one: shells and build tools pass on what the terminal has sent already.
ONE_SIGNAL = 0.5


class Interrupt(KeyboardInterrupt):
    """The user or the system has stopped the command.

    Attributes:
        signal_number: SIGINT or SIGTERM.
    """

    def __init__(self, message: str = "interrupted", signal_number: int = signal.SIGINT) -> None:
        super().__init__(message)
        self.signal_number = signal_number


class Cancelled(Interrupt):
    """What a thread computes is not wanted any more."""


#: The signal that has come, when, and whether the main thread has been told.
_noted = SimpleNamespace(number=0, at=0.0, told=False)
_own = threading.local()


def listen() -> None:
    """Note SIGINT and SIGTERM from now on to the end of the process; a second one ends it at once."""
    sys.unraisablehook = _unraisable
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _note)


def check() -> None:
    """Stop here if a signal has been noted.

    Raises:
        Interrupt: once in the main thread, which may then tidy up, and always in others.
        Cancelled: what this thread does is not wanted any more.
    """
    wanted = still_wanted()
    if wanted is not None and not wanted():
        raise Cancelled("not wanted any more")
    if not _noted.number:
        return
    if threading.current_thread() is threading.main_thread():
        if _noted.told:
            return
        _noted.told = True
    raise Interrupt(signal_number=_noted.number)


def work_while(wanted: Callable[[], bool] | None) -> None:
    """From now on work of this thread ends at the next `check` once it is not wanted; None: it always is."""
    _own.wanted = wanted


def still_wanted() -> Callable[[], bool] | None:
    """What tells whether this thread's work is wanted, for threads that it starts."""
    return getattr(_own, "wanted", None)


def is_noted() -> bool:
    """Whether a signal has come."""
    return bool(_noted.number)


def signal_of(interrupt: KeyboardInterrupt) -> int:
    """Which signal an interrupt stands for."""
    return interrupt.signal_number if isinstance(interrupt, Interrupt) else signal.SIGINT


def _note(number: int, frame: FrameType | None) -> None:
    now = time.monotonic()
    if _noted.number:
        if now - _noted.at >= ONE_SIGNAL:
            os._exit(128 + number)  # what is half written keeps its temporary name
        return
    _noted.number, _noted.at = number, now
    if _ordinary(frame):
        check()


def _ordinary(frame: FrameType | None) -> bool:
    """Whether everything under way may be left by an exception."""
    while frame is not None:
        if str(frame.f_globals.get("__name__", "")).partition(".")[0] in UNBROKEN:
            return False
        frame = frame.f_back
    return True


def _unraisable(lost: sys.UnraisableHookArgs) -> None:
    """An exception that nobody can catch: an interrupt among them is raised again at the next check."""
    if isinstance(lost.exc_value, Interrupt):
        _noted.told = False
    else:
        sys.__unraisablehook__(lost)


class Stopped(Interrupt):
    """A scan was stopped by Ctrl-C or by SIGTERM; the message says what is kept."""


class CrashedTilesError(Exception):
    """Some tiles could not be computed; the message names the first and says how to compute it alone."""
