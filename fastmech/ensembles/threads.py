"""How many threads to use."""

from __future__ import annotations

import os

from fastmech.ensembles import checks


def thread_count(threads: int | None) -> int:
    """Threads to use: as asked, else the processors that this process may run on.

    Raises:
        InputError: not an integer of at least 1.
    """
    if threads is not None:
        return checks.whole_number("threads", threads, least=1)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
