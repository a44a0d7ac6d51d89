"""A tile as bytes: a line that says what it is, its content, and a digest of the line.

The line holds a digest of the content, so every byte is covered; a tile under another name, of another
request or cut short is told as surely as one with a flipped bit.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass

from fastmech.errors import InputError
from fastmech.results import Dataset
from fastmech.store.image import dataset_image, dataset_of_image

FORMAT = "fastmech tile 1"
DIGEST_BYTES = 32
_LONGEST_LINE = 4096


class DamagedTileError(InputError):
    """A tile's bytes are not those that were written."""


@dataclass(frozen=True)
class TileHead:
    """What a tile is.

    Attributes:
        identity: of the request, see `fastmech.tiles.identity`.
        section: name of the section.
        index: number of the tile.
        content: digest of the content: equal for equal results, whoever computed them.
        seconds: share of the wall time that it took [s].
    """

    identity: str
    section: str
    index: int
    content: str
    seconds: float


def encode_tile(identity: str, section: str, index: int, dataset: Dataset, seconds: float) -> bytes:
    """The bytes of a tile's file."""
    image = dataset_image(dataset)
    head = TileHead(identity, section, index, _digest(image).hex(), round(seconds, 4))
    line = json.dumps({"format": FORMAT, **asdict(head)}).encode() + b"\n"
    return b"".join((line, image, _digest(line)))


def head_of(data: bytes) -> TileHead:
    """What a tile that has just been computed is; nothing is checked."""
    line, _ = _split(data)
    return TileHead(**{name: value for name, value in json.loads(line).items() if name != "format"})


def check_tile(data: bytes, identity: str, section: str, index: int) -> TileHead:
    """Check a tile's bytes and what they are.

    Raises:
        DamagedTileError: they are damaged, cut short, or another tile's.
    """
    line, image = _split(data)
    if _digest(line) != data[-DIGEST_BYTES:] or json.loads(line)["format"] != FORMAT:
        raise DamagedTileError("does not match its checksum")
    found = head_of(data)
    if _digest(image).hex() != found.content:
        raise DamagedTileError("does not match its checksum")
    if (found.identity, found.section, found.index) != (identity, section, index):
        raise DamagedTileError(f"is tile {found.index} of {found.section} of another request")
    return found


def tile_dataset(data: bytes) -> Dataset:
    """The dataset of a tile that has been checked."""
    _, image = _split(data)
    return dataset_of_image(image)


def _split(data: bytes) -> tuple[bytes, memoryview]:
    end = data.find(b"\n", 0, _LONGEST_LINE) + 1
    if not end or len(data) < end + DIGEST_BYTES:
        raise DamagedTileError("is cut short")
    return data[:end], memoryview(data)[end:-DIGEST_BYTES]


def _digest(data: bytes | memoryview) -> bytes:
    return hashlib.blake2b(data, digest_size=DIGEST_BYTES).digest()
