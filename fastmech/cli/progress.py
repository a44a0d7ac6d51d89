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
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._begun = self._told = time.monotonic()

    def tell(self, done: int, total: int) -> None:
        """Say how far it is, if it is time."""
        now = time.monotonic()
        if now - self._told < LOG_PERIOD:
            return
        self._told = now
        rate = done / (now - self._begun)
        left = timedelta(seconds=int((total - done) / rate)) if rate else "unknown"
        share = done / total if total else 1.0
        print(f"fastmech: {self._name}: {share:.0%}, {rate:,.3g}/s, {left} left", file=sys.stderr, flush=True)


class Stage:
    """One piece of work: how far it is and how long it has taken.

    Args:
        name: the piece of work.
        total: its items; 0 where they are not known yet.
    """

    def __init__(self, name: str, total: int) -> None:
        self.name, self.total, self.done = name, total, 0
        self._begun = self._last = time.monotonic()

    def count(self, done: int, total: int) -> None:
        """So many items are finished."""
        self.done, self.total, self._last = done, total, time.monotonic()

    def summary(self) -> dict[str, str | int | float]:
        """The same for other programs; the rate is in items per second."""
        seconds = self._last - self._begun
        rate = self.done / seconds if seconds else 0.0
        about: dict[str, str | int | float] = {"name": self.name, "done": self.done, "total": self.total}
        return about | {"seconds": round(seconds, 3), "rate": round(rate, 3)}


class ProgressBars:
    """Bars with percentage, rate and time left; without a terminal, a line every so often."""

    def __init__(self, quiet: bool = False) -> None:
        self._quiet = quiet
        self._logs = not quiet and not sys.stderr.isatty()
        self._stages: list[Stage] = []
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
            redirect_stdout=False,
        )

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def stage(self, name: str, total: int) -> Callable[[int], None]:
        """Announce a piece of work; the result is told how many items have been finished since."""
        tell, done = self._begin(name, total), 0

        def advance(finished: int) -> None:
            nonlocal done
            done += finished
            tell(done, total)

        return advance

    def counter(self, name: str) -> Callable[[int, int], None]:
        """Announce a piece of work; the result is told how many items are finished, and of how many."""
        return self._begin(name, None)

    def stages(self) -> list[dict[str, str | int | float]]:
        """What has been done so far, piece by piece."""
        return [stage.summary() for stage in self._stages]

    def _begin(self, name: str, total: int | None) -> Callable[[int, int], None]:
        task = self._progress.add_task(name, total=total)
        stage, log = Stage(name, total or 0), LogLine(name) if self._logs else None
        self._stages.append(stage)

        def tell(done: int, total: int) -> None:
            self._progress.update(task, completed=done, total=total)
            stage.count(done, total)
            if log is not None:
                log.tell(done, total)

        return tell

    @property
    def shown(self) -> bool:
        """Whether there are bars on the terminal."""
        return not self._progress.disable and self._progress.live.is_started

    def above(self, line: str) -> None:
        """Put a line above the bars."""
        self._progress.console.print(line, markup=False, highlight=False, soft_wrap=True)

    def tell(self, line: str) -> None:
        """Show a line above the bars."""
        if not self._quiet:
            self.above(f"fastmech: {line}")

    @contextmanager
    def preparing(self) -> Iterator[None]:
        """Show that kernels are compiled, while they are imported for the first time."""
        if cache_directory().exists():
            yield
            return
        task = self._progress.add_task("compiling, once for this version", total=None)
        yield
        self._progress.remove_task(task)
