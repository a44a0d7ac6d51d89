"""What a page may ask for, validated as request files are, and how numbers travel back to it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from fastmech.errors import InputError, shown
from fastmech.scene import explain, nearest

#: Characters of the longest message.
LONGEST = 20_000

#: Divisions of the first basin picture along each axis, and how often they are halved at most.
COARSEST, HALVINGS = 25, 5

Range = Annotated[list[float], Field(min_length=2, max_length=2)]
Speeds = list[Annotated[float, Field(ge=-1e9, le=1e9)]]
Ranges = Annotated[dict[str, Range], Field(min_length=2, max_length=2)]


class Message(BaseModel):
    """What all have in common."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    id: Annotated[int, Field(ge=0, lt=2**53)]
    parameters: Annotated[dict[str, float], Field(max_length=100)] = {}


class EquilibriaMessage(Message):
    """All equilibria, their stability and drawings, and energy at rest over two states."""

    kind: Literal["equilibria"]
    axes: Ranges
    num: Annotated[int, Field(ge=2, le=201)] = 101


class MotionMessage(Message):
    """The motion from a start, with drawings and energies."""

    kind: Literal["motion"]
    start: Annotated[dict[str, float], Field(max_length=8)]
    t_end: Annotated[float, Field(gt=0, le=300)] = 20.0
    outputs: Annotated[int, Field(ge=2, le=18_001)] = 1201


class BasinsMessage(Message):
    """Where starts over two states end, coarse first."""

    kind: Literal["basins"]
    axes: Ranges
    halvings: Annotated[int, Field(ge=0, le=HALVINGS)] = 4


class AtlasMessage(Message):
    """Numbers of equilibria and folds over two parameters, coarse first."""

    kind: Literal["atlas"]
    axes: Ranges
    halvings: Annotated[int, Field(ge=0, le=4)] = 2


class PullMessage(Message):
    """The position in which a named point is nearest to a place [m], sought from a position."""

    kind: Literal["pull"]
    point: Annotated[str, Field(max_length=100)]
    q: Annotated[list[float], Field(max_length=4)]
    to: Range


class StrikeMessage(Message):
    """The state after a blow that would give a free mass [kg] at rest at a point this velocity [m/s]."""

    kind: Literal["strike"]
    point: Annotated[str, Field(max_length=100)]
    q: Annotated[list[float], Field(max_length=4)]
    rates: Annotated[Speeds, Field(max_length=4)]
    mass: Annotated[float, Field(gt=0)]
    velocity: Annotated[Speeds, Field(min_length=2, max_length=2)]


class StopMessage(Message):
    """Stop work of a kind."""

    kind: Literal["stop"]
    what: Literal["equilibria", "motion", "basins", "atlas", "pull", "strike"]


_KINDS = {one.__name__.removesuffix("Message").lower(): one for one in Message.__subclasses__()}
_TABLE = TypeAdapter(dict[str, Any])


def read_message(text: str | bytes) -> Any:
    """The message that a text holds.

    Raises:
        InputError: it is none, or anything in it is unknown, of a wrong type or out of range.
    """
    if len(text) > LONGEST:
        raise InputError(f"message: has {len(text):,} characters, at most {LONGEST:,} are allowed")
    try:
        table = _TABLE.validate_json(text)
    except ValidationError:
        raise InputError(f"message = {shown(text)}: must be a JSON object") from None
    kind = table.get("kind")
    if not isinstance(kind, str) or kind not in _KINDS:
        raise InputError(f"message.kind = {shown(kind)}: unknown; {nearest(str(kind), list(_KINDS))}")
    try:
        message = _KINDS[kind].model_validate(table)
    except ValidationError as error:
        raise InputError(explain(error, kind, _KINDS[kind])) from None
    for name, ends in getattr(message, "axes", {}).items():
        if not ends[0] < ends[1]:
            raise InputError(f"{kind}.axes.{name} = {shown(ends)}: must rise")
    return message


def frame(header: Mapping[str, Any], arrays: Mapping[str, Any]) -> bytes:
    """A header and arrays as bytes: the header's length (uint32), its JSON, and the arrays' numbers.

    Everything begins at a multiple of eight bytes. The header tells of each array its type, shape and place
    after the header; floats travel as float32, whole numbers as int8. All are little-endian.
    """
    told, pieces, place = [], list[bytes](), 0
    for name, values in arrays.items():
        with np.errstate(over="ignore"):  # beyond float32 is beyond every picture
            array = np.asarray(values).astype("<f4" if np.asarray(values).dtype.kind == "f" else "i1")
        told.append({"name": name, "type": array.dtype.str, "shape": array.shape, "place": place})
        pieces.append(array.tobytes() + b"\0" * (-array.nbytes % 8))
        place += len(pieces[-1])
    text = json.dumps({**header, "arrays": told}, allow_nan=False).encode()
    text += b" " * ((-len(text) - 4) % 8)
    return b"".join([len(text).to_bytes(4, "little"), text, *pieces])
