"""What durability and Dask cost: the same scan both ways, in turn, as ratios of wall times."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import repeat
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from fastmech.results import scene_parameters
from fastmech.runner import run_request
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.request import RunContext, read_request
from fastmech.store.provenance import provenance
from fastmech.store.write import write_results
from fastmech.tiles.cluster import cluster
from fastmech.tiles.section import asked_for, assembled, identity_of, sections_of

#: Threads, and workers of the cluster.
WORKERS = 2

#: Times that each way is taken.
REPEATS = 3

#: A map, whose tiles are large for the time they take: durability costs most there.
_REQUEST = """
[scene]
alpha = 0.0
[scan.map]
kind = "equilibrium_map"
axes.F0 = {{ start = -400.0, stop = 400.0, num = {num} }}
axes.c1 = {{ start = 0.0, stop = 400.0, num = 500 }}
variables = ["count", "count_stable", "outcome", "coincidence", "phi", "theta", "morse_index", "energy",
             "decay_time", "depth"]
"""

_CALIBRATION = 400

Run = Callable[[], object]


class Ratio(NamedTuple):
    """One way's wall time over another's."""

    what: str  #: which ways
    value: float  #: mean of the ratios of runs that followed one another
    error: float  #: its standard error
    seconds: float  #: mean wall time of the other way [s]

    def __str__(self) -> str:
        return f"{self.what}: {self.value:.3f} ± {self.error:.3f} (of {self.seconds:.0f} s, {REPEATS} pairs)"


def overheads(seconds: float, tell: Callable[[int], None] = lambda n: None) -> list[Ratio]:
    """Measure both, in scans of about so many seconds; ``tell`` is told of each of the ``4 * REPEATS`` runs.

    The scan without durability computes the same tiles in as many threads, holds them in memory and writes
    the same file.
    """
    with TemporaryDirectory(prefix="fastmech-overhead-") as folder, cluster(WORKERS, None) as workers:
        request, out = Path(folder) / "scan.toml", Path(folder) / "scan.h5"

        durably = partial(run_request, request, out, fresh=True, context=RunContext(WORKERS))
        by_dask = partial(durably, workers=workers)
        num = _CALIBRATION
        for _ in range(2):  # the first time also warms up
            request.write_text(_REQUEST.format(num=num), encoding="utf-8")
            by_dask()
            num = max(_CALIBRATION, round(num * seconds / _seconds(durably)))
        return [
            _ratio("durable over in memory", durably, partial(_in_memory, request, out), tell),
            _ratio(f"{WORKERS} Dask workers over {WORKERS} threads", by_dask, durably, tell),
        ]


def _in_memory(path: Path, out: Path) -> None:
    """The scan without durability."""
    request = read_request(path, scan_kinds())
    sections = {}
    for section in sections_of(request, identity_of(asked_for(request))):
        with ThreadPoolExecutor(WORKERS) as pool:
            contexts = repeat(RunContext(1))
            tiles = list(pool.map(section.tiling.compute, range(section.tiling.count), contexts))
        sections[section.name] = assembled(section, tiles.__getitem__, 0.0)
    write_results(
        out,
        scene_parameters=scene_parameters(request.scene),
        sections=sections,
        attrs=lambda: {**provenance(WORKERS), "title": request.title},
        replace=True,
        threads=WORKERS,
    )


def _ratio(what: str, one: Run, other: Run, tell: Callable[[int], None]) -> Ratio:
    ratios, seconds = [], []
    for turn in range(REPEATS):
        taken = {}
        for way in (one, other) if turn % 2 else (other, one):
            taken[way] = _seconds(way)
            tell(1)
        ratios.append(taken[one] / taken[other])
        seconds.append(taken[other])
    error = statistics.stdev(ratios) / REPEATS**0.5
    return Ratio(what, statistics.mean(ratios), error, statistics.mean(seconds))


def _seconds(run: Run) -> float:
    started = time.perf_counter()
    run()
    return time.perf_counter() - started
