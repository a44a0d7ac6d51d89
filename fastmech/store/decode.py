"""HDF5 groups back into labelled data; the counterpart of `fastmech.store.encode`.

A file may come from anywhere, so nothing in it is trusted: only what the store itself writes is followed.
That leaves out links to other files, data kept in other files, and filters that HDF5 would load as plugins.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt

from fastmech.errors import InputError
from fastmech.results import RESERVED_ATTRS, Variable
from fastmech.store.schema import DIM_NUMBER, DIM_NUMBERS, DIMENSION_ONLY

_FILTERS = {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32}


@contextmanager
def named_damage(what: str) -> Iterator[None]:
    """Turn whatever h5py raises on damaged contents into one line that names them."""
    try:
        yield
    except (OSError, RuntimeError, ValueError, KeyError, TypeError, AttributeError, IndexError) as error:
        reason = " ".join(str(part) for part in error.args) or type(error).__name__
        raise InputError(f"{what}: is damaged or not written by fastmech: {reason}") from error


def members(group: h5py.Group) -> dict[str, h5py.Group | h5py.Dataset]:
    """The objects of a group, in the order in which they were written, links to elsewhere left out."""
    return {name: group[name] for name in group if isinstance(group.get(name, getlink=True), h5py.HardLink)}


def is_dimension_only(stored: h5py.Dataset) -> bool:
    """Whether a stored array is a dimension without coordinate."""
    mark = stored.attrs.get("NAME", b"") if stored.is_scale else b""
    return bool(mark.startswith(DIMENSION_ONLY.encode()))


def dimensions(stored: Iterable[h5py.Dataset]) -> dict[int, str]:
    """The dimensions among the arrays of a group: number and name."""
    return {int(scale.attrs[DIM_NUMBER]): _own_name(scale) for scale in stored if scale.is_scale}


def own_dimensions(stored: h5py.Dataset, dims: Mapping[int, str]) -> tuple[str, ...]:
    """Names of a variable's dimensions; ``dims`` are the group's."""
    return tuple(dims[number] for number in stored.attrs[DIM_NUMBERS]) if stored.ndim else ()


@dataclass(frozen=True)
class About:
    """A stored variable without its values.

    Attributes:
        sizes: length of each of its dimensions.
        dtype: type of the values, object for texts.
        units, long_name, attrs: as of `fastmech.results.Variable`.
    """

    sizes: dict[str, int]
    dtype: np.dtype[Any]
    units: str
    long_name: str
    attrs: dict[str, Any]


def about_variable(stored: h5py.Dataset, dims: Mapping[int, str], where: str) -> About:
    """What is said of a stored variable; its values are not read.

    Raises:
        InputError: it is damaged or kept in another way than the store's own.
    """
    with named_damage(where):
        _check_storage(stored)
        attrs = get_attrs(stored)
        text = h5py.check_string_dtype(stored.dtype) is not None
        return About(
            dict(zip(own_dimensions(stored, dims), stored.shape, strict=True)),
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
    """Read a stored variable.

    Args:
        stored: the variable.
        dims: the group's dimensions.
        where: the variable's full name, for messages.
        part: what to take along some dimensions, all of the others.

    Raises:
        InputError: its data are damaged or kept in another way than the store's own.
    """
    with named_damage(where):
        _check_storage(stored)
        text = h5py.check_string_dtype(stored.dtype) is not None
        attrs = get_attrs(stored)
        own_dims = own_dimensions(stored, dims)
        wanted = [(part or {}).get(dim, slice(None)) for dim in own_dims]
        if text:
            data = np.asarray(stored.asstr()[()], dtype=object)[tuple(wanted)]
        elif all(piece == slice(None) for piece in wanted):
            data = np.asarray(stored[()])
        else:
            data = _read_part(stored, wanted)
        return Variable(own_dims, data, attrs.pop("units"), attrs.pop("long_name"), attrs)


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
    return {
        name: _python_value(stored.attrs[name])
        for name in stored.attrs
        if name not in RESERVED_ATTRS and not name.startswith("_")
    }


def _python_value(value: Any) -> Any:
    if isinstance(value, bytes):
        return value.decode()
    if isinstance(value, np.ndarray) and value.dtype.kind == "S":
        return tuple(text.decode() for text in value)
    return value.item() if isinstance(value, np.generic) else value


def _own_name(stored: h5py.Dataset) -> str:
    return str(stored.name).rpartition("/")[2]


def _check_storage(stored: h5py.Dataset) -> None:
    properties = stored.id.get_create_plist()
    filters = {properties.get_filter(i)[0] for i in range(properties.get_nfilters())}
    if stored.is_virtual or stored.external or not filters <= _FILTERS:
        raise ValueError("its data lie elsewhere or need a plugin")
