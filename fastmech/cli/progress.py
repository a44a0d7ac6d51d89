"""Progress bars on standard error, one for each piece of work of a run."""

from __future__ import annotations

import sys
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


class ProgressBars:
    """Bars with percentage, rate and time left, where standard error is a terminal; nothing elsewhere."""

    def __init__(self, quiet: bool = False) -> None:
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

        def advance(finished: int) -> None:
            self._progress.advance(task, finished)

        return advance

    def counter(self, name: str) -> Callable[[int, int], None]:
        """Announce a piece of work; the result is told how many items are finished, and of how many."""
        task = self._progress.add_task(name, total=None)

        def tell(done: int, total: int) -> None:
            self._progress.update(task, completed=done, total=total)

        return tell

    @contextmanager
    def preparing(self) -> Iterator[None]:
        """Show that kernels are compiled, while they are imported for the first time."""
        if cache_directory().exists():
            yield
            return
        task = self._progress.add_task("compiling, once for this version", total=None)
        yield
        self._progress.remove_task(task)
