"""Labelled data into HDF5 groups, as netCDF-4 lays them out (see `fastmech.store.schema`)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt

from fastmech.results import Dataset, Variable, cf_attrs
from fastmech.store.schema import (
    CHARACTERS,
    COMPACT_BYTES,
    DIM_NUMBER,
    DIM_NUMBERS,
    DIMENSION_ONLY,
    ENCODING,
)


def put_dataset(group: h5py.Group, dataset: Dataset, numbers: Iterator[int]) -> None:
    """Write a dataset with its groups into an empty group.

    Its dimensions come first, so that all variables can refer to them.

    Args:
        group: where to.
        dataset: what.
        numbers: gives a number to each dimension, unique in the file.
    """
    variables = {name: _characters(variable) for name, variable in dataset.variables.items()}
    sizes = {dim: size for variable in variables.values() for dim, size in variable.sizes.items()}
    dim_numbers = {dim: np.int32(next(numbers)) for dim in sizes}
    scales = {dim: put_scale(group, dim, size, variables) for dim, size in sizes.items()}
    for dim, scale in scales.items():
        scale.attrs[DIM_NUMBER] = dim_numbers[dim]
    for name, variable in variables.items():
        if name in scales:
            stored = scales[name]
        else:
            stored = _put_variable(group, name, variable)
            for axis, dim in enumerate(variable.dims):
                stored.dims[axis].attach_scale(scales[dim])
        if variable.dims:
            stored.attrs[DIM_NUMBERS] = np.array([dim_numbers[dim] for dim in variable.dims])
    put_attrs(group, dataset.attrs)
    for name, inner in dataset.groups.items():
        put_dataset(group.create_group(name, track_order=True), inner, numbers)


def put_variable_attrs(stored: h5py.Dataset, variable: Variable | _Characters) -> None:
    """Write what is said of a variable."""
    put_attrs(stored, cf_attrs(variable.units, variable.long_name, variable.attrs, variable.data.dtype))


def put_attrs(target: h5py.Group | h5py.Dataset, attrs: Mapping[str, Any]) -> None:
    """Write attributes as `fastmech.results.checked_attrs` returns them."""
    for name, value in attrs.items():
        if isinstance(value, (str, tuple)):
            encoded = _encoded(value)
            value = encoded.astype(h5py.string_dtype("utf-8", encoded.dtype.itemsize))
        target.attrs[name] = value


def _encoded(texts: npt.ArrayLike) -> npt.NDArray[np.bytes_]:
    """UTF-8, padded with null bytes, which reading drops, to the longest text."""
    encoded = np.char.encode(np.asarray(texts, dtype=str), "utf-8")
    return encoded.astype(f"S{max(1, encoded.dtype.itemsize)}")


@dataclass(frozen=True)
class _Characters:
    """A variable of texts as its bytes, with one more dimension."""

    dims: tuple[str, ...]
    data: npt.NDArray[np.bytes_]
    units: str
    long_name: str
    attrs: Mapping[str, Any]

    @property
    def sizes(self) -> dict[str, int]:
        """Length of each dimension."""
        return dict(zip(self.dims, self.data.shape, strict=True))


def _characters(variable: Variable) -> Variable | _Characters:
    """Texts as arrays of characters, which all netCDF readers decode alike; other variables as they are."""
    if variable.data.dtype != object:
        return variable
    encoded = _encoded(variable.data)
    length = encoded.dtype.itemsize
    data = encoded.reshape(-1).view("S1").reshape(*encoded.shape, length)
    dims = (*variable.dims, f"{CHARACTERS}{length}")
    return _Characters(dims, data, variable.units, variable.long_name, variable.attrs)


def put_scale(
    group: h5py.Group, dim: str, size: int, variables: Mapping[str, Variable | _Characters]
) -> h5py.Dataset:
    """Make a dimension, of the variable of its name if there is one."""
    if dim in variables:
        scale = _put_variable(group, dim, variables[dim])
        scale.make_scale(dim)
    else:
        # never written, so it takes no room: only its shape counts
        scale = group.create_dataset(dim, shape=(size,), dtype=">f4")
        scale.make_scale(f"{DIMENSION_ONLY}{size:10d}")
    return scale


def _put_variable(group: h5py.Group, name: str, variable: Variable | _Characters) -> h5py.Dataset:
    data = variable.data
    if data.nbytes <= COMPACT_BYTES:
        stored = _create_compact(group, name, data.shape, data.dtype)
    else:
        stored = group.create_dataset(
            name,
            shape=data.shape,
            dtype=data.dtype,
            chunks=True,
            compression="gzip",
            compression_opts=4,
            shuffle=True,
            fletcher32=True,
        )
    if data.size:
        stored[...] = data
    if isinstance(variable, _Characters):
        put_attrs(stored, {ENCODING: "utf-8"})
    put_variable_attrs(stored, variable)
    return stored


def _create_compact(
    group: h5py.Group, name: str, shape: tuple[int, ...], dtype: np.dtype[Any]
) -> h5py.Dataset:
    # h5py's create_dataset drops the layout of scalars, hence the calls below it
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_layout(h5py.h5d.COMPACT)
    properties.set_obj_track_times(False)
    file_type = h5py.h5t.py_create(np.dtype(dtype), logical=True)
    space = h5py.h5s.create_simple(shape)
    return h5py.Dataset(h5py.h5d.create(group.id, name.encode(), file_type, space, dcpl=properties))
