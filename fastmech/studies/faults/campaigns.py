"""Runs killed by SIGKILL, on file systems that fill up, with dying Dask workers; each is resumed to the end.

A campaign is given how often to interrupt, the undisturbed scan, the seed of moments or sizes, and a function
that is told of every interruption. Runs are processes that start at once: everything is loaded already.
"""

from __future__ import annotations

import multiprocessing
import os
import random
import signal
import subprocess
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from fastmech.runner import run_request
from fastmech.scan_types.request import RunContext
from fastmech.studies.faults.small_tiles import small_tiles
from fastmech.studies.faults.victim import IN_HAND, REQUEST, content_of, run_victim

#: Seconds after which a run that should have ended counts as hanging.
PATIENCE = 120.0

_CONTEXT = multiprocessing.get_context("forkserver")
_CONTEXT.set_forkserver_preload(["fastmech.studies.faults.victim"])


class FaultFound(AssertionError):  # noqa: N818 - what a campaign is there to find
    """A run did not keep what it promises."""


class CampaignFound(NamedTuple):
    """What a campaign has found: sentences for the user, figures for other programs."""

    sentences: tuple[str, ...]
    facts: dict[str, Any]


class KillPlace(NamedTuple):
    """A folder with a request, its result and a log."""

    folder: Path
    log: Path
    request: Path
    result: Path

    def lines(self) -> list[str]:
        """The log."""
        return self.log.read_text(encoding="utf-8").splitlines() if self.log.exists() else []

    def start(self) -> multiprocessing.context.ForkServerProcess:
        """Run the scan in a process of its own."""
        process = _CONTEXT.Process(target=run_victim, args=(str(self.folder), str(self.log)))
        process.start()
        return process

    def finish(self) -> str:
        """Run the scan to its end; the last line of the log."""
        process = self.start()
        process.join(PATIENCE)
        if process.exitcode is None:
            process.kill()
            raise FaultFound(f"a run hangs after {PATIENCE:g} s")
        if process.exitcode != 0:
            raise FaultFound(f"a run ended with code {process.exitcode}")
        return self.lines()[-1]


@contextmanager
def place() -> Iterator[KillPlace]:
    """A place with the request alone, removed in the end."""
    with tempfile.TemporaryDirectory(prefix="fastmech-faults-") as folder:
        inner = Path(folder) / "place"
        inner.mkdir()
        here = KillPlace(inner, Path(folder) / "log", inner / "scan.toml", inner / "scan.h5")
        here.request.write_text(REQUEST, encoding="utf-8")
        yield here


class Reference(NamedTuple):
    """The scan when nothing disturbs it."""

    content: dict[str, bytes]
    size: int  #: of the result [bytes]
    tiles: int
    seconds: float  #: wall time
    assembly: float  #: of it for the assembly


def reference() -> Reference:
    """Run the scan undisturbed, once to start everything and once to time it."""
    for _ in range(2):
        with place() as here:
            started = time.perf_counter()
            process = here.start()
            assembling = None
            while process.exitcode is None and time.perf_counter() < started + PATIENCE:
                if assembling is None and "stage assembling" in here.lines():
                    assembling = time.perf_counter()
                process.join(0.002)
            ended = time.perf_counter()
            if process.exitcode != 0 or assembling is None:
                raise FaultFound(f"the undisturbed run ended with code {process.exitcode}")
            tiles = sum(line.startswith("tile ") for line in here.lines())
            content, size = content_of(here.result), here.result.stat().st_size
            result = Reference(content, size, tiles, ended - started, ended - assembling)
    return result


