"""Runs killed by SIGKILL, on file systems that fill up, with dying Dask workers; each is resumed to the end.

Runs are processes that start at once: everything is loaded already.
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
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from fastmech.ensembles.run import Progress
from fastmech.runner import run_request
from fastmech.scan_types.request import RunContext
from faults.small_tiles import small_tiles
from faults.victim import IN_HAND, REQUEST, content_of, run_victim

#: Seconds after which a run that should have ended counts as hanging.
PATIENCE = 120.0

_CONTEXT = multiprocessing.get_context("forkserver")
_CONTEXT.set_forkserver_preload(["faults.victim"])


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
        if process.exitcode != 0:
            process.kill()
            code = process.exitcode
            raise FaultFound("a run hangs" if code is None else f"a run ended with code {code}")
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
    size: int  #: about what the tiles and the result take [bytes]
    seconds: float  #: wall time


def reference() -> Reference:
    """Run the scan undisturbed, once to start everything and once to time it."""
    for _ in range(2):
        with place() as here:
            started = time.perf_counter()
            here.finish()
            seconds = time.perf_counter() - started
            tiles = sum(line.startswith("tile ") for line in here.lines())
            size = 2 * here.result.stat().st_size + 16384 * tiles
            result = Reference(content_of(here.result), size, seconds)
    return result


def check_resumed(here: KillPlace, expected: Reference, interruptions: int) -> int:
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
        raise FaultFound(f"the result differs in {', '.join(differing)}")
    left = sorted({path.name for path in here.folder.iterdir()} - {"scan.toml", "scan.h5"})
    if left:
        raise FaultFound(f"{', '.join(left)} were left behind")
    return again


@contextmanager
def _kills(here: KillPlace, expected: Reference, rng: random.Random) -> Iterator[Counter[str]]:
    """Runs killed at random moments, every third while it assembles: what they were doing."""
    stages = Counter[str]()
    for _ in range(rng.randint(1, 8)):
        seen = len(here.lines())
        process = here.start()
        if rng.random() < 1 / 3:
            while process.exitcode is None and "stage assembling" not in here.lines()[seen:]:
                time.sleep(0.001)
            time.sleep(rng.uniform(0.0, 0.2 * expected.seconds))
        else:
            time.sleep(rng.uniform(0.0, expected.seconds))
        process.kill()
        process.join()
        if process.exitcode != -signal.SIGKILL:  # it was faster
            break
        what = "starting" if len(here.lines()) == seen else here.lines()[-1].removeprefix("stage ")
        stages["computing" if what.startswith("tile ") else what] += 1
        if here.result.exists() and content_of(here.result) != expected.content:
            raise FaultFound("a result that is not whole has its final name")
    yield stages


#: Bytes that are always enough for the scan, its tiles and the result.
ENOUGH = 64 << 20


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


def can_mount() -> bool:
    """Whether this process may mount small file systems in memory."""
    try:
        with place() as here, _small_disk(here.folder, ENOUGH):
            return True
    except (OSError, subprocess.CalledProcessError):
        return False


@contextmanager
def _full_disk(here: KillPlace, expected: Reference, rng: random.Random) -> Iterator[Counter[str]]:
    """A run on a disk that may be too small, and then has room."""
    with _small_disk(here.folder, rng.randint(16 << 10, expected.size)) as resize:
        here.request.write_text(REQUEST, encoding="utf-8")
        outcome = here.finish()
        if outcome == "done":
            yield Counter()
            return
        if "No space left on device" not in outcome:
            raise FaultFound(f"a full disk was told as: {outcome}")
        if here.result.exists():
            raise FaultFound("on a full disk there is a result")
        resize(ENOUGH)
        yield Counter(writing=1)


@contextmanager
def _dead_worker(here: KillPlace, expected: Reference, rng: random.Random) -> Iterator[Counter[str]]:
    """The scan on two local workers, one of which is killed at a random moment."""
    from distributed import Client, LocalCluster

    from fastmech.tiles.cluster import ClusterWorkers

    settings = {"dashboard_address": ":0", "silence_logs": 50, "preload": [small_tiles.__module__]}
    with (
        small_tiles(),
        LocalCluster(n_workers=2, threads_per_worker=1, **settings) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        victim, killed = rng.choice(list(client.run(os.getpid).values())), Counter[str]()

        def kill() -> None:
            os.kill(victim, signal.SIGKILL)
            killed["computing"] += 1

        killer = threading.Timer(rng.uniform(0.0, expected.seconds), kill)
        killer.start()
        try:
            run_request(here.request, here.result, context=RunContext(2), workers=ClusterWorkers(client))
        finally:
            killer.cancel()
            killer.join()
    yield killed


#: An interruption of the scan at a place: what runs were doing, which may have been faster.
Interruption = Callable[[KillPlace, Reference, random.Random], AbstractContextManager[Counter[str]]]

#: Interruptions by the key of what is found, and how it is told.
INTERRUPTIONS: dict[str, tuple[str, Interruption]] = {
    "killed": ("runs killed", _kills),
    "full_disks": ("full disks told", _full_disk),
    "workers_killed": ("Dask workers killed", _dead_worker),
}


def campaign(name: str, count: int, expected: Reference, seed: int, tell: Progress) -> CampaignFound:
    """Interrupt scans so often and run them to the end; ``tell`` is told of the interruptions.

    Raises:
        FaultFound: a result differs, something is left behind, or more was computed again than was in hand.
    """
    rng, stages, finished, again = random.Random(seed), Counter[str](), 0, 0
    told, interrupt = INTERRUPTIONS[name]
    while stages.total() < count:
        with place() as here, interrupt(here, expected, rng) as found:
            here.finish()
            again += check_resumed(here, expected, found.total())
        stages += found
        finished += 1
        tell(found.total())
    while_doing = ", ".join(f"{doing} {number}" for doing, number in sorted(stages.items()))
    sentences = (
        f"{stages.total()} {told}, {finished} scans run to the same result",
        f"  {again} tiles computed again; interrupted while {while_doing}",
    )
    return CampaignFound(sentences, {name: {"runs": stages.total(), "tiles_again": again, **stages}})
