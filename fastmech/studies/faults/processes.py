"""Processes that start at once because everything is loaded already, to be killed."""

from __future__ import annotations

import multiprocessing
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from fastmech.studies.faults.victim import IN_HAND, REQUEST, computed_again, content_of, run_victim

#: Seconds after which a run that should have ended counts as hanging.
PATIENCE = 120.0

_CONTEXT = multiprocessing.get_context("forkserver")
_CONTEXT.set_forkserver_preload(["fastmech.studies.faults.victim"])


class FaultFound(AssertionError):  # noqa: N818 - what a campaign is there to find
    """A run did not keep what it promises."""


class Found(NamedTuple):
    """What a campaign has found: sentences for the user, figures for other programs."""

    sentences: tuple[str, ...]
    facts: dict[str, Any]


class Place(NamedTuple):
    """A folder with a request, its result and a log."""

    folder: Path
    log: Path

    @property
    def request(self) -> Path:
        """The request."""
        return self.folder / "scan.toml"

    @property
    def result(self) -> Path:
        """The result file."""
        return self.folder / "scan.h5"

    def begin(self) -> None:
        """Put the request there."""
        self.request.write_text(REQUEST, encoding="utf-8")

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
def place() -> Iterator[Place]:
    """An empty place, removed in the end."""
    with tempfile.TemporaryDirectory(prefix="fastmech-faults-") as folder:
        inner = Path(folder) / "place"
        inner.mkdir()
        yield Place(inner, Path(folder) / "log")


class Reference(NamedTuple):
    """The scan when nothing disturbs it: its content, its wall time, and that of the assembly [s]."""

    content: dict[str, bytes]
    tiles: int
    seconds: float
    assembly: float


def reference() -> Reference:
    """Run the scan undisturbed, once to start everything and once to time it."""
    for _ in range(2):
        with place() as here:
            here.begin()
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
            result = Reference(content_of(here.result), tiles, ended - started, ended - assembling)
    return result


def check_resumed(here: Place, expected: Reference, what: str, interruptions: int = 1) -> int:
    """How many tiles were computed again, no more than were in hand.

    The result must be the undisturbed one, with nothing left beside it.
    """
    again, most = computed_again(here.lines()), IN_HAND * interruptions
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
