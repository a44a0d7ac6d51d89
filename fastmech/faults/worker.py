"""Workers of a Dask cluster killed while they compute."""

from __future__ import annotations

import os
import random
import signal
import threading
from collections.abc import Callable
from dataclasses import dataclass

from fastmech.faults.processes import FaultFound, Reference, place
from fastmech.faults.small_tiles import small_tiles
from fastmech.faults.victim import content_of
from fastmech.runner import run_request
from fastmech.scan_types.request import RunContext


@dataclass
class WorkerReport:
    """What a campaign has found.

    Attributes:
        kills: workers that were killed.
        finished: scans that came to their end all the same.
    """

    kills: int = 0
    finished: int = 0


def worker_campaign(
    kills: int, expected: Reference, seed: int = 0, tell: Callable[[int], None] = lambda n: None
) -> WorkerReport:
    """Run the scan on two local workers and kill one of them at a random moment, time and again.

    Args:
        kills: how many.
        expected: the undisturbed scan.
        seed: of the moments.
        tell: is told of every kill.

    Raises:
        FaultFound: a result differs.
    """
    from distributed import Client, LocalCluster

    from fastmech.tiles.cluster import ClusterHiring

    settings = {"dashboard_address": ":0", "silence_logs": 50, "preload": ["fastmech.faults.small_tiles"]}
    rng, report = random.Random(seed), WorkerReport()
    while report.kills < kills:
        with (
            place() as here,
            small_tiles(),
            LocalCluster(n_workers=2, threads_per_worker=1, **settings) as cluster,
            Client(cluster, set_as_default=False) as client,
        ):
            here.begin()
            pids = list(client.run(os.getpid).values())
            ended = threading.Event()

            def kill(ended: threading.Event = ended, victim: int = rng.choice(pids)) -> None:
                if not ended.wait(rng.uniform(0.0, expected.seconds)):
                    os.kill(victim, signal.SIGKILL)
                    report.kills += 1
                    tell(1)

            killer = threading.Thread(target=kill)
            killer.start()
            try:
                run_request(
                    here.folder / "scan.toml", here.result, context=RunContext(2), hire=ClusterHiring(client)
                )
            finally:
                ended.set()
                killer.join()
            if content_of(here.result) != expected.content:
                raise FaultFound("after a worker was killed the result differs")
            report.finished += 1
    return report
