"""Computing tiles: some at a time, each kept as soon as it is finished, a crash retried once."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from typing import Protocol

from fastmech.ensembles.run import Progress
from fastmech.ensembles.threads import thread_count
from fastmech.errors import InputError
from fastmech.interrupts import check as check_interrupt
from fastmech.scan_types.request import RunContext
from fastmech.tiles.section import TiledSection
from fastmech.tiles.tile_file import Tile

#: How often a tile is tried before it is given up.
TRIES = 2

#: Seconds after which workers are counted again although no tile is back.
PERIOD = 2.0

#: How the threads that compute tiles are called.
THREADS = "fastmech-tile"

#: Seconds that tiles in hand have to end in after an interrupt.
GRACE = 0.7

#: What is said when Dask cancels what nobody has cancelled here, or cannot be reached.
LOST = "the connection to the Dask scheduler is lost"


@dataclass(frozen=True)
class TileTask:
    """A tile to compute."""

    section: TiledSection
    index: int


class Workers(Protocol):
    """Who computes tiles.

    Attributes:
        together: whether tiles of different sections are handed out together; else one section follows the
            other.
        deaths: exceptions that say that a whole worker died, with every tile it had.
    """

    together: bool
    deaths: tuple[type[Exception], ...]

    def hired(self, tasks: Sequence[TileTask], context: RunContext) -> AbstractContextManager[None]:
        """Ready for some tiles; when the block is left by an exception, tiles in hand end soon."""

    @property
    def slots(self) -> int:
        """How many tiles to hand out at a time.

        Raises:
            InputError: there is nobody any more.
        """

    def submit(self, task: TileTask) -> Future[Tile]:
        """Have a tile computed."""


class ThreadWorkers:
    """Threads of this process: some tiles side by side or, if there are few, threads inside of each."""

    together = False
    deaths: tuple[type[Exception], ...] = ()
    slots = 1

    @contextmanager
    def hired(self, tasks: Sequence[TileTask], context: RunContext) -> Iterator[None]:
        """As many as the context allows."""
        threads = thread_count(context.threads)
        self.side = max(1, min(threads, len(tasks)))
        self.slots = self.side + 1  # one more, so that none waits while a tile is written
        self.context = replace(context, threads=max(1, threads // self.side))
        self._stopping = threading.Event()
        self._pool = ThreadPoolExecutor(self.side, thread_name_prefix=THREADS)
        try:
            yield
        finally:
            self._stopping.set()
            self._pool.shutdown(wait=False, cancel_futures=True)

    def submit(self, task: TileTask) -> Future[Tile]:
        """Queue the tile."""
        stopping, within = self._stopping, self.context

        def check() -> None:
            if stopping.is_set():
                raise KeyboardInterrupt

        def stage(name: str, total: int) -> Progress:
            tell = within.stage(f"{task.section.name}: {name}", total)

            def advance(finished: int) -> None:
                check()
                tell(finished)

            return advance

        context = replace(within, stage=stage, check=check)
        return self._pool.submit(task.section.compute, task.index, context, 1.0 / self.side)


def compute_tiles(
    tasks: Sequence[TileTask], workers: Workers, keep: Callable[[TileTask, Tile], None]
) -> list[tuple[TileTask, str]]:
    """Compute tiles in their order and keep each as soon as it is finished, in this thread.

    Tiles whose worker died are tried again when all others are done, one at a time: the next death is then
    the fault of the only tile in hand. Given back are those that failed `TRIES` times, with the reasons.

    Raises:
        InputError: a scan refuses, or the workers are lost.
        OSError: ``keep`` failed.
        KeyboardInterrupt: the user stops it; what ends within `GRACE` seconds is kept.
    """
    waiting, suspects = list(reversed(tasks)), list[TileTask]()
    tries, crashed = dict[TileTask, int](), list[tuple[TileTask, str]]()
    running: dict[Future[Tile], TileTask] = {}
    try:
        while waiting or suspects or running:
            slots = workers.slots
            while waiting and len(running) < slots:
                task = waiting.pop()
                running[workers.submit(task)] = task
            if not running:
                task = suspects.pop()
                running[workers.submit(task)] = task
            check_interrupt()
            done, _ = wait(running, PERIOD, FIRST_COMPLETED)
            in_order = [future for future in running if future in done]
            for future in sorted(in_order, key=_failed):  # what is finished is kept before a failure ends it
                task = running.pop(future)
                try:
                    tile = future.result()
                except InputError:
                    raise
                except CancelledError:
                    raise InputError(LOST) from None
                except Exception as error:
                    tries[task] = tries.get(task, 1) + 1
                    died = isinstance(error, workers.deaths)
                    if tries[task] <= TRIES:
                        (suspects if died else waiting).append(task)
                    else:
                        reason = "its worker process died" if died else str(error)
                        crashed.append((task, f"{type(error).__name__}: {reason}".removesuffix(": ")))
                    continue
                keep(task, tile)
    except KeyboardInterrupt:
        for future in running:
            future.cancel()
        for future in wait(running, GRACE)[0]:
            if not _failed(future):
                keep(running[future], future.result())
        raise
    finally:
        for future in running:
            future.cancel()
    return crashed


def _failed(future: Future[Tile]) -> bool:
    return future.cancelled() or future.exception() is not None


def still_computing(patience: float) -> int:
    """How many threads are still at tiles that nobody waits for any more, after some seconds of patience.

    The process ends when they do: Python cannot stop a thread.
    """
    threads = [thread for thread in threading.enumerate() if thread.name.startswith(THREADS)]
    until = time.monotonic() + patience
    for thread in threads:
        thread.join(max(0.0, until - time.monotonic()))
    return sum(thread.is_alive() for thread in threads)
