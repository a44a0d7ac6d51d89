"""Tiles on a Dask cluster: in processes of this machine, or wherever a scheduler has workers."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from fastmech.errors import InputError
from fastmech.scan_types.request import RunContext
from fastmech.tiles.identity import code_in_use
from fastmech.tiles.tile_file import Tile
from fastmech.tiles.work import Task, Workers

if TYPE_CHECKING:
    from distributed import Client

#: Tiles in all queues for each thread of the workers: one at work, one to go on with.
DEPTH = 2

#: Seconds after which the workers are counted again.
PERIOD = 2.0

#: Seconds to wait for a scheduler.
PATIENCE = 20

#: Where Dask keeps the environment of its workers, and what is changed there: Dask has freed arrays returned
#: to the operating system at once, which costs a map a third of its time.
_ENVIRONMENT = "distributed.nanny.pre-spawn-environ"
_ALLOCATION = {"MALLOC_TRIM_THRESHOLD_": 1 << 25, "MALLOC_MMAP_THRESHOLD_": 1 << 25}


class ClusterWorkers:
    """The workers of a Dask cluster, of which some may come or go.

    Args:
        client: connected to the scheduler.
        executor: the client's.
    """

    def __init__(self, client: Client, executor: Executor) -> None:
        self._client, self._executor = client, executor
        self._asked, self._threads = -math.inf, 0

    @property
    def slots(self) -> int:
        """Tiles to hand out at a time, by the threads that the cluster has now."""
        now = time.monotonic()
        if now - self._asked > PERIOD:
            self._asked, self._threads = now, sum(self._client.nthreads().values())
        return DEPTH * max(1, self._threads)

    def submit(self, task: Task) -> Future[Tile]:
        """Send the tile to a worker; it runs in one thread there."""
        return self._executor.submit(_compute, task, code_in_use())


class ClusterHiring:
    """Hires whoever is in a Dask cluster.

    Args:
        client: connected to the scheduler.
    """

    together = True

    def __init__(self, client: Client) -> None:
        self._client = client

    @contextmanager
    def __call__(self, tasks: Sequence[Task], context: RunContext) -> Iterator[Workers]:
        """All workers."""
        executor = self._client.get_executor(pure=False)
        try:
            yield ClusterWorkers(self._client, executor)
        finally:
            executor.shutdown(wait=False)


def _compute(task: Task, code: dict[str, str]) -> Tile:
    """Compute a tile, on the worker."""
    mine = code_in_use()
    if mine != code:
        differing = ", ".join(name for name in code if mine.get(name) != code[name])
        raise InputError(f"a Dask worker has another version than this process of: {differing}")
    return task.section.compute(task.index, RunContext(threads=1))


@contextmanager
def cluster(workers: int | None, scheduler: str | None) -> Iterator[ClusterHiring]:
    """A cluster to compute tiles.

    Args:
        workers: number of processes of one thread on this machine, or
        scheduler: address of a scheduler that runs already, such as ``tcp://host:8786``.

    Raises:
        InputError: Dask is not installed, or no scheduler answers.
    """
    try:
        import dask.config
        from distributed import Client, LocalCluster
    except ImportError:
        raise InputError(
            "--workers and --scheduler need Dask; install it with: pip install 'fastmech[distributed]'"
        ) from None
    settings: dict[str, Any] = {"timeout": PATIENCE, "set_as_default": False}
    try:
        if scheduler is None:
            with dask.config.set({_ENVIRONMENT: {**dask.config.get(_ENVIRONMENT), **_ALLOCATION}}):
                local = LocalCluster(
                    n_workers=workers, threads_per_worker=1, dashboard_address=":0", silence_logs=50
                )
        else:
            local = None
        client = Client(local if local is not None else scheduler, **settings)
    except (OSError, ValueError) as error:
        raise InputError(f"--scheduler {scheduler}: no Dask scheduler answers: {error}") from None
    try:
        yield ClusterHiring(client)
    finally:
        client.close()
        if local is not None:
            local.close()
