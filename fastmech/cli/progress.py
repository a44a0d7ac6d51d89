"""Progress on standard error: bars on a terminal, a line every so often in a log file."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskProgressColumn,
    TextColumn,
)
from rich.table import Column
from rich.text import Text

from fastmech.kernel_cache import cache_directory


class _Rate(ProgressColumn):
    """Items finished per second."""

    def render(self, task: Task) -> Text:
        """The rate, or nothing where there is none yet."""
        speed = task.finished_speed or task.speed
        if not speed:
            return Text()
        return Text(f"{speed:,.0f}/s" if speed >= 10 else f"{speed:.2g}/s", style="progress.data.speed")


class _Time(ProgressColumn):
    """Time left, and in the end the time taken."""

    def render(self, task: Task) -> Text:
        """The time with its meaning."""
        if task.finished_time is not None:
            return Text(f"took {task.finished_time:.1f} s")
        left = task.time_remaining
        return Text("" if left is None else f"{timedelta(seconds=int(left))} left")


#: Seconds between lines in a log file.
LOG_PERIOD = 30.0


class LogLine:
    """One piece of work in a log file: how far it is, at most once every `LOG_PERIOD` seconds.

    Args:
        name: the piece of work.
        total: its items.
    """

    def __init__(self, name: str, total: int) -> None:
        self._name, self._total, self._done = name, total, 0
        self._begun = self._told = time.monotonic()

    def advance(self, finished: int, before: float = 0.0) -> None:
        """Count items, and say so if it is time; ``before``: when other work that comes first moved last."""
        if not self._done:
            self._begun = max(self._begun, before)
        self._done += finished
        now = time.monotonic()
        if now - self._told < LOG_PERIOD:
            return
        self._told = now
        rate = self._done / (now - self._begun)
        left = timedelta(seconds=int((self._total - self._done) / rate)) if rate else "unknown"
        share = self._done / self._total if self._total else 1.0
        print(f"fastmech: {self._name}: {share:.0%}, {rate:,.3g}/s, {left} left", file=sys.stderr, flush=True)


class ProgressBars:
    """Bars with percentage, rate and time left; without a terminal, a line every so often."""

    def __init__(self, quiet: bool = False) -> None:
        self._quiet, self._moved = quiet, 0.0
        self._logs = not quiet and not sys.stderr.isatty()
        self._progress = Progress(
            TextColumn(
                "{task.description}", markup=False, table_column=Column(overflow="ellipsis", no_wrap=True)
            ),
            BarColumn(bar_width=16),
            TaskProgressColumn(),
            _Rate(Column(justify="right", min_width=10, no_wrap=True)),
            _Time(Column(min_width=12, no_wrap=True)),
            console=Console(stderr=True),
            disable=quiet or not sys.stderr.isatty(),
        )

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def stage(self, name: str, total: int) -> Callable[[int], None]:
        """Announce a piece of work; the result is told how many items have been finished since."""
        task = self._progress.add_task(name, total=total)

        log = LogLine(name, total) if self._logs else None

        def advance(finished: int) -> None:
            self._progress.advance(task, finished)
            if log is not None:
                log.advance(finished, self._moved)
                self._moved = time.monotonic()

        return advance

    def counter(self, name: str) -> Callable[[int, int], None]:
        """Announce a piece of work; the result is told how many items are finished, and of how many."""
        task = self._progress.add_task(name, total=None)

        def tell(done: int, total: int) -> None:
            self._progress.update(task, completed=done, total=total)

        return tell

    def tell(self, line: str) -> None:
        """Show a line above the bars."""
        if not self._quiet:
            self._progress.console.print(f"fastmech: {line}", markup=False, highlight=False, soft_wrap=True)

    @contextmanager
    def preparing(self) -> Iterator[None]:
        """Show that kernels are compiled, while they are imported for the first time."""
        if cache_directory().exists():
            yield
            return
        task = self._progress.add_task("compiling, once for this version", total=None)
        yield
        self._progress.remove_task(task)
