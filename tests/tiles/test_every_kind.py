"""Every kind of scan there is: many tiles, in any order and after any interruption the same bits."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from faults.small_tiles import small_tiles
from scan_types.values import run_scan
from tiles.conftest import content
from tiles.test_run import stopped_after

from fastmech.interrupts import Stopped
from fastmech.runner import draw_results, run_request
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.request import RunContext, read_request
from fastmech.store.read import open_results
from fastmech.store.write import Stream, in_memory
from fastmech.tiles.look import ScanLook, compute_alone
from fastmech.tiles.section import _tiling
from fastmech.tiles.tile_file import dataset_image, dataset_of_image

#: A small request of every kind.
FIELDS = {
    "basins": "t_end = 1.0\naxes.phi = { start = -1.0, stop = 1.0, num = 4 }\n"
    "axes.theta = { start = -1.0, stop = 1.0, num = 10 }",
    "disturbed": "trajectories = 600\nt_end = 1.0\nlinear_directions = 6",
    "disturbed_motion": "t_end = 0.1\noutputs = 11",
    "equilibria": "",
    "equilibrium_map": "axes.c2 = { start = 1.0, stop = 900.0, num = 59 }",
    "erosion": "along.F0 = { start = 100.0, stop = 200.0, num = 2 }\nt_end = 5.0\nstarts = 20\ndirections = 4"
    "\naxes.phi = { start = -3.0, stop = 3.0, num = 4 }\naxes.theta = { start = -3.0, stop = 3.0, num = 4 }",
    "motion": "t_end = 1.0\noutputs = 11",
    "snapping": "F0 = { start = 200.0, stop = 2000.0, num = 6 }"
    "\nalpha = { start = 2.0, stop = 5.0, num = 3 }",
    "snap": "scene = { F0 = 85.3, c1 = 294.9, c2 = 92.85 }",
}

#: Kinds that are one search of some milliseconds.
UNDIVIDED = {"equilibria"}

EVERY_KIND = pytest.mark.parametrize("kind", sorted(FIELDS))


@pytest.fixture(autouse=True)
def _small() -> Iterator[None]:
    _tiling.cache_clear()
    with small_tiles():
        yield


def request_of(kind: str, folder: Path) -> Path:
    path = folder / "scan.toml"
    path.write_text(f'[scene]\nalpha = 0.0\n[scan.one]\nkind = "{kind}"\n{FIELDS[kind]}\n', encoding="utf-8")
    return path


def test_every_kind_is_tested() -> None:
    of_systems = {
        kind for kind, scan in scan_kinds().items() if scan.of_systems
    }  # tests/scan_types/test_attractors.py
    assert set(FIELDS) == set(scan_kinds()) - of_systems


@EVERY_KIND
def test_tiles_need_nothing_of_each_other(kind: str, tmp_path: Path) -> None:
    """Backwards, by another tiling of the same request, and through bytes: the section that `run` makes."""
    request = read_request(request_of(kind, tmp_path), scan_kinds())
    scan, scene = request.scans["one"], request.scene_of("one")
    count = scan.tiling(scene).count
    assert count > 1 or kind in UNDIVIDED
    images = {}
    for index in reversed(range(count)):
        tile = scan.tiling(scene).compute(index, RunContext(threads=1))
        images[index] = dataset_image(tile)
    joined = scan.tiling(scene).assemble(lambda index: dataset_of_image(images[index]))
    section = in_memory(joined) if isinstance(joined, Stream) else joined
    whole = run_scan(scan, scene, RunContext(threads=2))
    assert list(section) == list(whole)
    for name in whole:
        if whole[name].data.dtype == object:
            assert section[name].data.tolist() == whole[name].data.tolist()
        else:
            assert section[name].data.tobytes() == whole[name].data.tobytes()
    assert repr(section.attrs) == repr(whole.attrs)


@EVERY_KIND
def test_interrupted_and_run_again(kind: str, tmp_path: Path) -> None:
    request, target = request_of(kind, tmp_path), tmp_path / "scan.h5"
    whole = run_request(request, tmp_path / "whole.h5", context=RunContext(threads=2))
    first = whole.tiles // 2
    with stopped_after(first, KeyboardInterrupt()), pytest.raises(Stopped):
        run_request(request, target, context=RunContext(threads=1))
    report = run_request(request, target, context=RunContext(threads=2))
    assert report.computed == whole.tiles - first
    assert content(target) == content(whole.path)


@EVERY_KIND
def test_a_tile_alone_can_be_kept(kind: str, tmp_path: Path) -> None:
    request = request_of(kind, tmp_path)
    read = read_request(request, scan_kinds())
    tiling = read.scans["one"].tiling(read.scene_of("one"))
    for index in {0, tiling.count - 1}:
        kept = tmp_path / f"{index}.h5"
        compute_alone(request, f"one:{index}", RunContext(), tmp_path / "scan.h5", keep=kept)
        with open_results(kept) as results:
            assert set(results["one"]) == set(tiling.compute(index, RunContext()))


@pytest.mark.parametrize("kind", ["basins", "disturbed", "equilibrium_map"])
def test_what_is_large_is_shown_in_part(kind: str, tmp_path: Path) -> None:
    request, target = request_of(kind, tmp_path), tmp_path / "scan.h5"
    tiles = run_request(request, tmp_path / "whole.h5").tiles
    with stopped_after(tiles - 1, KeyboardInterrupt()), pytest.raises(Stopped):
        run_request(request, target, context=RunContext(threads=1))
    ScanLook(target).write_snapshot(tmp_path / "now.h5")
    assert [path.name for path in draw_results(tmp_path / "now.h5")]
