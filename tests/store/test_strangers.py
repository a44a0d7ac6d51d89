"""Files from strangers: what they ask for is bounded, and their names harm neither terminal nor folder."""

from __future__ import annotations

import os
import re
import shutil
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from fastmech.errors import InputError
from fastmech.store import decode
from fastmech.store.export import export_results
from fastmech.store.read import open_results
from fastmech.store.schema import DIM_NUMBER, DIM_NUMBERS
from fastmech.tiles.look import ScanLook

SHIPPED = Path(__file__).parents[2] / "data" / "small.h5"

Write = Callable[[], Path]


def bomb(group: h5py.Group, name: str, count: int, chunk: int) -> None:
    """So many doubles, all 0, packed a thousandfold."""
    scale = group.create_dataset(f"n_{name}", shape=(count,), dtype=">f4")
    scale.make_scale(f"This is a netCDF dimension but not a netCDF variable.{count:10d}")
    scale.attrs[DIM_NUMBER] = np.int32(hash(name) % 1000 + 500)
    stored = group.create_dataset(
        name, shape=(count,), dtype="f8", chunks=(chunk,), compression="gzip", compression_opts=9
    )
    stored[:] = 0.0
    stored.attrs["units"], stored.attrs["long_name"] = np.bytes_("m"), np.bytes_("nothing")
    stored.attrs[DIM_NUMBERS] = np.array([scale.attrs[DIM_NUMBER]])


