"""A tile as bytes, which are written whole or not at all: a line of what it is, its content, a checksum.

Every byte is covered; a tile under another name, of another request or cut short is told as surely as one
with a flipped bit. The checksum is CRC-32: it finds every error within 32 neighbouring bits, misses one in
2^32 of the others, and costs a fifth of what a cryptographic digest does.

The content is a dataset as a line of JSON with all but the arrays, then these as NumPy writes them. HDF5,
which lets one thread at a time do anything, would take some ten milliseconds for the same.
"""

from __future__ import annotations

import io
import json
import os
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.errors import InputError
from fastmech.results import Dataset, Variable
from fastmech.store.write import published


def dataset_image(dataset: Dataset) -> bytes:
    """The bytes of a dataset, the same for the same dataset."""
    assert not dataset.groups  # no tile has any
    about = {name: (v.dims, v.units, v.long_name, v.attrs) for name, v in dataset.variables.items()}
    file = io.BytesIO()
    text = json.dumps({"attrs": dataset.attrs, "variables": about}, default=_plain)
    file.write(f"{text}\n".encode())
    for v in dataset.variables.values():
        data = v.data.astype(str) if v.data.dtype == object else v.data
        np.lib.format.write_array(file, np.asarray(data, order="C"), allow_pickle=False)
    return file.getvalue()


def dataset_of_image(image: bytes) -> Dataset:
    """The dataset that `dataset_image` has turned into bytes, which must be undamaged."""
    file, variables = io.BytesIO(image), {}
    about = json.loads(file.readline())
    for name, (dims, units, long_name, attrs) in about["variables"].items():
        data = np.lib.format.read_array(file, allow_pickle=False)
        data = data.astype(object) if data.dtype.kind == "U" else data
        variables[name] = Variable(tuple(dims), data, units, long_name, _attributes(attrs))
    return Dataset(variables, _attributes(about["attrs"]))


def _plain(array: NDArray[Any]) -> dict[str, Any]:
    return {"dtype": array.dtype.str, "values": array.tolist()}


def _attributes(plain: Mapping[str, Any]) -> dict[str, Any]:
    """Attributes that were JSON: a list was a tuple of texts, a table an array."""
    attrs: dict[str, Any] = {}
    for name, value in plain.items():
        attrs[name] = tuple(value) if isinstance(value, list) else value
        if isinstance(value, dict):
            attrs[name] = np.array(value["values"], dtype=value["dtype"])
    return attrs


def write_durably(path: Path, chunks: Iterable[bytes | memoryview]) -> None:
    """Write aside, flush to the disk, take the name.

    Raises:
        OSError: as the system says; the older file is then as it was.
    """
    with published(path, True) as aside, aside.open("wb") as file:
        file.writelines(chunks)
        file.flush()
        os.fsync(file.fileno())


FORMAT = "fastmech tile 2"
SUM_BYTES = 4


class DamagedTileError(InputError):
    """A tile's bytes are not those that were written."""


@dataclass(frozen=True)
class TileHead:
    """What a tile is."""

    identity: str  #: of the request, see `fastmech.tiles.section`
    section: str  #: name of the section
    index: int  #: number of the tile
    seconds: float  #: share of the wall time that it took [s]


@dataclass(frozen=True, eq=False)
class Tile:
    """A tile that has just been computed, on its way to its file."""

    head: TileHead
    image: bytes  #: its content, see `dataset_image`

    @property
    def chunks(self) -> list[bytes]:
        """The bytes of its file, chunk after chunk."""
        line = json.dumps({"format": FORMAT, **asdict(self.head)}).encode() + b"\n"
        checksum = zlib.crc32(self.image, zlib.crc32(line))
        return [line, self.image, checksum.to_bytes(SUM_BYTES, "little")]


def read_tile(data: bytes, identity: str, section: str, index: int) -> tuple[TileHead, Dataset]:
    """Check a tile's bytes and what they are.

    Raises:
        DamagedTileError: they are damaged, cut short, or another tile's.
    """
    content, checksum = memoryview(data)[:-SUM_BYTES], data[-SUM_BYTES:]
    if len(data) <= SUM_BYTES or zlib.crc32(content).to_bytes(SUM_BYTES, "little") != checksum:
        raise DamagedTileError("does not match its checksum, or is cut short")
    end = data.index(b"\n") + 1
    about = json.loads(data[:end])
    if about.pop("format") != FORMAT:
        raise DamagedTileError("is of another format")
    found = TileHead(**about)
    if (found.identity, found.section, found.index) != (identity, section, index):
        raise DamagedTileError(f"is tile {found.index} of {found.section} of another request")
    return found, dataset_of_image(data[end:-SUM_BYTES])
