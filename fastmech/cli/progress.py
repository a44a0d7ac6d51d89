"""Progress on standard error: bars on a terminal that can draw them, else a line every so often."""

from __future__ import annotations

import sys
import threading
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

from fastmech.interrupts import check, is_noted


class _Rate(ProgressColumn):
    """Items finished per second, loading and compiling apart."""

    def render(self, task: Task) -> Text:
        """The rate, or nothing where there is none yet."""
        stage: Stage | None = task.fields["stage"]
        if stage is None or not stage.rate:
            return Text()
        speed = stage.rate
        return Text(f"{speed:,.0f}/s" if speed >= 10 else f"{speed:.2g}/s", style="progress.data.speed")


class _Time(ProgressColumn):
    """Time left, and in the end the time taken, loading and compiling apart."""

    def render(self, task: Task) -> Text:
        """The time with its meaning."""
        stage: Stage | None = task.fields["stage"]
        if stage is None:
            return Text()
        if task.finished:
            return Text(f"took {stage.seconds:.1f} s")
        return Text(f"{stage.left} left" if stage.rate else "")


#: Seconds between lines in a log file.
LOG_PERIOD = 30.0

#: Seconds between looks at what is being loaded or compiled.
LOOK = 1.0

#: Seconds of loading and compiling, in all, that pass without a word.
SILENT = 3.0

#: What it is called before any kernel is asked for.
LOADING = "loading"


class Stage:
    """One piece of work: how far it is and how long it has taken.

    Args:
        name: the piece of work.
        total: its items; 0 where they are not known yet.
        clock: seconds that go on while work is done.
    """

    def __init__(self, name: str, total: int, clock: Callable[[], float]) -> None:
        self.name, self.total, self.done, self._clock = name, total, 0, clock
        self._begun = self.last = clock()

    def count(self, done: int, total: int, free: float) -> None:
        """So many items are finished; ``free`` [s]: when other work moved last, which may have come first."""
        if not self.done:
            self._begun = max(self._begun, free)
        self.done, self.total, self.last = done, total, self._clock()

    @property
    def seconds(self) -> float:
        """From when it could begin to its last finished item."""
        return self.last - self._begun

    @property
    def rate(self) -> float:
        """Items per second."""
        return self.done / self.seconds if self.seconds else 0.0

    @property
    def left(self) -> timedelta:
        """Time that the rest takes at that rate."""
        return timedelta(seconds=int((self.total - self.done) / self.rate))

    def summary(self) -> dict[str, str | int | float]:
        """The same for other programs."""
        about: dict[str, str | int | float] = {"name": self.name, "done": self.done, "total": self.total}
        return about | {"seconds": round(self.seconds, 3), "rate": round(self.rate, 3)}


class LogLine:
    """One piece of work in a log file: how far it is, at most once every `LOG_PERIOD` seconds.

    Args:
        stage: the piece of work.
    """

    def __init__(self, stage: Stage) -> None:
        self._stage, self._told = stage, stage.last

    def tell(self) -> None:
        """Say how far it is, if it is time."""
        now, stage = self._stage.last, self._stage
        if now - self._told < LOG_PERIOD:
            return
        self._told = now
        left = stage.left if stage.rate else "unknown"
        share = stage.done / stage.total if stage.total else 1.0
        line = f"fastmech: {stage.name}: {share:.0%}, {stage.rate:,.3g}/s, {left} left"
        print(line, file=sys.stderr, flush=True)


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
            TextColumn(
                "{task.description}", markup=False, table_column=Column(overflow="ellipsis", no_wrap=True)
            ),
            BarColumn(bar_width=16),
            TaskProgressColumn(),
            _Rate(Column(justify="right", min_width=10, no_wrap=True)),
            _Time(Column(min_width=12, no_wrap=True)),
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
        stage = Stage(name, total or 0, self._working)
        task = self._progress.add_task(name, total=total, stage=stage)
        log = LogLine(stage) if self._logs else None
        self._stages.append(stage)

        def tell(done: int, total: int) -> None:
            self._progress.update(task, completed=done, total=total)
            stage.count(done, total, self._moved)
            self._moved = stage.last
            if log is not None:
                log.tell()
            check()

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
        task, due, stopping = None, SILENT, False
        while not self._over.wait(LOOK):
            name, seconds = self._preparation.look()
            if name is None or seconds < SILENT:
                if task is not None:
                    self._progress.remove_task(task)
                    task = None
                continue
            what = name if name == LOADING else f"compiling {name} (kernel {self._preparation.kernels})"
            if not self._quiet and is_noted() and not stopping:
                stopping = True
                self._line("stops when the kernel in hand is compiled, at once when interrupted again")
            if task is None:
                task = self._progress.add_task(what, total=None, stage=None)
            self._progress.update(task, description=f"{what}, {seconds:.0f} s so far")
            if seconds >= due and self._logs:
                due = seconds + LOG_PERIOD
                self._line(f"{what}, {seconds:.0f} s so far")
        if task is not None:
            self._progress.remove_task(task)

    def _line(self, line: str) -> None:
        if self.shown:
            self.above(f"fastmech: {line}")
        else:
            print(f"fastmech: {line}", file=sys.stderr, flush=True)
