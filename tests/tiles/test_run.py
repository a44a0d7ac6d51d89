"""Runs that are interrupted, crash, or find damaged tiles end with the undisturbed result."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path

import pytest
from filelock import FileLock
from tiles.conftest import REQUEST, TILES, Run, content

from fastmech.errors import InputError
from fastmech.interrupts import CrashedTilesError, Stopped
from fastmech.runner import run_request
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.equilibrium_map import MapTiling
from fastmech.scan_types.request import read_request
from fastmech.store.read import open_results
from fastmech.tiles import section as identity
from fastmech.tiles.look import ScanLook
from fastmech.tiles.parts import Parts
from fastmech.tiles.section import sections_of
from fastmech.tiles.tile_file import DamagedTileError, Tile, TileHead, read_tile
from fastmech.tiles.work import ThreadWorkers, TileTask, compute_tiles


@contextmanager
def stopped_after(count: int, failure: BaseException) -> Iterator[None]:
    """A run whose (count + 1)-th finished tile cannot be kept because of a failure."""
    store, kept = Parts.store, []

    def fail(self: Parts, *arguments: object) -> None:
        if len(kept) == count:
            raise failure
        kept.append(arguments)
        store(self, *arguments)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Parts, "store", fail)
        yield


def tiles(folder: Path) -> list[Path]:
    return sorted(folder.rglob("*.tile"))


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_the_same_bits_for_any_number_of_threads(run: Run, threads: int) -> None:
    report = run("a.h5", threads=3)
    assert (report.tiles, report.computed, report.was_complete) == (TILES, TILES, False)
    assert content(run("b.h5", threads=threads).path) == content(report.path)


@pytest.mark.parametrize("count", [0, 1, 4, 7])
def test_an_interrupted_run_goes_on(run: Run, tmp_path: Path, count: int) -> None:
    whole = content(run("whole.h5").path)
    with stopped_after(count, KeyboardInterrupt()), pytest.raises(Stopped) as stopped:
        run()
    assert not (tmp_path / "scan.h5").exists()
    assert len(tiles(tmp_path)) == count
    if count:
        assert f"{count} of {TILES} tiles are kept in scan.h5.parts" in str(stopped.value)
    else:
        assert not (tmp_path / "scan.h5.parts").exists()
    report = run()
    assert report.computed == TILES - count
    assert content(report.path) == whole
    assert sorted(p.name for p in tmp_path.iterdir()) == ["scan.h5", "scan.toml", "whole.h5"]


def test_a_full_disk_keeps_what_is_finished(run: Run, tmp_path: Path) -> None:
    failure = OSError(28, os.strerror(28))
    with stopped_after(3, failure), pytest.raises(InputError) as refused:
        run()
    assert str(refused.value) == (
        f"{tmp_path}/scan.h5: cannot be written: No space left on device;"
        f" 3 of {TILES} tiles are kept in scan.h5.parts; the same command goes on"
    )
    assert run().computed == TILES - 3


@pytest.mark.parametrize("place", [0, 10, 200, -1, -40, 0.5])
def test_a_flipped_byte_in_a_tile_is_found(run: Run, tmp_path: Path, place: float) -> None:
    whole = content(run("whole.h5").path)
    with stopped_after(5, KeyboardInterrupt()), pytest.raises(Stopped):
        run()
    damaged = tiles(tmp_path)[2]
    data = bytearray(damaged.read_bytes())
    data[place if isinstance(place, int) else len(data) // 2] ^= 0x10
    damaged.write_bytes(data)
    told: list[str] = []
    report = run(tell=told.append)
    assert report.damaged == [damaged]
    assert any(str(damaged) in line and "computed again" in line for line in told)
    assert report.computed == TILES - 4
    assert content(report.path) == whole


def test_every_single_byte_of_a_tile_counts(run: Run, tmp_path: Path) -> None:
    with stopped_after(1, KeyboardInterrupt()), pytest.raises(Stopped):
        run(threads=1)
    (tile,) = tiles(tmp_path)
    data = tile.read_bytes()
    head = json.loads(data.split(b"\n")[0])
    named = head["identity"], head["section"], head["index"]
    read_tile(data, *named)
    for place in range(len(data)):
        copy = bytearray(data)
        copy[place] ^= 1 << (place % 8)
        with pytest.raises(DamagedTileError):
            read_tile(bytes(copy), *named)
    for length in range(0, len(data), 97):
        with pytest.raises(DamagedTileError):
            read_tile(data[:length], *named)


def test_a_tile_under_anothers_name_is_found(run: Run, tmp_path: Path) -> None:
    with stopped_after(4, KeyboardInterrupt()), pytest.raises(Stopped):
        run()
    one, two = tiles(tmp_path)[1:3]
    one.write_bytes(two.read_bytes())
    assert run().damaged == [one]


def test_a_tile_that_is_damaged_while_the_run_assembles(run: Run, tmp_path: Path) -> None:
    whole = content(run("whole.h5").path)
    load, calls = Parts.load, []

    def damage_once(self: Parts, section: object, index: int) -> object:
        if not calls:
            calls.append(index)
            self.path(section.name, index).write_bytes(b"")
        return load(self, section, index)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Parts, "load", damage_once)
        report = run()
    assert len(report.damaged) == 1
    assert report.computed == TILES + 1
    assert content(report.path) == whole


def test_a_folder_in_place_of_a_tile_is_computed_again(run: Run, tmp_path: Path) -> None:
    whole = content(run("whole.h5").path)
    with stopped_after(5, KeyboardInterrupt()), pytest.raises(Stopped):
        run()
    place = tiles(tmp_path)[2]
    place.unlink()
    place.mkdir()
    (place / "something").write_text("else", encoding="utf-8")
    assert f"     4 of {TILES} tiles  in all" in ScanLook(tmp_path / "scan.h5").told()
    report = run()
    assert (report.damaged, report.computed) == ([place], TILES - 4)
    assert content(report.path) == whole
    assert not (tmp_path / "scan.h5.parts").exists()


def never(*arguments: object) -> None:
    raise AssertionError("nothing is computed before the place of the result is known to be one")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("loop.h5", "loop.h5: cannot be written: Too many levels of symbolic links"),
        ("z" * 300, "cannot be written: File name too long"),
        ("z" * 252, "z...: cannot be written: File name too long"),
    ],
    ids=["loop", "long", "long for its tiles"],
)
def test_a_name_that_no_file_can_have(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, message: str
) -> None:
    monkeypatch.setattr(MapTiling, "__init__", never)
    (tmp_path / "loop.h5").symlink_to(tmp_path / "back.h5")
    (tmp_path / "back.h5").symlink_to(tmp_path / "loop.h5")
    with pytest.raises(InputError) as error:
        run(name)
    assert message in str(error.value)


@pytest.mark.parametrize("fresh", [False, True])
def test_an_interrupt_when_the_file_is_complete_says_so(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fresh: bool
) -> None:
    if fresh:
        run()

    def interrupt(*arguments: object, **options: object) -> None:
        raise KeyboardInterrupt

    remove, calls = Parts.remove, []

    def in_the_end(self: Parts) -> None:
        calls.append(self)
        if len(calls) == 1 + fresh:  # the first one clears the way for a fresh run
            raise KeyboardInterrupt
        remove(self)

    with monkeypatch.context() as patched:
        patched.setattr(Parts, "remove", in_the_end)
        with pytest.raises(Stopped, match=r"^interrupted; .*scan\.h5 is complete$"):
            run(fresh=fresh)
    whole = content(tmp_path / "scan.h5")
    assert run().was_complete
    assert not (tmp_path / "scan.h5.parts").exists()
    with monkeypatch.context() as patched:
        patched.setattr("fastmech.tiles.run.write_results", interrupt)
        with pytest.raises(Stopped, match=rf"^interrupted; {TILES} of {TILES} tiles are kept"):
            run(fresh=True)
    assert content(tmp_path / "scan.h5") == whole


def test_a_changed_request_in_progress_is_refused(run: Run, request_file: Path) -> None:
    with stopped_after(3, KeyboardInterrupt()), pytest.raises(Stopped):
        run()
    request_file.write_text(REQUEST.replace("num = 59", "num = 60"), encoding="utf-8")
    with pytest.raises(
        InputError, match=r"scan\.line\.axes\.c2\.num = 59 there, 60 here; --fresh starts anew"
    ):
        run()
    report = run(fresh=True)
    assert report.computed == report.tiles
    with open_results(report.path) as results:
        assert results["line"].sizes["c2"] == 60


def test_other_sources_are_another_request(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    with stopped_after(3, KeyboardInterrupt()), pytest.raises(Stopped):
        run()
    monkeypatch.setattr(identity, "code_in_use", lambda: {"numba": "0.1"})
    with pytest.raises(InputError, match=r"a scan in progress differs: .*numba = .* there, 0\.1 here"):
        run()


@pytest.mark.parametrize("flipped", [None, *range(5, 400, 40)])
def test_a_damaged_manifest_costs_no_tile(run: Run, tmp_path: Path, flipped: int | None) -> None:
    """Cut off, or one letter changed, wherever that is."""
    with stopped_after(3, KeyboardInterrupt()), pytest.raises(Stopped):
        run()
    manifest = tmp_path / "scan.h5.parts" / "manifest.json"
    written = bytearray(manifest.read_bytes())
    if flipped is None:
        del written[-40:]
    else:
        written[flipped] ^= 2
    manifest.write_bytes(written)
    with pytest.raises(InputError, match=r"manifest\.json: is damaged; run the scan again, which goes on$"):
        ScanLook(tmp_path / "scan.h5")
    told: list[str] = []
    assert run(tell=told.append).computed == TILES - 3
    assert any(line.endswith("its manifest is damaged and written anew") for line in told)


def test_files_of_others_are_no_tiles(run: Run, tmp_path: Path) -> None:
    with stopped_after(3, KeyboardInterrupt()), pytest.raises(Stopped):
        run()
    for folder in (tmp_path / "scan.h5.parts").glob("0*"):
        for name in ("foo.tile", "999999.tile"):
            (folder / name).write_bytes(b"")
    assert f"     3 of {TILES} tiles  in all" in ScanLook(tmp_path / "scan.h5").told()
    assert run().computed == TILES - 3


def test_a_second_process_is_told(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fastmech.tiles.parts.PATIENCE", 0.01)
    folder = tmp_path / "scan.h5.parts"
    folder.mkdir()
    with FileLock(folder / "lock"), pytest.raises(InputError, match=r"another process is working on it"):
        run()
    assert run().computed == TILES


def test_crashes_do_not_stop_the_others(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compute = MapTiling.compute

    def crash(self: MapTiling, index: int, context: object) -> object:
        if index in (2, 5):
            raise ZeroDivisionError("in vain")
        return compute(self, index, context)

    with monkeypatch.context() as patch:
        patch.setattr(MapTiling, "compute", crash)
        with pytest.raises(CrashedTilesError) as crashed:
            run()
    assert f"2 of {TILES} tiles failed twice" in str(crashed.value)
    assert "ZeroDivisionError: in vain (alone: fastmech run" in str(crashed.value)
    assert "--tile line:" in str(crashed.value)
    assert len(tiles(tmp_path)) == TILES - 2
    assert run().computed == 2


def test_a_crash_while_everything_is_handed_out(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """A tile that fails once is computed in the same run."""
    compute, failed = MapTiling.compute, set()

    def fail_once(self: MapTiling, index: int, context: object) -> object:
        if index not in failed:
            failed.add(index)
            raise ZeroDivisionError("in vain")
        return compute(self, index, context)

    whole = content(run("whole.h5").path)
    monkeypatch.setattr(MapTiling, "compute", fail_once)
    assert content(run().path) == whole
    assert len(failed) == TILES - 1


def test_what_ends_together_is_kept_in_the_order_of_the_request(request_file: Path) -> None:
    """A run that is stopped then has kept its first tiles, whichever the system has woken it for."""

    class Done(ThreadWorkers):
        slots = 64

        def submit(self, task: TileTask) -> Future[Tile]:
            future: Future[Tile] = Future()
            future.set_result(Tile(TileHead("", "line", task.index, 0.0), b""))
            return future

    section = sections_of(read_request(request_file, scan_kinds()))[1]
    tasks, kept = [TileTask(section, index) for index in range(64)], []
    assert compute_tiles(tasks, Done(), lambda task, tile: kept.append(task.index)) == []
    assert kept == [*range(64)]


def test_a_read_only_folder_is_told(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(self: Path, *arguments: object, **options: object) -> None:
        raise OSError(30, os.strerror(30))

    monkeypatch.setattr(Path, "mkdir", refuse)
    with pytest.raises(InputError, match=r"scan\.h5: cannot be written: Read-only file system$"):
        run()


def test_a_vanished_folder_is_told(run: Run, tmp_path: Path) -> None:
    store = Parts.store

    def vanish(self: Parts, *arguments: object) -> None:
        shutil.rmtree(self.folder)
        store(self, *arguments)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Parts, "store", vanish)
        with pytest.raises(InputError, match=r"scan\.h5\.parts/.*: cannot be written: No such file"):
            run()
    assert run().computed == TILES


def test_nothing_of_a_request_leaves_the_folder(tmp_path: Path, request_file: Path) -> None:
    for name in ("../x", "a/b", "..", "/x", "a\\b", "a b", ""):
        request_file.write_text(
            f'[scan."{name}"]\nkind = "equilibria"\n'.replace("\\", "\\\\"), encoding="utf-8"
        )
        with pytest.raises(InputError, match="must be ASCII letters"):
            run_request(request_file, tmp_path / "out" / "x.h5")
    assert not (tmp_path / "out").exists()


def test_threads_are_shared_between_tiles_and_within(run: Run) -> None:
    hired = []

    class Noting(ThreadWorkers):
        @contextmanager
        def hired(self, tasks, context):
            with super().hired(tasks, context):
                hired.append((tasks[0].section.name, self.slots, self.context.threads))
                yield

    run(threads=3, workers=Noting())
    assert hired == [("rest", 2, 3), ("line", 4, 1)]


def test_a_way_through_a_missing_folder(run: Run, request_file: Path) -> None:
    report = run("none/../x.h5")
    assert report.path == request_file.parent / "x.h5"
    assert content(report.path)
    assert not (request_file.parent / "none").exists()
