"""Sections as xarray: labels at once, values when they are used."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fastmech import open_results
from fastmech.errors import InputError
from fastmech.results import Dataset, Variable
from fastmech.store.provenance import provenance
from fastmech.store.read import Section
from fastmech.store.write import write_results

pytest.importorskip("xarray")

ROWS, COLUMNS = 4000, 2000


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the variables that were read."""
    read: list[str] = []
    load = Section.load

    def counting(self: Section, names: list[str] | None = None, *more: object) -> Dataset:
        read.extend(self if names is None else names)
        return load(self, names, *more)

    monkeypatch.setattr(Section, "load", counting)
    return read


def test_labels_come_at_once_and_values_when_used(write: Callable[[], Path], counted: list[str]) -> None:
    with open_results(write()) as results:
        opened = results["atlas"].to_xarray()
        assert dict(opened.sizes) == {"F0": 40, "c2": 30, "index": 2}
        assert (opened.energy.dims, opened.energy.attrs["units"]) == (("F0", "c2", "index"), "J")
        assert "energy" in repr(opened)
        assert counted == []
        np.testing.assert_array_equal(opened.energy.values, results["atlas"]["energy"].data)
        assert counted == ["energy"]


INDICES = {
    "integers": {"F0": 3, "index": 1},
    "slices": {"F0": slice(2, 30, 3), "c2": slice(5, None)},
    "backwards": {"F0": slice(None, None, -2), "c2": slice(20, 3, -1)},
    "nothing": {"F0": slice(5, 5)},
    "from behind": {"c2": -1, "F0": slice(-4, None)},
    "places": {"F0": [3, 39, 0], "c2": [1, 1]},
    "a mask": {"index": np.array([False, True])},
}


@pytest.mark.parametrize("which", INDICES)
def test_parts_are_those_of_the_whole(write: Callable[[], Path], which: str) -> None:
    with open_results(write()) as results:
        section = results["atlas"]
        part = section.to_xarray().energy.isel(INDICES[which])
        right = section.load().to_xarray().energy.isel(INDICES[which])
        np.testing.assert_array_equal(part.values, right.values)
        assert part.dims == right.dims


def test_texts_flags_and_scalars(write: Callable[[], Path]) -> None:
    with open_results(write()) as results:
        lazy, whole = results["equilibria"].to_xarray(), results["equilibria"].load().to_xarray()
        assert lazy.identical(whole)
        assert lazy.label[3].item() == "Größe [N]"
        assert lazy.complete.item() == 1


@pytest.mark.parametrize("own", [{}, {"k": Variable(("k",), np.arange(3.0), "N/m", "stiffness")}])
def test_what_lies_in_groups_alone_is_told_as_before_it_was_saved(
    own: dict[str, Variable], tmp_path: Path, counted: list[str]
) -> None:
    groups = {
        name: Dataset({f"{name}_x": Variable((name,), np.arange(float(size)), "m", "place")})
        for name, size in (("point", 4), ("special", 0))
    }
    path, kept = tmp_path / "groups.h5", Dataset(own, groups=groups)
    write_results(path, scene_parameters={}, sections={"kept": kept}, attrs=provenance(1))
    with open_results(path) as results:
        opened = results["kept"].to_xarray()
        assert counted == []
        assert set(opened.variables) == {*own, "point_x", "special_x"}
        assert opened.identical(kept.merged.to_xarray())
        assert opened.identical(results["kept"].load().to_xarray())


def test_one_value_of_a_large_file_takes_little_memory(tmp_path: Path) -> None:
    path = tmp_path / "large.h5"
    values = np.arange(ROWS * COLUMNS, dtype=np.float64).reshape(ROWS, COLUMNS) // 1000
    section = Dataset(
        {"x": Variable(("row",), np.arange(float(ROWS))), "v": Variable(("row", "column"), values)}
    )
    attrs = {**provenance(1), "title": "large"}
    write_results(path, scene_parameters={}, sections={"one": section}, attrs=attrs)
    whole, right = values.nbytes, values[1234, 5:9].copy()
    del values, section
    with open_results(path) as results:
        tracemalloc.start()
        found = results["one"].to_xarray().v.sel(row=1234).isel(column=slice(5, 9)).values
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    np.testing.assert_array_equal(found, right)
    assert peak < whole / 20


def test_damage_is_told_when_the_variable_is_read(write: Callable[[], Path]) -> None:
    path = write()
    with open_results(path) as results:
        stored = results["atlas"]._stored["energy"]
        offset = stored.id.get_chunk_info(0).byte_offset
    image = bytearray(path.read_bytes())
    image[offset + 9] ^= 1
    path.write_bytes(image)
    with open_results(path) as results:
        opened = results["atlas"].to_xarray()
        assert opened.F0.values[0] == 0.0
        with pytest.raises(InputError, match=r"atlas: variable 'energy': is damaged"):
            _ = opened.energy.values


def test_a_closed_file_is_told(write: Callable[[], Path]) -> None:
    with open_results(write()) as results:
        opened = results["atlas"].to_xarray()
    with pytest.raises(InputError, match="the file is closed"):
        _ = opened.energy.values
