"""Workers of a Dask cluster killed while they compute."""

from __future__ import annotations

import os
import random
import signal
import threading
from collections.abc import Callable

from fastmech.faults.processes import FaultFound, Found, Reference, place
from fastmech.faults.small_tiles import small_tiles
from fastmech.faults.victim import content_of
from fastmech.runner import run_request
from fastmech.scan_types.request import RunContext


def worker_campaign(
    kills: int, expected: Reference, seed: int = 0, tell: Callable[[int], None] = lambda n: None
) -> Found:
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
    rng, killed, finished = random.Random(seed), list[int](), 0
    while len(killed) < kills:
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
                    killed.append(victim)
                    tell(1)

            killer = threading.Thread(target=kill)
            killer.start()
            try:
                run_request(here.request, here.result, context=RunContext(2), hire=ClusterHiring(client))
            finally:
                ended.set()
                killer.join()
            if content_of(here.result) != expected.content:
                raise FaultFound("after a worker was killed the result differs")
            finished += 1
    sentence = f"{len(killed)} Dask workers killed, {finished} scans with the same result"
    return Found((sentence,), {"workers_killed": len(killed)})
