"""Tiles on a Dask cluster: in processes of this machine, or wherever a scheduler has workers."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager, nullcontext, suppress
from typing import TYPE_CHECKING, Any

from fastmech.errors import InputError
from fastmech.scan_types.request import RunContext
from fastmech.tiles.section import code_in_use
from fastmech.tiles.tile_file import Tile
from fastmech.tiles.work import LOST, PERIOD, TileTask

if TYPE_CHECKING:
    from distributed import Client

#: Tiles in all queues for each thread of the workers: one at work, one to go on with.
DEPTH = 2

#: Seconds to wait for a scheduler.
PATIENCE = 20

#: Seconds to wait for the next worker after the last one is gone.
WITHOUT = 60.0

#: Where Dask keeps the environment of its workers, and what is changed there: Dask has freed arrays returned
#: to the operating system at once, which costs a map a third of its time.
_ENVIRONMENT = "distributed.nanny.pre-spawn-environ"
_ALLOCATION = {"MALLOC_TRIM_THRESHOLD_": 1 << 25, "MALLOC_MMAP_THRESHOLD_": 1 << 25}

#: How this machine's own workers may die: at the first death their tiles come back as failed (otherwise at
#: the fourth), and a worker is started again however often it dies (otherwise Dask gives it up for good if,
#: 15 s after one death, it is just starting again after another).
_DEATHS = {"distributed.scheduler.allowed-failures": 0, "distributed.deploy.lost-worker-timeout": "1000 days"}

#: Loggers of Dask, of which some have handlers and levels of their own.
_LOGGERS = ("distributed", "distributed.client", "distributed.core", "tornado.application")


class ClusterWorkers:
    """The workers of a Dask cluster, of which some may come or go."""

    together = True
    deaths: tuple[type[Exception], ...]

    def __init__(self, client: Client) -> None:
        from distributed import KilledWorker

        self.deaths, self._client = (KilledWorker,), client
        self._asked, self._threads = -math.inf, 0
        self._seen = math.inf  # when there were workers last; they may take any time to come at first

    @contextmanager
    def hired(self, tasks: Sequence[TileTask], context: RunContext) -> Iterator[None]:
        """All that there are."""
        self._executor = self._client.get_executor(pure=False)
        try:
            yield
        finally:
            with suppress(OSError):  # a scheduler that is gone has nothing to cancel
                self._executor.shutdown(wait=False)

    @property
    def slots(self) -> int:
        """Tiles to hand out at a time, by the threads that the cluster has now.

        Raises:
            InputError: the scheduler cannot be reached, or the workers have gone and none comes.
        """
        now = time.monotonic()
        if now - self._asked >= PERIOD:
            with _connected():
                self._asked, self._threads = now, sum(self._client.nthreads().values())
            if self._threads:
                self._seen = now
            elif now - self._seen > WITHOUT:
                raise InputError(f"the Dask scheduler has had no worker for {WITHOUT:g} s")
        return DEPTH * max(1, self._threads)

    def submit(self, task: TileTask) -> Future[Tile]:
        """Send the tile to a worker; it runs in one thread there.

        Raises:
            InputError: the scheduler cannot be reached.
        """
        with _connected():
            sent: Future[Tile] = self._executor.submit(_compute, task, code_in_use())
            return sent


def _compute(task: TileTask, code: dict[str, str]) -> Tile:
    """Compute a tile, on the worker."""
    mine = code_in_use()
    if mine != code:
        differing = ", ".join(name for name in code if mine.get(name) != code[name])
        raise InputError(f"a Dask worker has another version than this process of: {differing}")
    return task.section.compute(task.index, RunContext(threads=1))


@contextmanager
def _connected() -> Iterator[None]:
    """Say what it means if Dask cannot send; its OSErrors are not those of a file."""
    try:
        yield
    except OSError:
        raise InputError(LOST) from None


@contextmanager
def _silent() -> Iterator[None]:
    """Keep Dask from writing about what is told in one line here."""
    levels = {logger: logger.level for logger in map(logging.getLogger, _LOGGERS)}
    for logger in levels:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in levels.items():
            logger.setLevel(level)


@contextmanager
def cluster(workers: int | None, scheduler: str | None) -> Iterator[ClusterWorkers]:
    """A cluster to compute tiles: processes of one thread here, or a ``scheduler`` such as tcp://host:8786.

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
    environment = {_ENVIRONMENT: {**dask.config.get(_ENVIRONMENT), **_ALLOCATION}}
    # The settings are looked up whenever a worker dies, so they hold for the whole time.
    with _silent(), dask.config.set({**environment, **_DEATHS}) if scheduler is None else nullcontext():
        try:
            local: Any = scheduler or LocalCluster(
                n_workers=workers, threads_per_worker=1, dashboard_address=":0", silence_logs=50
            )
            client = Client(local, **settings)
        except (OSError, ValueError) as error:
            raise InputError(f"--scheduler {scheduler}: no Dask scheduler answers: {error}") from None
        try:
            yield ClusterWorkers(client)
        finally:
            client.close()
            if scheduler is None:
                local.close()
