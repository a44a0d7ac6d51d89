from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from fastmech.errors import InputError
from fastmech.results import Dataset
from fastmech.store.read import open_results

Write = Callable[[], Path]


def test_access(write: Write, content: dict[str, Any]) -> None:
    path = write()
    with open_results(path) as results:
        assert results.sections == ("equilibria", "atlas")
        assert list(results) == ["equilibria", "atlas"]
        assert "atlas" in results
        assert results.scene == {"m1": 10.0, "l": 1.25}
        assert results.parameters["l"].units == "m"
        assert {name: results.attrs[name] for name in content["attrs"]} == content["attrs"]
        section = results["equilibria"]
        assert list(section) == ["phi", "kind", "label", "complete"]
        assert section.sizes == {"equilibrium": 4}
        assert section.attrs == {"at": np.inf, "methods": ("grid", "newton")}
        assert section["complete"].data == 1
        assert section.variables["phi"].long_name == "angle of the rod OM1"
        assert isinstance(section.load(), Dataset)
        assert section.to_xarray()["phi"].attrs["units"] == "rad"


def test_a_part_of_a_section(write: Write, content: dict[str, Any]) -> None:
    with open_results(write()) as results:
        section = results["equilibria"]
        part = section.load(["phi", "label", "complete"], {"equilibrium": slice(1, None, 2)})
        whole = section.load()
        assert section.dims("phi") == ("equilibrium",)
    assert list(part) == ["phi", "label", "complete"]
    np.testing.assert_array_equal(part["phi"].data, whole["phi"].data[1::2])
    assert list(part["label"].data) == list(whole["label"].data[1::2])
    assert part["complete"].data == whole["complete"].data
    assert part["phi"].units == whole["phi"].units


@pytest.mark.parametrize("path", [3, None, b"result.h5", ["result.h5"]])
def test_what_is_no_path(path: Any) -> None:
    with pytest.raises(InputError, match=r"^path = .*: must be the path of a file$"):
        open_results(path)


def test_unknown_names_list_the_known(write: Write) -> None:
    with open_results(write()) as results:
        with pytest.raises(InputError, match=r"'basins'.*equilibria, atlas"):
            results["basins"]
        with pytest.raises(InputError, match=r"'psi'.*phi, kind, label, complete"):
            results["equilibria"]["psi"]


def test_a_section_prints_its_kind_ranges_and_names(write: Write) -> None:
    with open_results(Path(__file__).parents[1] / "older" / "schema_2.h5") as results:
        section = results["map_F0_c1"]
        low, high = (f"{end:.6g}" for end in (section["F0"].data.min(), section["F0"].data.max()))
        lines = repr(section).splitlines()
        assert len(lines) <= 6
        assert lines[0].startswith("equilibrium_map in ")
        assert f"over F0 from {low} to {high} ({section.sizes['F0']})" in lines[1]
        assert "morse_index" in repr(section)
    assert repr(section).splitlines()[1].startswith("  over F0 (")  # the file is closed


