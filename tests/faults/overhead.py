"""What durability and Dask cost: the same scan all ways, in turns, as ratios of wall times."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import repeat
from pathlib import Path
from tempfile import TemporaryDirectory

from fastmech.ensembles.run import Progress
from fastmech.results import scene_parameters
from fastmech.runner import run_request
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.request import RunContext, read_request
from fastmech.store.provenance import provenance
from fastmech.store.write import write_results
from fastmech.studies.reporting import in_turns
from fastmech.tiles.cluster import cluster
from fastmech.tiles.section import assembled, sections_of
from faults.campaigns import CampaignFound

#: Threads, and workers of the cluster.
WORKERS = 2

#: Times that each way is taken, after one that warms up, and runs in all.
REPEATS = 3
RUNS = 3 * (REPEATS + 1)

#: A map, whose tiles are large for the time they take: durability costs most there.
REQUEST = """
[scene]
alpha = 0.0
[scan.map]
kind = "equilibrium_map"
axes.F0 = {{ start = -400.0, stop = 400.0, num = {num} }}
axes.c1 = {{ start = 0.0, stop = 400.0, num = 500 }}
variables = ["count", "count_stable", "outcome", "coincidence", "phi", "theta", "morse_index", "energy",
             "decay_time", "depth"]
"""

#: Points a side of the map from whose time that of others is guessed.
CALIBRATION = 400

#: What is compared.
PAIRS = (
    ("durable over in memory", "durable", "in memory"),
    (f"{WORKERS} Dask workers over {WORKERS} threads", "Dask", "durable"),
)


def overheads(seconds: float, tell: Progress = lambda n: None) -> CampaignFound:
    """Measure all, in scans of about so many seconds; ``tell`` is told of each of the ``RUNS``."""
    with TemporaryDirectory(prefix="fastmech-overhead-") as folder, cluster(WORKERS, None) as workers:
        request, out = Path(folder) / "scan.toml", Path(folder) / "scan.h5"
        durably = partial(run_request, request, out, fresh=True, context=RunContext(WORKERS))
        num = CALIBRATION
        for _ in range(2):  # the first time loads everything
            request.write_text(REQUEST.format(num=num), encoding="utf-8")
            began = time.perf_counter()
            durably()
            num = max(CALIBRATION, round(num * seconds / (time.perf_counter() - began)))
        ways: dict[str, Callable[[], object]] = {
            "in memory": partial(in_memory, request, out),
            "durable": durably,
            "Dask": partial(durably, workers=workers),
        }
        taken, _ = in_turns(ways, REPEATS, tell, time.perf_counter)
    sentences, facts = [], {}
    for what, one, other in PAIRS:
        ratios = [a / b for a, b in zip(taken[one], taken[other], strict=True)]
        mean, error = statistics.mean(ratios), statistics.stdev(ratios) / REPEATS**0.5
        of = f"(of {statistics.mean(taken[other]):.0f} s, {REPEATS} turns)"
        sentences.append(f"{what}: {mean:.3f} ± {error:.3f} {of}")
        facts[what] = [mean, error]
    return CampaignFound(tuple(sentences), facts)


def in_memory(path: Path, out: Path) -> None:
    """The scan without durability: the same tiles in as many threads, held in memory, and the same file."""
    request, sections = read_request(path, scan_kinds()), {}
    for section in sections_of(request):
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
