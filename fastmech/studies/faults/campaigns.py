"""Runs killed by SIGKILL, on file systems that fill up, with dying Dask workers; each is resumed to the end.

A campaign is given how often to interrupt, the undisturbed scan, the seed of moments or sizes, and a function
that is told of every interruption.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from fastmech.runner import run_request
from fastmech.scan_types.request import RunContext
from fastmech.studies.faults.processes import FaultFound, Found, Place, Reference, check_resumed, place
from fastmech.studies.faults.small_tiles import small_tiles
from fastmech.studies.faults.victim import content_of


def kill_campaign(kills: int, expected: Reference, seed: int, tell: Callable[[int], None]) -> Found:
    """Kill runs at random moments, every third while it assembles, and resume them to the end.

    Raises:
        FaultFound: a result differs, something is left behind, or more was computed again than was in hand.
    """
    rng, stages, finished, again = random.Random(seed), Counter[str](), 0, 0
    while stages.total() < kills:
        with place() as here:
            here.begin()
            before = stages.total()
            for _ in range(rng.randint(1, 8)):
                stage = _killed_in(here, expected, rng)
                if not stage:
                    break
                stages[stage] += 1
                tell(1)
                _nothing_broken(here, expected)
            here.finish()
            killed = stages.total() - before
            again += check_resumed(here, expected, f"after {killed} kills", killed)
            finished += 1
    while_doing = ", ".join(f"{name} {count}" for name, count in sorted(stages.items()))
    sentences = (
        f"{stages.total()} runs killed, {finished} scans resumed to the same result",
        f"  {again} tiles computed again; killed while {while_doing}",
    )
    return Found(sentences, {"killed": {"runs": stages.total(), "tiles_again": again, **stages}})


def _killed_in(here: Place, expected: Reference, rng: random.Random) -> str:
    """Start a run and kill it; what it was doing, empty where it was faster."""
    seen = len(here.lines())
    process = here.start()
    if rng.random() < 1 / 3:
        while process.exitcode is None and "stage assembling" not in here.lines()[seen:]:
            time.sleep(0.001)
        time.sleep(rng.uniform(0.0, expected.assembly))
    else:
        time.sleep(rng.uniform(0.0, expected.seconds - expected.assembly))
    if process.exitcode is not None:
        return ""
    process.kill()
    process.join()
    if process.exitcode == 0:
        return ""
    what = "starting" if len(here.lines()) == seen else here.lines()[-1].removeprefix("stage ")
    return "computing" if what.startswith("tile ") else what


def _nothing_broken(here: Place, expected: Reference) -> None:
    """Under the final name there is nothing or the whole result."""
    if here.result.exists() and content_of(here.result) != expected.content:
        raise FaultFound("a result that is not whole has its final name")


#: Bytes that are always enough for the scan, its tiles and the result.
ENOUGH = 64 << 20


def can_mount() -> bool:
    """Whether this process may mount small file systems in memory."""
    with place() as here:
        try:
            with _small_disk(here.folder, ENOUGH):
                return True
        except (OSError, subprocess.CalledProcessError):
            return False


def disk_campaign(runs: int, expected: Reference, seed: int, tell: Callable[[int], None]) -> Found:
    """Run on disks that are too small, then give them room and run again.

    Raises:
        FaultFound: the full disk is not told, a result differs, or what was finished is lost.
    """
    rng, full, fitting, again = random.Random(seed), 0, 0, 0
    needed = _room_needed(expected)
    while full < runs:
        with place() as here, _small_disk(here.folder, rng.randint(16 << 10, needed)) as resize:
            here.begin()
            outcome = here.finish()
            if outcome == "done":
                fitting += 1
                continue
            if "No space left on device" not in outcome:
                raise FaultFound(f"a full disk was told as: {outcome}")
            if here.result.exists():
                raise FaultFound("on a full disk there is a result")
            full += 1
            tell(1)
            resize(ENOUGH)
            here.finish()
            again += check_resumed(here, expected, "after a full disk")
    sentences = (
        f"{full} full disks told, the scans resumed to the same result",
        f"  {again} tiles computed again; {fitting} disks were large enough",
    )
    return Found(sentences, {"full_disks": {"runs": full, "tiles_again": again}})


def _room_needed(expected: Reference) -> int:
    """Bytes that the tiles and the result take, about."""
    with place() as here:
        here.begin()
        here.finish()
        result = here.result.stat().st_size
    blocks = expected.tiles * 16384
    return 2 * result + blocks


@contextmanager
def _small_disk(folder: Path, size: int) -> Iterator[Callable[[int], None]]:
    def mount(*options: str) -> None:
        command = ["mount", "-t", "tmpfs", "-o", ",".join(options), "fastmech-faults", str(folder)]
        subprocess.run(command, check=True, capture_output=True)

    mount(f"size={size}")
    try:
        yield lambda larger: mount("remount", f"size={larger}")
    finally:
        subprocess.run(["umount", str(folder)], check=True, capture_output=True)


def worker_campaign(kills: int, expected: Reference, seed: int, tell: Callable[[int], None]) -> Found:
    """Run the scan on two local workers and kill one of them at a random moment, time and again.

    Raises:
        FaultFound: a result differs.
    """
    from distributed import Client, LocalCluster

    from fastmech.tiles.cluster import ClusterHiring

    settings = {
        "dashboard_address": ":0",
        "silence_logs": 50,
        "preload": ["fastmech.studies.faults.small_tiles"],
    }
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
