"""Progress on standard error: bars on a terminal that can draw them, else a line every so often."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import Any, Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TaskProgressColumn, TextColumn
from rich.table import Column

from fastmech import compiling
from fastmech.compiling import LOADING, Preparation
from fastmech.interrupts import check, is_noted

#: Seconds between lines in a log file.
LOG_PERIOD = 30.0


class Stage:
    """One piece of work: how far it is and how long it has taken, loading and compiling apart."""

    def __init__(self, name: str, total: int, clock: Callable[[], float]) -> None:
        self.name, self.total, self.done, self._clock = name, total, 0, clock
        self.task = TaskID(0)  # of the bars
        self._begun = self.last = self._told = clock()

    def count(self, finished: int, free: float) -> None:
        """So many more are finished; ``free`` [s]: when other work moved last, which may have come first."""
        if not self.done:
            self._begun = max(self._begun, free)
        self.done, self.last = self.done + finished, self._clock()

    @property
    def seconds(self) -> float:
        """From when it could begin to its last finished item."""
        return self.last - self._begun

    @property
    def rate(self) -> float:
        """Items per second."""
        return self.done / self.seconds if self.seconds else 0.0

    def left(self, now: float) -> str:
        """Time that the rest takes at that rate; nothing where no item has been done for so long."""
        left = (self.total - self.done) / self.rate
        silent = now - self.last
        return f"{timedelta(seconds=int(left))} left" if silent < min(left, LOG_PERIOD) else ""

    def columns(self, now: float) -> dict[str, Any]:
        """What bars show beside the share: the rate, and the time left or, in the end, taken."""
        if not self.rate:
            return {"rate": "", "time": ""}
        speed = f"{self.rate:,.0f}/s" if self.rate >= 10 else f"{self.rate:.2g}/s"
        time_left = self.left(now) if self.done < self.total else f"took {self.seconds:.1f} s"
        return {"rate": speed, "time": time_left}

    def log_line(self, now: float) -> str | None:
        """How far it is, at most once every `LOG_PERIOD` seconds."""
        if now - self._told < LOG_PERIOD:
            return None
        self._told = now
        share = self.done / self.total if self.total else 1.0
        since = f", no more done for {now - self.last:.0f} s" if now - self.last >= LOG_PERIOD else ""
        rate = f", {self.rate:,.3g}/s" if self.rate else ""
        left = f", {left}" if self.rate and (left := self.left(now)) else ""
        return f"{self.name}: {share:.0%}{rate}{left}{since}"

    def summary(self) -> dict[str, str | int | float]:
        """The same for other programs."""
        about: dict[str, str | int | float] = {"name": self.name, "done": self.done, "total": self.total}
        return about | {"seconds": round(self.seconds, 3), "rate": round(self.rate, 3)}


def _text(what: str, style: str = "none", **look: Any) -> TextColumn:
    return TextColumn(what, style, markup=False, table_column=Column(no_wrap=True, **look))


class ProgressBars:
    """Bars with percentage, rate and time left; where they cannot be drawn, a line every so often.

    Whenever progress is told, a command may also stop: see `fastmech.interrupts.check`.
    """

    def __init__(self, quiet: bool = False) -> None:
        self._quiet, self._moved = quiet, 0.0
        self._preparation, self._over = Preparation(), threading.Event()
        self._teller = threading.Thread(target=self._tell_preparing, daemon=True)
        console = Console(stderr=True)
        draws = sys.stderr.isatty() and not console.is_dumb_terminal
        self._logs = not quiet and not draws
        self._stages: list[Stage] = []
        self._progress = Progress(
            _text("{task.description}", overflow="ellipsis"),
            BarColumn(bar_width=16),
            TaskProgressColumn(),
            _text("{task.fields[rate]}", "progress.data.speed", justify="right", min_width=10),
            _text("{task.fields[time]}", min_width=12),
            console=console,
            disable=quiet or not draws,
            redirect_stdout=False,
        )

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        if self._teller.is_alive():
            self._teller.join()
        jit = sys.modules.get("fastmech.jit")
        if jit is not None and self._preparation.tell in jit.listeners:
            jit.listeners.remove(self._preparation.tell)
        self._progress.stop()

    def _working(self) -> float:
        return time.monotonic() - self.prepared

    @property
    def prepared(self) -> float:
        """Seconds that loading and compiling have taken."""
        return self._preparation.look()[1]

    def stage(self, name: str, total: int) -> Callable[[int], None]:
        """Announce a piece of work; the result is told how many items have been finished since.

        None have been, but it goes on, where that is 0.
        """
        stage = Stage(name, total, self._working)
        if self._stages:  # so many short ones are told, too
            stage._told = self._stages[-1]._told
        task = stage.task = self._progress.add_task(name, total=total, **stage.columns(stage.last))
        self._stages.append(stage)

        def advance(finished: int) -> None:
            stage.count(finished, self._moved)
            self._moved = stage.last if finished else self._moved
            self._progress.update(task, completed=stage.done, **stage.columns(stage.last))
            if self._logs and (line := stage.log_line(stage.last)):
                self.tell(line)
            check()

        return advance

    def stages(self) -> list[dict[str, str | int | float]]:
        """What has been done so far, piece by piece."""
        return [stage.summary() for stage in self._stages]

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
        """Load what the block imports; then show and count every kernel that is loaded or compiled."""
        self._preparation.tell(LOADING)
        self._teller.start()
        try:
            yield
            from fastmech.jit import listeners

            listeners.append(self._preparation.tell)
        finally:
            self._preparation.tell(None)
        check()

    def _tell_preparing(self) -> None:
        task, due, stopping = None, 0.0, False
        while not self._over.wait(compiling.LOOK):
            line = self._preparation.line()
            if line is None:
                if task is not None:
                    self._progress.remove_task(task)
                    task = None
                unfinished = [stage for stage in self._stages if stage.done < stage.total]
                for stage in unfinished:  # what was forecast may be over
                    self._progress.update(stage.task, **stage.columns(self._working()))
                if self._logs and unfinished and (still := unfinished[-1].log_line(self._working())):
                    self.tell(still)  # no item has ended for long
                continue
            if not self._quiet and is_noted() and not stopping:
                stopping = True
                self.tell("stops when the kernel in hand is compiled, at once when interrupted again")
            if task is None:
                task = self._progress.add_task(line, total=None, rate="", time="")
            self._progress.update(task, description=line)
            if self.prepared >= due and self._logs:
                due = self.prepared + LOG_PERIOD
                self.tell(line)
        if task is not None:
            self._progress.remove_task(task)
