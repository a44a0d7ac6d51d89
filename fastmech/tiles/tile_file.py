"""A tile as bytes: a line that says what it is, its content, and a digest of both.

The digest covers every byte of the file, also the line; a tile under another name, of another request or cut
short is told as surely as one with a flipped bit.
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
    return b"".join((line, image, _digest(line, image)))


def check_tile(data: bytes, identity: str, section: str, index: int) -> TileHead:
    """Check a tile's bytes and what they are.

    Raises:
        DamagedTileError: they are damaged, cut short, or another tile's.
    """
    line, _ = _split(data)
    head = json.loads(line)
    if head.pop("format") != FORMAT:
        raise DamagedTileError(f"is no {FORMAT}")
    found = TileHead(**head)
    if (found.identity, found.section, found.index) != (identity, section, index):
        raise DamagedTileError(f"is tile {found.index} of {found.section} of another request")
    return found


def tile_dataset(data: bytes) -> Dataset:
    """The dataset of a tile that has been checked."""
    _, image = _split(data, checked=True)
    return dataset_of_image(image)


def _split(data: bytes, checked: bool = False) -> tuple[bytes, memoryview]:
    end = data.find(b"\n", 0, _LONGEST_LINE) + 1
    if not end or len(data) < end + DIGEST_BYTES:
        raise DamagedTileError("is cut short")
    view = memoryview(data)
    if not checked and _digest(view[:-DIGEST_BYTES]) != data[-DIGEST_BYTES:]:
        raise DamagedTileError("does not match its checksum")
    return data[:end], view[end:-DIGEST_BYTES]


def _digest(*parts: bytes | memoryview) -> bytes:
    digest = hashlib.blake2b(digest_size=DIGEST_BYTES)
    for part in parts:
        digest.update(part)
    return digest.digest()