def check_resumed(here: KillPlace, expected: Reference, what: str, interruptions: int = 1) -> int:
    """How many tiles were computed again, no more than were in hand.

    The result must be the undisturbed one, with nothing left beside it.
    """
    begun = [line for line in here.lines() if line.startswith("tile ")]
    again, most = len(begun) - len(set(begun)), IN_HAND * interruptions
    if again > most:
        raise FaultFound(f"{again} tiles were computed again, at most {most} were in hand")
    found = content_of(here.result)
    if found != expected.content:
        keys = found.keys() | expected.content.keys()
        differing = sorted(k for k in keys if found.get(k) != expected.content.get(k))
        raise FaultFound(f"{what}: the result differs in {', '.join(differing)}")
    left = sorted(path.name for path in here.folder.iterdir() if path.name not in ("scan.toml", "scan.h5"))
    if left:
        raise FaultFound(f"{what}: {', '.join(left)} were left behind")
    return again


def kill_campaign(kills: int, expected: Reference, seed: int, tell: Callable[[int], None]) -> CampaignFound:
    """Kill runs at random moments, every third while it assembles, and resume them to the end.

    Raises:
        FaultFound: a result differs, something is left behind, or more was computed again than was in hand.
    """
    rng, stages, finished, again = random.Random(seed), Counter[str](), 0, 0
    while stages.total() < kills:
        with place() as here:
            before = stages.total()
            for _ in range(rng.randint(1, 8)):
                stage = _killed_in(here, expected, rng)
                if not stage:
                    break
                stages[stage] += 1
                tell(1)
                if here.result.exists() and content_of(here.result) != expected.content:
                    raise FaultFound("a result that is not whole has its final name")
            here.finish()
            killed = stages.total() - before
            again += check_resumed(here, expected, f"after {killed} kills", killed)
            finished += 1
    while_doing = ", ".join(f"{name} {count}" for name, count in sorted(stages.items()))
    sentences = (
        f"{stages.total()} runs killed, {finished} scans resumed to the same result",
        f"  {again} tiles computed again; killed while {while_doing}",
    )
    return CampaignFound(sentences, {"killed": {"runs": stages.total(), "tiles_again": again, **stages}})


def _killed_in(here: KillPlace, expected: Reference, rng: random.Random) -> str:
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


def disk_campaign(runs: int, expected: Reference, seed: int, tell: Callable[[int], None]) -> CampaignFound:
    """Run on disks that are too small, then give them room and run again.

    Raises:
        FaultFound: the full disk is not told, a result differs, or what was finished is lost.
    """
    rng, full, fitting, again = random.Random(seed), 0, 0, 0
    needed = 2 * expected.size + 16384 * expected.tiles  # about what the tiles and the result take
    while full < runs:
        with place() as here, _small_disk(here.folder, rng.randint(16 << 10, needed)) as resize:
            here.request.write_text(REQUEST, encoding="utf-8")
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
    told = f"{full} full disks told, the scans resumed to the same result"
    sentences = (told, f"  {again} tiles computed again; {fitting} disks were large enough")
    return CampaignFound(sentences, {"full_disks": {"runs": full, "tiles_again": again}})


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


def worker_campaign(kills: int, expected: Reference, seed: int, tell: Callable[[int], None]) -> CampaignFound:
    """Run the scan on two local workers and kill one of them at a random moment, time and again.

    Raises:
        FaultFound: a result differs.
    """
    from distributed import Client, LocalCluster

    from fastmech.tiles.cluster import ClusterWorkers

    settings = {"dashboard_address": ":0", "silence_logs": 50, "preload": [small_tiles.__module__]}
    rng, killed, finished = random.Random(seed), list[int](), 0
    while len(killed) < kills:
        with (
            place() as here,
            small_tiles(),
            LocalCluster(n_workers=2, threads_per_worker=1, **settings) as cluster,
            Client(cluster, set_as_default=False) as client,
        ):
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
                run_request(here.request, here.result, context=RunContext(2), workers=ClusterWorkers(client))
            finally:
                ended.set()
                killer.join()
            if content_of(here.result) != expected.content:
                raise FaultFound("after a worker was killed the result differs")
            finished += 1
    sentence = f"{len(killed)} Dask workers killed, {finished} scans with the same result"
    return CampaignFound((sentence,), {"workers_killed": len(killed)})
