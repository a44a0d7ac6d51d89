"""Results written piece by piece are the same file as results written whole."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fastmech.errors import InputError
from fastmech.results import Dataset, Variable
from fastmech.store.provenance import provenance
from fastmech.store.read import open_results
from fastmech.store.stream import Piece, Stream, write_stream

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
    write_stream(path, scene_parameters=mass, sections={"map": stream(whole), "small": other}, attrs=attrs)
    with open_results(path) as results:
        section = results["map"]
        assert section.sizes == {"x": 50, "y": 30, "root": 6, "number": 3}
        np.testing.assert_array_equal(section["value"].data, VALUES)
        np.testing.assert_array_equal(section["sum"].data, VALUES.sum(axis=-1))
        assert (section["value"].dims, section["value"].units) == (("x", "y", "root"), "J")
        assert list(section["late"].data) == [1, 2, 3]
        assert section.attrs["kind"] == "test"
        assert section.attrs["wall_time_s"] > 0.0
        assert results.scene == {"m1": 2.0}
        np.testing.assert_array_equal(results["small"]["z"].data, np.arange(4.0))


def test_xarray_opens_it(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    path = tmp_path / "stream.h5"
    write_stream(path, scene_parameters={}, sections={"map": stream(whole)}, attrs=attrs)
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
        write_stream(
            tmp_path / "stream.h5", scene_parameters={}, sections={"map": stream(failing)}, attrs=attrs
        )
    assert list(tmp_path.iterdir()) == []


def test_an_existing_file_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "stream.h5"
    path.write_text("mine")
    with pytest.raises(InputError, match="exists already"):
        write_stream(path, scene_parameters={}, sections={"map": stream(whole)}, attrs=attrs)
    assert path.read_text() == "mine"


def test_a_full_disk_is_told_before_it_happens(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usage = type("Usage", (), {"free": 100})
    monkeypatch.setattr("fastmech.store.stream.shutil.disk_usage", lambda folder: usage)
    with pytest.raises(InputError, match="has no room for the result's next"):
        write_stream(
            tmp_path / "stream.h5", scene_parameters={}, sections={"map": stream(whole)}, attrs=attrs
        )
    assert list(tmp_path.iterdir()) == []
