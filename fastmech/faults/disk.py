"""Runs on file systems that fill up."""

from __future__ import annotations

import random
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from fastmech.faults.processes import FaultFound, Found, Reference, check_resumed, place

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


def disk_campaign(
    runs: int, expected: Reference, seed: int = 0, tell: Callable[[int], None] = lambda n: None
) -> Found:
    """Run on disks that are too small, then give them room and run again.

    Args:
        runs: how many must meet a full disk.
        expected: the undisturbed scan.
        seed: of the sizes.
        tell: is told of every full disk.

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
