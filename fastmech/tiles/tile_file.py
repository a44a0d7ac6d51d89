"""A tile as bytes, which are written whole or not at all: a line of what it is, its content, a checksum.

The line holds a checksum of the content and its length, so every byte is covered; a tile under another name,
of another request or cut short is told as surely as one with a flipped bit. The checksum is CRC-32: it finds
every error within 32 neighbouring bits, misses one in 2^32 of the others, and costs a fifth of what a
cryptographic digest does.

One dataset as bytes in memory and back, for pieces of a result that are not published yet. A length, so many
bytes of JSON with everything but the arrays, then the arrays as they lie in memory. HDF5, which lets one
thread at a time do anything, would take some ten milliseconds for the same. Nothing is copied on the way out
and nothing on the way back: at tens of megabytes a copy costs as much as writing them.
"""

from __future__ import annotations

import json
import math
import os
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fastmech.errors import InputError
from fastmech.results import Dataset, Variable
from fastmech.store.write import published

#: Every array begins at a multiple of so many bytes, as kernels want it.
ALIGNMENT = 64

_LENGTH_BYTES = 8


def dataset_image(dataset: Dataset) -> list[NDArray[np.uint8]]:
    """The bytes of a dataset in consecutive chunks, the same for the same dataset.

    The chunks are views of its arrays where these are contiguous.
    """
    assert not dataset.groups  # no tile has any
    arrays = {name: _numbers(variable.data) for name, variable in dataset.variables.items()}
    variables = {
        name: {"dims": v.dims, "units": v.units, "long_name": v.long_name, "attrs": v.attrs}
        | {"dtype": arrays[name].dtype.str, "shape": arrays[name].shape}
        for name, v in dataset.variables.items()
    }
    text = json.dumps({"attrs": dataset.attrs, "variables": variables}, default=_plain).encode()
    first = np.frombuffer(len(text).to_bytes(_LENGTH_BYTES, "little") + text, dtype=np.uint8)
    chunks = []
    for flat in (first, *(array.reshape(-1).view(np.uint8) for array in arrays.values())):
        chunks += [flat, np.zeros(-flat.size % ALIGNMENT, dtype=np.uint8)]
    return chunks


def dataset_of_image(image: memoryview) -> Dataset:
    """The dataset that `dataset_image` has turned into bytes, which must be undamaged.

    Its arrays are views of the bytes, and as writable as these.
    """
    length = int.from_bytes(image[:_LENGTH_BYTES], "little")
    place = _LENGTH_BYTES + length
    about = json.loads(bytes(image[_LENGTH_BYTES:place]))
    variables = {}
    for name, entry in about["variables"].items():
        place += -place % ALIGNMENT
        dtype, shape = np.dtype(entry["dtype"]), entry["shape"]
        end = place + dtype.itemsize * math.prod(shape)
        array = np.frombuffer(image[place:end], dtype=np.uint8).view(dtype).reshape(shape)
        place = end
        data = array.astype(object) if dtype.kind == "U" else array
        variables[name] = Variable(
            tuple(entry["dims"]), data, entry["units"], entry["long_name"], _attributes(entry["attrs"])
        )
    return Dataset(variables, _attributes(about["attrs"]))


def _numbers(data: NDArray[Any]) -> NDArray[Any]:
    """An array as bytes can hold it: in order, texts padded to one length."""
    return np.asarray(data.astype(str) if data.dtype == object else data, order="C")


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


FORMAT = "fastmech tile 1"
SUM_BYTES = 4
_LONGEST_LINE = 4096

Bytes: TypeAlias = "bytes | memoryview"


class DamagedTileError(InputError):
    """A tile's bytes are not those that were written."""


@dataclass(frozen=True)
class TileHead:
    """What a tile is."""

    identity: str  #: of the request, see `fastmech.tiles.section`
    section: str  #: name of the section
    index: int  #: number of the tile
    seconds: float  #: share of the wall time that it took [s]
    length: int  #: of the content [bytes]
    checksum: int  #: of the content


@dataclass(frozen=True, eq=False)
class Tile:
    """A tile that has just been computed, on its way to its file."""

    head: TileHead
    image: list[NDArray[np.uint8]]  #: its content, see `dataset_image`

    @property
    def chunks(self) -> list[Bytes]:
        """The bytes of its file, chunk after chunk."""
        line = json.dumps({"format": FORMAT, **asdict(self.head)}).encode()
        line += b" " * (-(len(line) + 1) % ALIGNMENT) + b"\n"
        return [line, *(chunk.data for chunk in self.image), zlib.crc32(line).to_bytes(SUM_BYTES, "little")]


def make_tile(identity: str, section: str, index: int, dataset: Dataset, seconds: float) -> Tile:
    """A dataset as a tile."""
    image, found = dataset_image(dataset), 0
    for chunk in image:
        found = zlib.crc32(chunk.data, found)
    length = sum(chunk.size for chunk in image)
    return Tile(TileHead(identity, section, index, round(seconds, 4), length, found), image)


def read_tile(data: Bytes, identity: str, section: str, index: int) -> tuple[TileHead, Dataset]:
    """Check a tile's bytes and what they are; the arrays of its dataset are views of them.

    Raises:
        DamagedTileError: they are damaged, cut short, or another tile's.
    """
    view = memoryview(data)
    end = bytes(view[:_LONGEST_LINE]).find(b"\n") + 1
    if not end or len(view) < end + SUM_BYTES:
        raise DamagedTileError("is cut short")
    line, image = bytes(view[:end]), view[end:-SUM_BYTES]
    if zlib.crc32(line) != int.from_bytes(view[-SUM_BYTES:], "little"):
        raise DamagedTileError("does not match its checksum")
    about = json.loads(line)
    if about.pop("format") != FORMAT:
        raise DamagedTileError("is of another format")
    found = TileHead(**about)
    if (len(image), zlib.crc32(image)) != (found.length, found.checksum):
        raise DamagedTileError("does not match its checksum")
    if (found.identity, found.section, found.index) != (identity, section, index):
        raise DamagedTileError(f"is tile {found.index} of {found.section} of another request")
    return found, dataset_of_image(image)
