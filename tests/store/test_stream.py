"""Results written piece by piece are the same file as results written whole."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fastmech.errors import InputError
from fastmech.results import Dataset, Variable
from fastmech.store.provenance import provenance
from fastmech.store.read import open_results
from fastmech.store.write import Piece, Stream, in_memory, write_results

VALUES = np.random.default_rng(1).normal(size=(50, 30, 6))


def attrs() -> dict[str, Any]:
    return {**provenance(1), "title": "a stream"}


def stream(pieces: Any) -> Stream:
    fixed = Dataset({"x": Variable(("x",), np.arange(50.0), "m")}, {"kind": "test"})
    plane = {
        "value": Variable(("x", "y", "root"), VALUES[:1], "J", "a value"),
        "sum": Variable(("x", "y"), VALUES[:1].sum(axis=-1), "J", "its sum"),
    }
    return Stream(fixed, plane, "x", pieces)


def whole() -> Iterator[Piece]:
    for start in range(0, 50, 7):
        rows = slice(start, min(start + 7, 50))
        yield rows, {"value": VALUES[rows]}
    for start in (0, 25):
        rows = slice(start, start + 25)
        yield rows, {"sum": VALUES[rows].sum(axis=-1)}
    yield Dataset({"late": Variable(("number",), np.array([1, 2, 3]), "1", "known in the end")})


def test_pieces_come_back_as_one(tmp_path: Path) -> None:
    path = tmp_path / "stream.h5"
    other = Dataset({"z": Variable(("z",), np.arange(4.0), "s")})
    mass = {"m1": Variable((), np.array(2.0), "kg")}
    write_results(path, scene_parameters=mass, sections={"map": stream(whole), "small": other}, attrs=attrs)
    with open_results(path) as results:
        section = results["map"]
        assert section.sizes == {"x": 50, "y": 30, "root": 6, "number": 3}
        np.testing.assert_array_equal(section["value"].data, VALUES)
        np.testing.assert_array_equal(section["sum"].data, VALUES.sum(axis=-1))
        assert (section["value"].dims, section["value"].units) == (("x", "y", "root"), "J")
        assert list(section["late"].data) == [1, 2, 3]
        assert section.attrs["kind"] == "test"
        assert results.scene == {"m1": 2.0}
        np.testing.assert_array_equal(results["small"]["z"].data, np.arange(4.0))


def test_xarray_opens_it(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    path = tmp_path / "stream.h5"
    write_results(path, scene_parameters={}, sections={"map": stream(whole)}, attrs=attrs)
    with xarray.open_dataset(path, group="map", engine="h5netcdf") as opened:
        assert dict(opened.sizes) == {"x": 50, "y": 30, "root": 6, "number": 3}
        assert opened["value"].dims == ("x", "y", "root")
        assert opened["value"].attrs["units"] == "J"
        np.testing.assert_array_equal(opened["value"].values, VALUES)


def test_nothing_is_left_of_a_failure(tmp_path: Path) -> None:
    def failing() -> Iterator[Piece]:
        yield slice(0, 5), {"value": VALUES[:5]}
        raise RuntimeError("stop")

    with pytest.raises(RuntimeError, match="stop"):
        write_results(
            tmp_path / "stream.h5", scene_parameters={}, sections={"map": stream(failing)}, attrs=attrs
        )
    assert list(tmp_path.iterdir()) == []


def test_an_existing_file_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "stream.h5"
    path.write_text("mine")
    with pytest.raises(InputError, match="exists already"):
        write_results(path, scene_parameters={}, sections={"map": stream(whole)}, attrs=attrs)
    assert path.read_text() == "mine"


@pytest.mark.skipif(sys.platform == "win32", reason="needs a limit on file sizes")
@pytest.mark.parametrize("room", [0, 3_000, 20_000, 60_000])
def test_a_full_disk_is_told_and_leaves_nothing(tmp_path: Path, room: int) -> None:
    """Wherever the disk refuses: at the head, in the data, at the end. The file needs 80 kB."""
    code = f"""
import resource, signal, sys
from pathlib import Path
sys.path.insert(0, {str(Path(__file__).parents[1])!r})
from store.test_stream import attrs, stream, whole
from fastmech.errors import InputError
from fastmech.store.write import write_results
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, ({room}, {room}))
try:
    write_results(Path(sys.argv[1]), scene_parameters={{}}, sections={{"map": stream(whole)}}, attrs=attrs)
except InputError as error:
    print(error)
"""
    path = tmp_path / "stream.h5"
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"{path}: cannot be written: File too large\n"
    assert list(tmp_path.iterdir()) == []


def test_in_memory_is_the_same() -> None:
    dataset = in_memory(stream(whole))
    assert dataset.sizes == {"x": 50, "y": 30, "root": 6, "number": 3}
    np.testing.assert_array_equal(dataset["value"].data, VALUES)
    assert (dataset["value"].dims, dataset["value"].units) == (("x", "y", "root"), "J")
    assert list(dataset["late"].data) == [1, 2, 3]
    assert dataset.attrs == {"kind": "test"}


def test_pieces_may_lie_along_several_dimensions(tmp_path: Path) -> None:
    def blocks() -> Iterator[Piece]:
        for x in (slice(0, 30), slice(30, 50)):
            for y in (slice(0, 11), slice(11, 30)):
                yield (x, y), {"value": VALUES[x, y], "sum": VALUES[x, y].sum(axis=-1)}

    path = tmp_path / "stream.h5"
    write_results(path, scene_parameters={}, sections={"map": stream(blocks)}, attrs=attrs)
    with open_results(path) as results:
        np.testing.assert_array_equal(results["map"]["value"].data, VALUES)
    np.testing.assert_array_equal(in_memory(stream(blocks))["sum"].data, VALUES.sum(axis=-1))
