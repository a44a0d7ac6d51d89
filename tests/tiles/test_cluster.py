"""Tiles on Dask workers: the same bits, also when a worker dies."""

from __future__ import annotations

import os
import signal
import threading

import pytest
from tiles.conftest import Run, content

from fastmech.errors import InputError
from fastmech.tiles.cluster import ClusterHiring, cluster

distributed = pytest.importorskip("distributed")

# Dask's own warnings about its surroundings, such as few file descriptors, are no fault here.
pytestmark = pytest.mark.filterwarnings("default")


def test_a_worker_dies_and_the_result_is_the_same(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = {"dashboard_address": ":0", "silence_logs": 50, "preload": ["fastmech.faults.small_tiles"]}
    monkeypatch.setattr("fastmech.scan_types.map_tiling.TILE_POINTS", 20)  # as on the workers
    whole = content(run("whole.h5").path)
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, **settings) as local,
        distributed.Client(local, set_as_default=False) as client,
    ):
        pids = list(client.run(os.getpid).values())
        killer = threading.Timer(0.05, os.kill, (pids[0], signal.SIGKILL))
        killer.start()
        report = run("a.h5", hire=ClusterHiring(client))
        killer.join()
    assert content(report.path) == whole
    assert report.computed == report.tiles


def test_no_scheduler_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fastmech.tiles.cluster.PATIENCE", 1)
    refused = pytest.raises(InputError, match=r"^--scheduler tcp://127\.0\.0\.1:9: no Dask scheduler answers")
    with refused, cluster(None, "tcp://127.0.0.1:9"):
        pass
