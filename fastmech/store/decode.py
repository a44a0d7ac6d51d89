"""HDF5 groups back into labelled data; the counterpart of `fastmech.store.write`.

A file may come from anywhere, so nothing in it is trusted: only what the store itself writes is followed.
That leaves out links to other files, data kept in other files, filters that HDF5 would load as plugins, texts
of variable length and names that are not plain. What a file may ask of memory and time is limited, too; the
environment variable ``FASTMECH_FILE_LIMITS`` raises all of these limits by its factor.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt

from fastmech.errors import InputError, shown
from fastmech.results import FILL, RESERVED_ATTRS, Variable, check_name, codes_of
from fastmech.store.schema import DIM_NUMBER, DIM_NUMBERS, DIMENSION_ONLY, ENCODING

_FILTERS = {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32}

#: Environment variable: the factor by which a file may exceed the limits below.
LIMITS = "FASTMECH_FILE_LIMITS"

#: Groups of a file, and variables.
MOST_GROUPS, MOST_VARIABLES = 1_000, 20_000

#: Attributes of a group or variable, and bytes of each.
MOST_ATTRS, MOST_ATTR_BYTES = 1_000, 1 << 24

#: Bytes of a chunk, which HDF5 unpacks as a whole: the store's own have about a megabyte.
MOST_CHUNK_BYTES = 1 << 27

#: Bytes of all values once they are unpacked: so many anyway, and so many for each byte of the file. What
#: deflate packs a thousandfold holds next to nothing; results of fastmech are packed a few times.
FREE_BYTES, UNPACKED = 1 << 28, 200


def raised(limit: int) -> int:
    """A limit times the factor that the user allows.

    Raises:
        InputError: the environment variable is no positive number.
    """
    text = os.environ.get(LIMITS, "1")
    try:
        factor = float(text)
    except ValueError:
        factor = math.nan
    if not 0.0 < factor < math.inf:
        raise TooMuchError(f"{LIMITS} = {shown(text)}: must be a positive number, such as 10")
    return int(limit * factor)


class TooMuchError(InputError):
    """A file asks for more than a file may that need not be trusted, or that limit is none."""


class Allowance:
    """What a file may ask for: its groups, its variables and the bytes of their values are taken off it."""

    def __init__(self, path: Path) -> None:
        self._path = path
        limits = {
            "groups": MOST_GROUPS,
            "variables": MOST_VARIABLES,
            "bytes of unpacked values": max(FREE_BYTES, UNPACKED * path.stat().st_size),
        }
        self._limits = {what: raised(limit) for what, limit in limits.items()}
        self._left = dict(self._limits)

    def take(self, groups: int = 0, variables: int = 0, nbytes: int = 0) -> None:
        """Take off so much.

        Raises:
            TooMuchError: more than is left.
        """
        for what, amount in zip(self._left, (groups, variables, nbytes), strict=True):
            self._left[what] -= amount
            if self._left[what] < 0:
                raise TooMuchError(
                    f"{self._path}: has more than {self._limits[what]:,} {what}; {LIMITS}=10 in the"
                    " environment allows ten times as much, of a file that you trust"
                )


@contextmanager
def named_damage(what: str) -> Iterator[None]:
    """Turn whatever h5py raises on damaged contents into one line that names them."""
    try:
        yield
    except TooMuchError:
        raise
    except (OSError, RuntimeError, ValueError, KeyError, TypeError, AttributeError, IndexError) as error:
        reason = " ".join(str(part) for part in error.args) or type(error).__name__
        raise InputError(f"{what}: is damaged or not written by fastmech: {reason}") from error


def members(group: h5py.Group, where: str, left: Allowance) -> dict[str, h5py.Group | h5py.Dataset]:
    """The objects of a group, in the order in which they were written, links to elsewhere left out.

    Raises:
        InputError: more than the file may have, in number or size, or one whose name is not plain.
    """
    found = {}
    for name in group:
        if isinstance(group.get(name, getlink=True), h5py.HardLink):
            check_name(name, where)
            found[name] = group[name]
            if isinstance(found[name], h5py.Dataset):
                left.take(variables=1, nbytes=(found[name].size or 0) * found[name].dtype.itemsize)
                continue
        left.take(groups=1)
    return found


def is_characters(stored: h5py.Dataset) -> bool:
    """Whether a stored array holds the characters of texts."""
    return stored.dtype == np.dtype("S1") and stored.ndim > 0 and ENCODING in stored.attrs


def is_dimension_only(stored: h5py.Dataset) -> bool:
    """Whether a stored array is a dimension without coordinate."""
    mark = stored.attrs.get("NAME", b"") if stored.is_scale else b""
    return bool(mark.startswith(DIMENSION_ONLY.encode()))


def dimensions(stored: Iterable[h5py.Dataset]) -> dict[int, str]:
    """The dimensions among the arrays of a group: number and name."""
    return {
        int(scale.attrs[DIM_NUMBER]): str(scale.name).rpartition("/")[2] for scale in stored if scale.is_scale
    }


@dataclass(frozen=True)
class About:
    """A stored variable without its values."""

    sizes: dict[str, int]  #: length of each of its dimensions
    dtype: np.dtype[Any]  #: type of the values, object for texts
    units: str  #: as of `fastmech.results.Variable`
    long_name: str
    attrs: dict[str, Any]


def about_variable(stored: h5py.Dataset, dims: Mapping[int, str], where: str) -> About:
    """What is said of a stored variable; its values are not read. ``dims`` are the group's dimensions.

    Raises:
        InputError: it is damaged or kept in another way than the store's own.
    """
    with named_damage(where):
        _check_storage(stored)
        attrs = get_attrs(stored)
        if FILL in stored.attrs and stored.dtype.kind in "iu":  # the one value that stands for none
            attrs[FILL] = int(stored.attrs[FILL])
        codes_of(attrs)  # says what does not fit together
        text = h5py.check_string_dtype(stored.dtype) is not None
        own = [dims[number] for number in stored.attrs[DIM_NUMBERS]] if stored.ndim else []
        return About(
            dict(zip(own[:-1] if is_characters(stored) else own, stored.shape, strict=False)),
            np.dtype(object) if text else stored.dtype,
            attrs.pop("units"),
            attrs.pop("long_name"),
            attrs,
        )


#: Bytes of a variable that are in memory at a time when only a part of it is wanted.
PIECE_BYTES = 1 << 24


def get_variable(
    stored: h5py.Dataset, dims: Mapping[int, str], where: str, part: Mapping[str, slice] | None = None
) -> Variable:
    """Read a stored variable, of some dimensions a ``part``; ``where`` is its full name, for messages.

    Raises:
        InputError: its data are damaged or kept in another way than the store's own.
    """
    about = about_variable(stored, dims, where)
    with named_damage(where):
        wanted = [(part or {}).get(dim, slice(None)) for dim in about.sizes]
        if is_characters(stored):
            raw = np.ascontiguousarray(stored[()])
            whole = raw.reshape(-1).view(f"S{raw.shape[-1]}").reshape(raw.shape[:-1])
            data = np.char.decode(whole, "utf-8").astype(object)[tuple(wanted)]
        elif about.dtype == object:  # schema 1 and 2
            data = np.asarray(stored.asstr()[()], dtype=object)[tuple(wanted)]
        elif all(piece == slice(None) for piece in wanted):
            data = np.asarray(stored[()])
        else:
            data = _read_part(stored, wanted)
        return Variable(tuple(about.sizes), data, about.units, about.long_name, about.attrs)


def _read_part(stored: h5py.Dataset, part: list[slice]) -> npt.NDArray[Any]:
    """A part of numbers: neighbouring rows at a time, thinned in memory, which is faster than in the file."""
    rows = range(*part[0].indices(stored.shape[0]))
    row_bytes = stored.dtype.itemsize * math.prod(stored.shape[1:])
    together = max(1, PIECE_BYTES // max(1, row_bytes * rows.step))
    pieces = [rows[k : k + together] for k in range(0, len(rows), together)]
    read = [stored[piece.start : piece.stop][:: piece.step][:, *part[1:]] for piece in pieces if len(piece)]
    return np.concatenate(read) if read else np.empty((0, *stored.shape[1:]), stored.dtype)[:, *part[1:]]


def get_attrs(stored: h5py.Group | h5py.Dataset) -> dict[str, Any]:
    """The attributes of a group or variable, those of HDF5 and netCDF themselves left out."""
    if len(stored.attrs) > raised(MOST_ATTRS):
        raise ValueError(f"has {len(stored.attrs):,} attributes")
    attrs = {}
    for name in stored.attrs:
        if name not in RESERVED_ATTRS and not name.startswith("_"):
            check_name(name, "attribute")
            if stored.attrs.get_id(name).get_storage_size() > raised(MOST_ATTR_BYTES):
                raise ValueError(f"the attribute {name} is too long")
            attrs[name] = _python_value(stored.attrs[name])
    return attrs


def _python_value(value: Any) -> Any:
    if isinstance(value, bytes):
        return value.decode()
    if isinstance(value, np.ndarray) and value.dtype.kind == "S":
        return tuple(text.decode() for text in value)
    return value.item() if isinstance(value, np.generic) else value


def _check_storage(stored: h5py.Dataset) -> None:
    properties = stored.id.get_create_plist()
    filters = {properties.get_filter(i)[0] for i in range(properties.get_nfilters())}
    if stored.is_virtual or stored.external or not filters <= _FILTERS:
        raise ValueError("its data lie elsewhere or need a plugin")
    if stored.shape is None:
        raise ValueError("it has no values")
    if stored.dtype.kind == "O":
        raise ValueError("its values are of variable length")
    if stored.chunks and math.prod(stored.chunks) * stored.dtype.itemsize > raised(MOST_CHUNK_BYTES):
        raise ValueError(f"its chunks have more than {raised(MOST_CHUNK_BYTES):,} bytes")
