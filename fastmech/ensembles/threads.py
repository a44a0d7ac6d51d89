"""How many threads to use."""

from __future__ import annotations

import os


def thread_count(threads: int | None) -> int:
    """Threads to use: as asked, else the processors that this process may run on."""
    if threads is not None:
        return threads
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