def test_closed_file_is_told(write: Write) -> None:
    with open_results(write()) as results:
        section = results["atlas"]
    with pytest.raises(InputError, match="closed"):
        section["energy"]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "is empty"),
        (b"just text\n", "not an HDF5 file"),
        (np.random.default_rng(2).bytes(5000), "not an HDF5 file"),
        (b"\x89HDF\r\n\x1a\n" + np.random.default_rng(3).bytes(5000), "damaged"),
    ],
)
def test_what_is_no_result_file(data: bytes, message: str, tmp_path: Path) -> None:
    path = tmp_path / "x.h5"
    path.write_bytes(data)
    with pytest.raises(InputError, match=message) as caught:
        open_results(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_missing_file_and_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        open_results(tmp_path / "missing.h5")
    with pytest.raises(InputError, match="Is a directory"):
        open_results(tmp_path)


@pytest.mark.parametrize("kept", [0.02, 0.3, 0.6, 0.999])
def test_truncated_file(kept: float, write: Write) -> None:
    path = write()
    data = path.read_bytes()
    path.write_bytes(data[: int(kept * len(data))])
    with pytest.raises(InputError, match="damaged"):
        open_results(path)


def test_other_hdf5_file(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file["m1"] = 1.0
    with pytest.raises(InputError, match="not a result file of fastmech"):
        open_results(tmp_path / "x.h5")


@pytest.mark.parametrize("version", [4, 0, "1", 1.5])
def test_other_schema(version: Any, write: Write) -> None:
    path = write()
    with h5py.File(path, "r+") as file:
        file.attrs["schema_version"] = version
    with pytest.raises(
        InputError, match=f"schema version {version!r}, but this fastmech reads versions 1 to 3"
    ):
        open_results(path)


def test_flipped_byte_names_the_variable(write: Write) -> None:
    path = write()
    with h5py.File(path) as file:
        place = file["atlas/energy"].id.get_chunk_info(0)
    data = bytearray(path.read_bytes())
    data[place.byte_offset + place.size // 2] ^= 1
    path.write_bytes(data)
    with open_results(path) as results:
        assert results["atlas"]["F0"].data[-1] == 100.0
        with pytest.raises(InputError, match=r"variable 'energy'.*damaged"):
            results["atlas"]["energy"]
        with pytest.raises(InputError, match=r"variable 'energy'.*damaged"):
            results["atlas"].load()


def test_no_flipped_bit_passes_for_data(write: Write) -> None:
    path = write()
    with open_results(path) as results:
        expected = {name: results[name].load() for name in results}
        scene = results.scene
    original = path.read_bytes()
    rng = np.random.default_rng(11)
    refused = 0
    for place, bit in zip(rng.integers(0, len(original), 300), rng.integers(0, 8, 300), strict=True):
        data = bytearray(original)
        data[place] ^= 1 << int(bit)
        path.write_bytes(data)
        try:
            with open_results(path) as results:
                got = {name: results[name].load() for name in results}
                assert results.scene == scene
        except InputError:
            refused += 1
            continue
        for section, dataset in expected.items():
            for name, variable in dataset.variables.items():
                np.testing.assert_array_equal(got[section][name].data, variable.data)
                assert got[section][name].units == variable.units
    assert refused > 150


def test_links_to_other_files_are_not_followed(write: Write, tmp_path: Path) -> None:
    path = write()
    with h5py.File(tmp_path / "secret.h5", "w") as other:
        other["x"] = 1.0
    with h5py.File(path, "r+") as file:
        file["atlas/outside"] = h5py.ExternalLink("secret.h5", "/x")
        file["elsewhere"] = h5py.SoftLink("/atlas")
    with open_results(path) as results:
        assert "outside" not in results["atlas"]
        assert "elsewhere" not in results


def test_data_in_other_files_are_not_read(write: Write, tmp_path: Path) -> None:
    path = write()
    (tmp_path / "raw").write_bytes(b"12345678")
    with h5py.File(path, "r+") as file:
        file["atlas"].create_dataset("x", shape=(1,), dtype="i8", external=[(str(tmp_path / "raw"), 0, 8)])
    with open_results(path) as results, pytest.raises(InputError, match=r"variable 'x'.*lie elsewhere"):
        results["atlas"]["x"]


def test_parameter_that_is_no_number(write: Write) -> None:
    path = write()
    with h5py.File(path, "r+") as file:
        file["m1"][()] = np.nan
        del file["l"].attrs["units"]
    with pytest.raises(InputError, match=r"parameter 'l': is damaged"):
        open_results(path)


@pytest.mark.parametrize("path", ["a\0b", "a\ud800b\0"])
def test_a_path_that_no_file_can_have(path: str) -> None:
    with pytest.raises(InputError, match="cannot be the path of a file"):
        open_results(path)
