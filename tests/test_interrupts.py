"""Signals are noted first; the exception comes where ordinary code is interrupted, else at the next check."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time

import pytest

from fastmech import interrupts
from fastmech.ensembles.threads import in_threads
from fastmech.interrupts import Interrupt, check, is_noted, signal_of

pytestmark = pytest.mark.nojit

BEGIN = """
import ctypes, os, signal, time
from fastmech.interrupts import Interrupt, check, is_noted, listen

def come(number=signal.SIGTERM):
    os.kill(os.getpid(), number)
    time.sleep(0)  # the handler has run

def foreign(name):
    space = {"__name__": name, "come": come}
    exec("def call():\\n    come()\\n    return 'went on'", space)
    return space["call"]

def raised(function):
    try:
        function()
    except Interrupt as interrupt:
        return interrupt.signal_number
    return None

listen()
"""


def program(text: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", BEGIN + text], capture_output=True, text=True, timeout=120, check=False
    )


def assert_holds(text: str) -> None:
    done = program(text)
    assert (done.returncode, done.stderr) == (0, "")


def test_ordinary_code_is_interrupted_at_once() -> None:
    assert_holds("assert raised(come) == signal.SIGTERM\nassert is_noted()")


@pytest.mark.parametrize("name", ["numba.core.event", "llvmlite.binding", "h5py._hl.files", "importlib"])
def test_code_that_may_not_be_left_goes_on_to_the_next_check(name: str) -> None:
    assert_holds(f"assert foreign({name!r})() == 'went on'\nassert raised(check) == signal.SIGTERM")


def test_the_main_thread_is_told_once_so_that_it_can_tidy_up() -> None:
    assert_holds("raised(come)\nassert raised(check) is None")


def test_other_threads_are_always_told() -> None:
    assert_holds(
        "from threading import Thread\nraised(come)\nfound = []\n"
        "for _ in range(2):\n"
        "    thread = Thread(target=lambda: found.append(raised(check)))\n"
        "    thread.start()\n"
        "    thread.join()\n"
        "assert found == [signal.SIGTERM] * 2"
    )


def test_what_a_callback_from_compiled_code_loses_comes_again() -> None:
    assert_holds("ctypes.CFUNCTYPE(None)(come)()\nassert raised(check) == signal.SIGTERM")


def test_what_a_destructor_loses_comes_again() -> None:
    assert_holds(
        "class Dying:\n    def __del__(self):\n        come()\n"
        "one = Dying()\ndel one\nassert raised(check) == signal.SIGTERM"
    )


def test_other_lost_exceptions_are_told_as_ever() -> None:
    done = program("class Dying:\n    def __del__(self):\n        1 / 0\none = Dying()\ndel one")
    assert (done.returncode, "ZeroDivisionError" in done.stderr) == (0, True)


def test_a_second_signal_ends_the_process() -> None:
    text = "foreign('numba')()\ntime.sleep(0.6)\ncome(signal.SIGINT)\nprint('not reached')"
    done = program(text)
    assert (done.returncode, done.stdout) == (128 + signal.SIGINT, "")


def test_signals_that_come_together_are_one() -> None:
    assert_holds("foreign('numba')()\nfor _ in range(3): come()\nassert raised(check) == signal.SIGTERM")


def test_nothing_is_done_where_nobody_listens() -> None:
    check()
    assert not is_noted()


def test_which_signal() -> None:
    assert signal_of(KeyboardInterrupt()) == signal.SIGINT
    assert signal_of(Interrupt("x", signal.SIGTERM)) == signal.SIGTERM


def test_work_of_a_thread_ends_where_it_is_not_wanted_and_so_does_what_it_starts() -> None:
    wanted = [True]
    seen = list[bool]()

    def task(k: int) -> int:
        still = interrupts.still_wanted()
        seen.append(still is not None and still())
        wanted[0] = k < 3
        time.sleep(0.01)
        interrupts.check()
        return k

    interrupts.work_while(lambda: wanted[0])
    try:
        with pytest.raises(interrupts.Cancelled):
            list(in_threads(task, list(range(200)), 2, threading.Event()))
        assert seen[0]
        assert len(seen) < 200
    finally:
        interrupts.work_while(None)
    interrupts.check()
