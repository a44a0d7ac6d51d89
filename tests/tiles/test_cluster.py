"""Tiles on Dask workers: the same bits, also when a worker dies."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from tiles.conftest import Run, content

from fastmech.errors import InputError
from fastmech.interrupts import CrashedTilesError
from fastmech.tiles.cluster import ClusterWorkers, cluster

dask = pytest.importorskip("dask")
distributed = pytest.importorskip("distributed")

# Dask's own warnings about its surroundings, such as few file descriptors, are no fault here.
pytestmark = pytest.mark.filterwarnings("default")


def test_a_worker_dies_and_the_result_is_the_same(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = {
        "dashboard_address": ":0",
        "silence_logs": 50,
        "preload": ["faults.small_tiles"],
    }
    monkeypatch.setattr("fastmech.scan_types.equilibrium_map.TILE_POINTS", 20)  # as on the workers
    whole = content(run("whole.h5").path)
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, **settings) as local,
        distributed.Client(local, set_as_default=False) as client,
    ):
        pids = list(client.run(os.getpid).values())
        killer = threading.Timer(0.05, os.kill, (pids[0], signal.SIGKILL))
        killer.start()
        report = run("a.h5", workers=ClusterWorkers(client))
        killer.join()
    assert content(report.path) == whole
    assert report.computed == report.tiles


#: A Dask worker that is started with this dies of the line's third tile.
ABORTS = """
import os
from fastmech.scan_types import equilibrium_map

def dask_setup(worker):
    compute = equilibrium_map.MapTiling.compute
    def aborting(self, index, context):
        if index == 2:
            os.abort()
        return compute(self, index, context)
    equilibrium_map.MapTiling.compute = aborting
"""


@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.slow
def test_a_tile_kills_its_worker_and_the_others_are_kept(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, workers: int
) -> None:
    monkeypatch.setattr("fastmech.scan_types.equilibrium_map.TILE_POINTS", 20)  # as on the workers
    (tmp_path / "aborts.py").write_text(ABORTS, encoding="utf-8")
    preload = ["faults.small_tiles", str(tmp_path / "aborts.py")]
    with (
        dask.config.set({"distributed.worker.preload": preload}),
        cluster(workers, None) as found,
        pytest.raises(CrashedTilesError) as crashed,
    ):
        run("a.h5", workers=found)
    found = re.fullmatch(
        r"1 of (\d+) tiles failed twice, the first with KilledWorker: its worker process died "
        r"\(alone: fastmech run \S+ --out \S+ --tile line:2 --keep tile\.h5\); (\d+) of \1 tiles are kept .*",
        str(crashed.value),
    )
    assert found is not None, crashed.value
    assert int(found[2]) == int(found[1]) - 1


def test_the_scheduler_dies_before_the_first_tile_is_back(
    run: Run, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0"]
    where = tmp_path / "scheduler.json"
    command += ["--no-dashboard", "--scheduler-file", str(where)]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL) as process:
        try:
            while not where.exists() or not where.read_text(encoding="utf-8"):
                time.sleep(0.1)
            address = json.loads(where.read_text(encoding="utf-8"))["address"]
            killer = threading.Timer(1.0, process.kill)
            with cluster(None, address) as found:
                killer.start()  # no worker is there, so that no tile comes back
                with pytest.raises(InputError) as lost:
                    run("a.h5", workers=found)
        finally:
            process.kill()
    assert str(lost.value) == "the connection to the Dask scheduler is lost"
    assert "Traceback" not in capfd.readouterr().err


def test_no_scheduler_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fastmech.tiles.cluster.PATIENCE", 1)
    refused = pytest.raises(InputError, match=r"^--scheduler tcp://127\.0\.0\.1:9: no Dask scheduler answers")
    with refused, cluster(None, "tcp://127.0.0.1:9"):
        pass
