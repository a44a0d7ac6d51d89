"""What is being loaded, compiled or looked for, and a line on the terminal that says so.

A first call compiles for some seconds, and a search may last. Commands show that among their bars; in a
session of Python, or in a notebook, a line of its own does, which goes when it is done. Where nobody looks
on, nothing is written.
"""

from __future__ import annotations

import multiprocessing
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

#: Seconds between looks at what is being loaded or compiled.
LOOK = 1.0

#: Seconds of loading and compiling, in all, that pass without a word.
SILENT = 3.0

#: What it is called before any kernel is asked for.
LOADING = "loading"


class Preparation:
    """What is being loaded or compiled, and how long that has taken; any thread may tell.

    A kernel that another one calls is made within it.
    """

    def __init__(self) -> None:
        self._lock, self._in_hand, self._done, self._since = threading.Lock(), list[str](), 0.0, 0.0
        self.kernels = 0  #: begun so far

    def tell(self, name: str | None) -> None:
        """Something is begun, or (None) what was begun last is there."""
        with self._lock:
            now = time.perf_counter()
            if self._in_hand:
                self._done += now - self._since
            self._since = now
            if name is None:
                self._in_hand.pop()
            else:
                self._in_hand.append(name)
                self.kernels += name != LOADING

    def look(self) -> tuple[str | None, float]:
        """What is in hand, if anything, and the seconds so far."""
        with self._lock:
            if not self._in_hand:
                return None, self._done
            return self._in_hand[-1], self._done + time.perf_counter() - self._since

    def line(self) -> str | None:
        """What is in hand in words, once it has taken longer than passes without a word."""
        name, seconds = self.look()
        if name is None or seconds < SILENT:
            return None
        what = name if name == LOADING else f"compiling {name} (kernel {self.kernels})"
        return f"{what}, {seconds:.0f} s so far"


class TerminalLine(Preparation):
    """One line of the terminal or notebook in which Python runs."""

    def __init__(self) -> None:
        super().__init__()
        self._pen, self._watching, self._width = threading.Lock(), False, 0
        self._work: list[list[str | float]] = []  # words, and since when

    def tell(self, name: str | None) -> None:
        """Something is begun, or (None) there; the line goes with the last of them."""
        super().tell(name)
        with self._pen:
            if name is None:
                self._clear()
            else:
                self._watch_on()

    @contextmanager
    def work(self, words: str) -> Iterator[Callable[[str], None]]:
        """What lasts for the block in words; gives what changes them."""
        entry: list[str | float] = [words, time.perf_counter()]

        def say(words: str) -> None:
            entry[0] = words

        with self._pen:
            self._work.append(entry)
            self._watch_on()
        try:
            yield say
        finally:
            with self._pen:
                self._work.remove(entry)
                self._clear()

    def line(self) -> str | None:
        """What is compiled, or else the innermost of what else lasts, in words."""
        compiled, now = super().line(), time.perf_counter()
        each = [(words, now - float(since)) for words, since in self._work]
        lasting = [f"{words}, {seconds:.0f} s so far" for words, seconds in each if seconds >= SILENT]
        return lasting[-1] if compiled is None and lasting else compiled

    @property
    def _idle(self) -> bool:
        return self.look()[0] is None and not self._work

    def _clear(self) -> None:
        if self._width and self._idle:
            self._show("\r")
            self._width = 0

    def _watch_on(self) -> None:
        if not self._watching and _somebody_looks_on():
            self._watching = True
            threading.Thread(target=self._watch, daemon=True).start()

    def _watch(self) -> None:
        """Until nothing is in hand."""
        while self._watching:
            time.sleep(LOOK)
            with self._pen:
                self._watching = not self._idle
                line = self.line()
                if line is not None:
                    line = f"fastmech: {line}"
                    self._show(line)
                    self._width = max(self._width, len(line))

    def _show(self, text: str) -> None:
        """In place of what is there."""
        print(f"\r{' ' * self._width}\r{text}", end="", file=sys.stderr, flush=True)


def _somebody_looks_on() -> bool:
    """Whether this process has a terminal or a notebook to itself."""
    if multiprocessing.parent_process() is not None:
        return False
    return "ipykernel" in sys.modules or (sys.stderr is not None and sys.stderr.isatty())


on_terminal = TerminalLine()