def test_a_deflate_bomb_is_refused_before_it_is_unpacked(
    write: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write()
    with h5py.File(path, "r+") as file:
        bomb(file["atlas"], "zeros", 50_000_000, 1 << 17)
    assert path.stat().st_size < 1_000_000
    tracemalloc.start()
    with pytest.raises(InputError, match=r"result\.h5: has more than [\d,]+ bytes .*FASTMECH_FILE_LIMITS=10"):
        open_results(path)
    assert tracemalloc.get_traced_memory()[1] < 10_000_000
    tracemalloc.stop()
    monkeypatch.setenv("FASTMECH_FILE_LIMITS", "3")
    with open_results(path) as results:
        assert results["atlas"]["zeros"].data.size == 50_000_000


def test_many_small_bombs_are_one_large_one(write: Write) -> None:
    """Links to one and the same variable count as often as they would be read."""
    path = write()
    with h5py.File(path, "r+") as file:
        bomb(file["atlas"], "zeros", 4_000_000, 1 << 17)
        for k in range(20):
            file["atlas"][f"again_{k}"] = file["atlas/zeros"]
    with pytest.raises(InputError, match="bytes of unpacked values"):
        open_results(path)


def test_a_chunk_that_is_a_bomb_by_itself(write: Write, tmp_path: Path) -> None:
    path = write()
    with h5py.File(path, "r+") as file:
        bomb(file["atlas"], "zeros", 20_000_000, 20_000_000)
    with open_results(path) as results, pytest.raises(InputError, match=r"'zeros'.*chunks have more than"):
        results["atlas"]["zeros"]
    with pytest.raises(InputError, match=r"'zeros'.*chunks have more than"):
        list(export_results(path, tmp_path / "out", "npz"))


def test_too_many_empty_groups(write: Write) -> None:
    path = write()
    with h5py.File(path, "r+") as file:
        for k in range(1_001):
            file.create_group(f"g{k}")
    with pytest.raises(InputError, match="more than 1,000 groups"):
        open_results(path)


def test_limits_hold_for_whole_results_of_fastmech() -> None:
    shipped = Path(__file__).parents[2] / "data" / "small.h5"
    with open_results(shipped) as results:
        unpacked = sum(
            v.data.nbytes
            for name in results.groups
            for v in results[name].load(list(results[name])).variables.values()
        )
    assert 100 * unpacked < decode.FREE_BYTES


@pytest.mark.parametrize("text", ["", "-1", "nan", "inf", "much"])
def test_the_factor_of_the_limits_is_checked(
    text: str, write: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FASTMECH_FILE_LIMITS", text)
    with pytest.raises(InputError, match=r"FASTMECH_FILE_LIMITS = .*: must be a positive number"):
        open_results(write())


@pytest.mark.parametrize("name", ["a\x1b[2Jb", "..", "a b", "x" * 20 + "\n", "ü"])
@pytest.mark.parametrize("place", ["section", "variable", "attribute"])
def test_names_that_are_not_plain_are_refused(name: str, place: str, write: Write) -> None:
    path = write()
    with h5py.File(path, "r+") as file:
        if place == "section":
            file.create_group(name)
        elif place == "variable":
            file["atlas"][name] = 1.0
        else:
            file["atlas"].attrs[name] = 1.0
    with pytest.raises(InputError, match="must be ASCII letters, digits and underscores") as caught:
        open_results(path)
    assert str(caught.value).isprintable()


def test_long_texts_and_many_attributes(write: Write) -> None:
    path = write()
    with h5py.File(path, "r+") as file:
        file["atlas"].attrs["note"] = np.bytes_(b"x" * (decode.MOST_ATTR_BYTES + 1))
    with pytest.raises(InputError, match="attribute note is too long"):
        open_results(path)
    with h5py.File(path, "r+") as file:
        del file["atlas"].attrs["note"]
        for k in range(decode.MOST_ATTRS + 1):
            file["atlas"].attrs[f"a{k}"] = 1
    with pytest.raises(InputError, match=r"has 1,0\d\d attributes"):
        open_results(path)


def test_texts_of_variable_length_are_not_read(write: Write) -> None:
    """One text in the file may stand for a million."""
    path = write()
    with h5py.File(path, "r+") as file:
        file["atlas"].create_dataset("texts", data=["a" * 1000] * 3, dtype=h5py.string_dtype())
    with open_results(path) as results, pytest.raises(InputError, match=r"'texts'.*variable length"):
        results["atlas"]["texts"]


def test_groups_within_groups_are_followed_no_deeper(write: Write) -> None:
    path = write()
    with h5py.File(path, "r+") as file:
        file["atlas/loop"] = file["atlas"]
    with open_results(path) as results:
        assert results.groups == ("equilibria", "atlas", "atlas/loop")
        assert "atlas/loop/loop" not in results


def test_what_is_no_regular_file_is_not_waited_for(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.h5"
    os.mkfifo(pipe)
    with pytest.raises(InputError, match=r"pipe.h5: is not a regular file"):
        open_results(pipe)


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (lambda file: file.attrs.__setitem__("format", [1, 2, 3]), "not a result file of fastmech"),
        (lambda file: [file.__delitem__(name) for name in list(file)], "holds no section"),
        (
            lambda file: next(iter(_sections(file))).create_dataset("hollow", data=h5py.Empty("f8")),
            "variable 'hollow': is damaged or not written by fastmech: it has no values",
        ),
        (
            lambda file: _flagged(file).attrs.__setitem__("flag_values", np.array([1], dtype=np.int8)),
            "flag_values, flag_meanings: do not fit together",
        ),
    ],
)
def test_what_is_wrong_is_named_and_never_called_complete(tmp_path: Path, spoil: Any, told: str) -> None:
    path = tmp_path / "odd.h5"
    shutil.copy(SHIPPED, path)
    with h5py.File(path, "r+") as file:
        spoil(file)
    with pytest.raises(InputError, match=re.escape(told)) as refusal:
        ScanLook(path)
    assert "odd.h5" in str(refusal.value)


def _sections(file: h5py.File) -> Any:
    return (one for one in file.values() if isinstance(one, h5py.Group))


def _flagged(file: h5py.File) -> h5py.Dataset:
    return next(v for one in _sections(file) for v in one.values() if "flag_values" in v.attrs)


def test_a_limit_that_is_none_is_not_the_file_s_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FASTMECH_FILE_LIMITS", "abc")
    with pytest.raises(InputError, match=r"^FASTMECH_FILE_LIMITS = 'abc': must be a positive number"):
        open_results(SHIPPED)
