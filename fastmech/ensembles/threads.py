"""How many threads to use, and how they take tasks from a queue."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np

from fastmech.ensembles import checks
from fastmech.interrupts import check, still_wanted, work_while

T = TypeVar("T")

#: Trajectories of a part where one takes a few nanoseconds: to start a thread takes as long as thousands.
PART = 2**15


def thread_count(threads: int | None) -> int:
    """Threads to use: as asked, else the processors that this process may run on.

    Raises:
        InputError: not an integer of at least 1.
    """
    if threads is not None:
        return checks.whole_number("threads", threads, least=1)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_threads(
    work: Callable[[T], int], tasks: list[T], workers: int, interrupted: threading.Event
) -> Iterator[int]:
    """What ``work`` gives for each task; one worker is this thread itself, which costs nothing to start."""
    if workers <= 1:
        yield from map(work, tasks)
        return
    with ThreadPoolExecutor(workers, initializer=work_while, initargs=(still_wanted(),)) as pool:
        try:
            yield from pool.map(work, tasks)
        except BaseException:  # Ctrl-C too: calls in hand end, the other tasks never begin
            interrupted.set()
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def in_parts(
    work: Callable[[slice], None],
    n: int,
    threads: int | None,
    size: int = PART,
    progress: Callable[[int], None] | None = None,
) -> None:
    """Do a work on all of ``n`` trajectories, which share nothing, in parts of so many.

    ``progress`` is told how many have finished since its last call.
    """

    def part(first: int) -> int:
        last = min(first + size, n)
        with np.errstate(invalid="ignore", over="ignore"):  # what is not finite has a status of its own
            work(slice(first, last))
        return last - first

    firsts = list(range(0, n, size))
    for finished in in_threads(part, firsts, min(thread_count(threads), len(firsts)), threading.Event()):
        check()
        if progress is not None:
            progress(finished)
