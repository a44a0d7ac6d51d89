"""The scan that the fault campaigns interrupt: many small tiles, done in about a second."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

from fastmech.ensembles.run import Progress
from fastmech.errors import InputError
from fastmech.results import Variable
from fastmech.runner import run_request
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.request import RunContext
from fastmech.store.read import open_results
from fastmech.tiles.section import code_in_use
from fastmech.tiles.tile_file import Tile
from fastmech.tiles.work import ThreadWorkers, TileTask
from faults.small_tiles import dask_setup

REQUEST = """
title = "a scan to be interrupted"
[scene]
alpha = 0.0
[scan.rest]
kind = "equilibria"
[scan.swing]
kind = "motion"
t_end = 1.0
[scan.map]
kind = "equilibrium_map"
axes.F0 = { start = -400.0, stop = 400.0, num = 24 }
axes.c1 = { start = 0.0, stop = 400.0, num = 5 }
axes.c2 = { start = 1.0, stop = 900.0, num = 4 }
[scan.line]
kind = "equilibrium_map"
axes.c2 = { start = 1.0, stop = 900.0, num = 100 }
[scan.shocks]
kind = "disturbed"
trajectories = 600
t_end = 1.0
linear_directions = 6
[scan.shock]
kind = "disturbed_motion"
t_end = 0.1
outputs = 11
[scan.snap]
kind = "snap"
[scan.basins]
kind = "basins"
t_end = 1.0
axes.phi = { start = -1.0, stop = 1.0, num = 4 }
axes.theta = { start = -1.0, stop = 1.0, num = 10 }
"""

#: Threads of a run.
THREADS = 2

#: Tiles that may be in hand when a run is killed: at work, or waiting to be written.
IN_HAND = THREADS + 1

#: Attributes that say when and where a result was made, not what it is.
CIRCUMSTANCES = ("created", "history", "wall_time_s")


scan_kinds()  # loads all kernels: a process forked from here starts at once
code_in_use()


def run_victim(folder: str, log: str) -> None:
    """Run the scan in a process of its own.

    Args:
        folder: where ``scan.toml`` is and ``scan.h5`` is to be.
        log: file that is told, a line each, which tiles begin and which stages; in the end the outcome.
    """
    descriptor = os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)

    def note(line: str) -> None:
        os.write(descriptor, f"{line}\n".encode())

    def stage(name: str, total: int) -> Progress:
        note(f"stage {name}")
        return lambda finished: None

    dask_setup()
    request, out = Path(folder) / "scan.toml", Path(folder) / "scan.h5"
    try:
        run_request(request, out, context=RunContext(THREADS, stage), workers=_NotedWorkers(note))
    except InputError as error:
        note(f"refused {error}")
    else:
        note("done")


class _NotedWorkers(ThreadWorkers):
    def __init__(self, note: Callable[[str], None]) -> None:
        self._note = note

    def submit(self, task: TileTask) -> Future[Tile]:
        self._note(f"tile {task.section.name}:{task.index}")
        return super().submit(task)


def content_of(path: Path) -> dict[str, bytes]:
    """All values and attributes of a result file, but for the circumstances."""
    with open_results(path) as results:
        content = _attributes("", results.attrs)
        for name in results.groups:
            content |= _attributes(name, results[name].attrs)
            content |= {
                f"{name}/{variable}": values_of(results[name][variable]) for variable in results[name]
            }
    return content


def values_of(variable: Variable) -> bytes:
    """Values, type, shape and unit of a variable."""
    data = variable.data
    raw = repr(data.tolist()).encode() if data.dtype == object else data.tobytes()
    return repr((variable.dims, data.dtype.str, data.shape, variable.units)).encode() + raw


def _attributes(where: str, attrs: dict[str, Any]) -> dict[str, bytes]:
    return {f"{where}@{name}": repr(attrs[name]).encode() for name in attrs if name not in CIRCUMSTANCES}
