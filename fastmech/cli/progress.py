"""Progress bars on standard error, one for each piece of work of a run."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from fastmech.kernel_cache import cache_directory


class _Rate(ProgressColumn):
    """Items finished per second."""

    def render(self, task: Task) -> Text:
        """The rate, or nothing where there is none yet."""
        speed = task.finished_speed or task.speed
        return Text(f"{speed:,.3g}/s" if speed else "", style="progress.data.speed")


class ProgressBars:
    """Bars with percentage, rate and time left while it is entered; none unless standard error is a terminal."""

    def __init__(self, quiet: bool = False) -> None:
        self._progress = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=28),
            TaskProgressColumn(),
            _Rate(),
            TextColumn("elapsed"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
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

    @contextmanager
    def preparing(self) -> Iterator[None]:
        """Show that kernels are compiled, while they are imported for the first time."""
        if cache_directory().exists():
            yield
            return
        task = self._progress.add_task("compiling, once for this version", total=None)
        yield
        self._progress.remove_task(task)
