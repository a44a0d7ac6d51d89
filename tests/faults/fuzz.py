"""Requests and result files with bytes flipped, lost, added or copied, read as a user's would be."""

from __future__ import annotations

import random
import resource
import signal
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from types import FrameType

from fastmech.ensembles.run import Progress
from fastmech.errors import InputError
from fastmech.runner import run_request
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.request import read_request
from fastmech.store.read import open_results
from faults.campaigns import CampaignFound, FaultFound
from faults.victim import REQUEST, content_of, values_of

#: Seconds after which reading a file counts as hanging.
PATIENCE = 20

#: Bytes by which reading damaged files may let the process grow.
GROWTH = 512 << 20

#: A request whose result has variables of every kind: scalars, texts, flags, small and chunked arrays.
SMALL = """
[scene]
alpha = 0.0
[scan.rest]
kind = "equilibria"
[scan.line]
kind = "equilibrium_map"
axes.c2 = { start = 1.0, stop = 900.0, num = 200 }
variables = ["count", "outcome", "phi"]
"""


def fuzz_requests(count: int, seed: int, tell: Progress = lambda n: None) -> CampaignFound:
    """Read so many damaged scan files; ``tell`` is told of each.

    Raises:
        FaultFound: one was refused otherwise than by an `InputError` of one line, hung or took much memory.
    """
    texts = [REQUEST.encode(), *(path.read_bytes() for path in sorted(Path("scans").glob("*.toml")))]

    def read(path: Path) -> None:
        for name in read_request(path, scan_kinds()).scans:
            if Path(name).name != name or name in (".", ".."):
                raise FaultFound(f"the section {name!r} would leave the folder of the result")

    return _fuzz("requests", texts, read, count, seed, tell=tell)


def fuzz_results(count: int, seed: int, tell: Progress = lambda n: None) -> CampaignFound:
    """Read damaged result files, every variable of them: it is refused, or has the undamaged values.

    Args and errors as of `fuzz_requests`.
    """
    with tempfile.TemporaryDirectory() as folder:
        request, result = Path(folder) / "scan.toml", Path(folder) / "scan.h5"
        request.write_text(SMALL, encoding="utf-8")
        run_request(request, result)
        image, whole = result.read_bytes(), content_of(result)

    def read(path: Path) -> None:
        refusal = None
        with open_results(path) as results:
            for where in [f"{name}/{one}" for name in results.groups for one in results[name]]:
                group, _, variable = where.rpartition("/")
                try:
                    if values_of(results[group][variable]) != whole.get(where):
                        raise FaultFound(f"{where} was read with other values")
                except InputError as error:
                    refusal = error
        if refusal is not None:
            raise refusal

    return _fuzz("result files", [image], read, count, seed, tell=tell)


def damaged(data: bytes, rng: random.Random) -> bytes:
    """A copy with one to four places flipped, overwritten, cut out, doubled or filled, or its end cut off."""
    copy = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        place = rng.randrange(max(len(copy), 1))
        here = slice(place, place + rng.choice((1, 1, 4, 64)))
        part = bytes(copy[here])
        flipped = bytes(byte ^ 1 << rng.randrange(8) for byte in part[:1]) + part[1:]
        instead = (flipped, rng.randbytes(len(part)), b"", part + part, b"\xff" * len(part), None)
        match rng.choice(instead):
            case None:
                del copy[place:]
            case other:
                copy[here] = other
    return bytes(copy)


def _fuzz(
    what: str, originals: list[bytes], read: Callable[[Path], None], count: int, seed: int, tell: Progress
) -> CampaignFound:
    rng, refused, slowest, grown, before = random.Random(seed), 0, 0.0, 0, _memory()
    previous = signal.signal(signal.SIGALRM, _too_long)
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "file"
            for number in range(count):
                path.write_bytes(damaged(rng.choice(originals), rng))
                started = time.perf_counter()
                signal.alarm(PATIENCE)
                try:
                    read(path)
                except InputError as error:
                    refused += 1
                    if "\n" in str(error):
                        raise FaultFound(f"number {number}: not one line: {error}") from None
                except FaultFound:
                    raise
                except BaseException as error:
                    raise FaultFound(f"number {number}: {type(error).__name__}: {error}") from error
                finally:
                    signal.alarm(0)
                slowest, grown = max(slowest, time.perf_counter() - started), _memory() - before
                tell(1)
                if grown > GROWTH:
                    raise FaultFound(f"number {number}: the process grew by {grown / 1e6:.0f} MB")
    finally:
        signal.signal(signal.SIGALRM, previous)
    sentences = (
        f"{count} damaged {what} read: {refused} refused, none crashed",
        f"  slowest {slowest:.2f} s, memory grew by {grown / 1e6:.0f} MB",
    )
    return CampaignFound(sentences, {what: {"tried": count, "refused": refused}})


def _too_long(number: int, frame: FrameType | None) -> None:
    raise FaultFound(f"hung for {PATIENCE} s")


def _memory() -> int:
    """Largest memory of this process so far [bytes]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
