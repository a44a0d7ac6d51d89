"""What goes into a file comes out of it, through the package's own reader and through xarray's."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import hypothesis.extra.numpy as hnp
import hypothesis.strategies as st
import numpy as np
import pytest
import xarray
from hypothesis import given, settings

from fastmech.results import Dataset, Variable
from fastmech.store.provenance import provenance
from fastmech.store.read import open_results
from fastmech.store.write import write_results

DTYPES = [np.float64, np.float32, np.int8, np.int32, np.int64, np.bool_]
DIMS = ("i", "j", "k")
TEXT = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=6)
ATTRS = st.dictionaries(
    st.from_regex(r"[a-z]{2,8}", fullmatch=True).filter(
        lambda name: name not in {"units", "dtype", "calendar"}
    ),
    TEXT | st.integers(-(2**62), 2**62) | st.floats() | st.lists(TEXT, min_size=1, max_size=3).map(tuple),
    max_size=4,
)


@st.composite
def datasets(draw: st.DrawFn) -> Dataset:
    sizes = {dim: draw(st.integers(0, 9) | st.just(30)) for dim in DIMS}
    variables = {}
    for number in range(draw(st.integers(0, 4))):
        dims = tuple(draw(st.permutations(DIMS)))[: draw(st.integers(0, 3))]
        shape = tuple(sizes[dim] for dim in dims)
        dtype = draw(st.sampled_from(DTYPES))
        elements = hnp.arrays(object, shape, elements=TEXT) | hnp.arrays(dtype, shape)
        variables[f"v{number}"] = Variable(dims, draw(elements), "N/m", draw(TEXT), draw(ATTRS))
    used = sorted({dim for variable in variables.values() for dim in variable.dims})
    for dim in draw(st.sets(st.sampled_from(used))) if used else ():
        variables[dim] = Variable((dim,), np.arange(sizes[dim]) * 0.5, "m")
    return Dataset(variables, draw(ATTRS))


def assert_same(got: Dataset, expected: Dataset) -> None:
    assert set(got.variables) == set(expected.variables)
    assert repr(got.attrs) == repr(expected.attrs)
    for name, variable in expected.variables.items():
        assert got[name].dims == variable.dims
        assert got[name].data.dtype == variable.data.dtype
        np.testing.assert_array_equal(got[name].data, variable.data)
        assert (got[name].units, got[name].long_name) == (variable.units, variable.long_name)
        assert repr(dict(sorted(got[name].attrs.items()))) == repr(dict(sorted(variable.attrs.items())))


@given(first=datasets(), second=datasets())
@settings(max_examples=60, deadline=None, derandomize=True)
def test_random_datasets(first: Dataset, second: Dataset) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "result.h5"
        sections = {"first": first, "second": second}
        attrs = {**provenance(threads=1), "title": "t"}
        write_results(path, scene_parameters={}, sections=sections, attrs=attrs)
        with open_results(path) as results:
            assert results.sections == ("first", "second")
            for name, section in sections.items():
                assert results[name].sizes == section.sizes
                assert_same(results[name].load(), section)
        with xarray.open_dataset(path, engine="h5netcdf", group="second") as opened:
            assert dict(opened.sizes) == second.sizes
            for name, variable in second.variables.items():
                assert opened[name].dims == variable.dims
                np.testing.assert_array_equal(opened[name].values, variable.data)


def test_xarray_opens_the_root(write: Callable[[], Path]) -> None:
    with xarray.open_dataset(write(), engine="h5netcdf") as root:
        assert float(root.m1) == 10.0
        assert root.m1.attrs == {"units": "kg", "long_name": "mass of M1"}
        assert root.attrs["schema_version"] == 3
        assert root.attrs["Conventions"] == "CF-1.11"
        assert root.attrs["history"].startswith(root.attrs["created"])
        assert root.attrs["request"] == "[scene]\nm1 = 10\n"


def test_xarray_opens_a_section(write: Callable[[], Path], content: dict[str, Any]) -> None:
    with xarray.open_dataset(write(), engine="h5netcdf", group="atlas") as atlas:
        assert atlas.energy.dims == ("F0", "c2", "index")
        assert set(atlas.coords) == {"F0", "c2"}
        assert atlas.F0.attrs["units"] == "N"
        np.testing.assert_array_equal(
            atlas.energy.sel(F0=100.0), content["sections"]["atlas"]["energy"].data[-1]
        )


def test_xarray_opens_the_tree(write: Callable[[], Path]) -> None:
    with xarray.open_datatree(write(), engine="h5netcdf") as tree:
        assert set(tree.children) == {"equilibria", "atlas"}
        equilibria = tree["equilibria"]
        assert equilibria["label"].values.tolist() == ["A", "B", "", "Größe [N]"]
        assert equilibria["kind"].attrs["flag_meanings"] == "stable unstable degenerate"
        assert equilibria["kind"].dtype == np.int8
        assert equilibria.attrs["methods"] == ["grid", "newton"]


TEXTS = {
    "end": Variable(("end",), ["A", "größer"]),
    "sentence": Variable((), "one"),
    "table": Variable(("end", "n"), [["", "b", "c"], ["d", "ef", ""]]),
    "none": Variable(("empty",), np.empty(0, dtype=object)),
}


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_texts_in_every_reader(engine: str, tmp_path: Path, content: dict[str, Any]) -> None:
    if engine == "netcdf4":
        pytest.importorskip("netCDF4")
    write_results(tmp_path / "t.h5", **{**content, "sections": {"s": Dataset(TEXTS)}})
    with xarray.open_dataset(tmp_path / "t.h5", engine=engine, group="s") as opened:
        assert dict(opened.sizes) == {"end": 2, "n": 3, "empty": 0}
        for name, variable in TEXTS.items():
            assert opened[name].dims == variable.dims
            np.testing.assert_array_equal(opened[name].values, variable.data)


def test_texts_are_stored_as_the_characters_that_netcdf_knows(
    tmp_path: Path, content: dict[str, Any]
) -> None:
    import h5py

    write_results(tmp_path / "t.h5", **{**content, "sections": {"s": Dataset(TEXTS)}})
    with h5py.File(tmp_path / "t.h5") as file:
        for name, variable in TEXTS.items():
            stored = file["s"][name]
            assert stored.dtype == np.dtype("S1")
            assert stored.shape[:-1] == variable.data.shape
    with open_results(tmp_path / "t.h5") as results:
        assert results["s"].sizes == {"end": 2, "n": 3, "empty": 0}
        assert results["s"].about("table").sizes == {"end": 2, "n": 3}
        assert_same(results["s"].load(), Dataset(TEXTS))


def test_texts_of_schema_2_are_read() -> None:
    import h5py

    path = Path(__file__).parents[1] / "older" / "schema_2.h5"
    with open_results(path) as results, h5py.File(path) as file:
        assert results.attrs["schema_version"] == 2
        for section, name in (("snap", "end"), ("equilibria", "explanation")):
            assert results[section][name].data.tolist() == file[section][name].asstr()[()].tolist()
        assert results["equilibria"]["explanation"].dims == ("equilibrium",)


@pytest.mark.parametrize("length", [100, 300_000])
def test_long_texts_are_kept(length: int, tmp_path: Path, content: dict[str, Any]) -> None:
    request = "ü" * length
    content["attrs"]["request"] = request
    write_results(tmp_path / "long.h5", **content)
    with open_results(tmp_path / "long.h5") as results:
        assert results.attrs["request"] == request


def test_large_arrays_are_compressed_and_summed(write: Callable[[], Path]) -> None:
    import h5py

    with h5py.File(write()) as file:
        energy = file["atlas/energy"]
        assert (energy.compression, energy.compression_opts, energy.shuffle, energy.fletcher32) == (
            "gzip",
            4,
            True,
            True,
        )
        assert energy.attrs["units"] == b"J"
