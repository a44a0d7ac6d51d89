"""Result files larger than memory: written piece by piece along one dimension, published whole as ever."""

from __future__ import annotations

import itertools
import os
import shutil
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import h5py
import numpy as np
from numpy.typing import NDArray

from fastmech.errors import InputError
from fastmech.results import Dataset, Variable
from fastmech.store import write
from fastmech.store.encode import put_attrs, put_dataset
from fastmech.store.schema import DIM_NUMBER, DIM_NUMBERS, DIMENSION_ONLY, LIBRARY_VERSIONS

#: Part of the streamed variables along the first dimension, or small variables that are known only then.
Piece: TypeAlias = "tuple[slice, Mapping[str, NDArray[Any]]] | Dataset"

#: Bytes of a chunk of a streamed variable, about: read as a whole, kept while it is filled.
CHUNK_BYTES = 1 << 20


@dataclass(frozen=True, eq=False)
class Stream:
    """A dataset that is computed while it is written.

    Attributes:
        fixed: its attributes and small variables, the coordinates among them; `wall_time_s` is added.
        plane: the streamed variables with one entry along their first dimension: types, units, meanings.
        along: the streamed variables' first dimension, a coordinate of ``fixed``.
        pieces: computes the content.
    """

    fixed: Dataset
    plane: Mapping[str, Variable]
    along: str
    pieces: Callable[[], Iterator[Piece]]


def write_stream(
    path: str | Path,
    *,
    scene_parameters: Mapping[str, Variable],
    sections: Mapping[str, Dataset | Stream],
    attrs: Callable[[], Mapping[str, Any]],
    replace: bool = False,
) -> None:
    """Like `fastmech.store.write.write_results`, for sections of which some are streams.

    The file is composed on the disk beside its final place and takes its name once it is whole. A stream's
    memory is that of a piece.

    Args:
        path, scene_parameters, replace: as there.
        sections: one dataset or stream for each section of the request.
        attrs: gives the attributes of the whole, asked for in the end.

    Raises:
        InputError: as there, or the disk has no room for the next piece.
    """
    datasets = {name: part if isinstance(part, Dataset) else part.fixed for name, part in sections.items()}
    root = write._checked_root(scene_parameters, datasets)
    with write._readable_reasons(path):
        target = write._target(path, replace)
        temporary = write._aside(target)
        try:
            with h5py.File(temporary, "x", libver=LIBRARY_VERSIONS, track_order=True) as file:
                numbers = itertools.count()
                put_dataset(file, root, numbers)
                for name, section in sections.items():
                    group = file.create_group(name, track_order=True)
                    if isinstance(section, Stream):
                        started = time.perf_counter()
                        _put_stream(group, section, numbers, target.parent)
                        put_attrs(group, {"wall_time_s": time.perf_counter() - started})
                    else:
                        put_dataset(group, section, numbers)
                put_attrs(file, write._checked_root_attrs(attrs()))
            with temporary.open("rb") as written:
                os.fsync(written.fileno())
            write._publish(temporary, target, replace)
        finally:
            temporary.unlink(missing_ok=True)


def _put_stream(group: h5py.Group, stream: Stream, numbers: Iterator[int], folder: Path) -> None:
    put_dataset(group, stream.fixed, numbers)
    length = stream.fixed.sizes[stream.along]
    _put_missing_dimensions(group, stream, numbers)
    stored = {name: _create(group, name, variable, length) for name, variable in stream.plane.items()}
    for piece in stream.pieces():
        if isinstance(piece, Dataset):
            put_dataset(group, piece, numbers)
            continue
        rows, arrays = piece
        needed = sum(array.nbytes for array in arrays.values())
        # HDF5 may crash the process when the disk is full, so it is asked before.
        if shutil.disk_usage(folder).free < 2 * needed:
            raise InputError(f"{folder}: has no room for the result's next {needed / 1e6:.0f} MB")
        for name, array in arrays.items():
            stored[name][rows] = array


def _put_missing_dimensions(group: h5py.Group, stream: Stream, numbers: Iterator[int]) -> None:
    for dim, size in Dataset(stream.plane).sizes.items():
        if dim not in group:
            scale = group.create_dataset(dim, shape=(size,), dtype=">f4")
            scale.make_scale(f"{DIMENSION_ONLY}{size:10d}")
            scale.attrs[DIM_NUMBER] = np.int32(next(numbers))


def _create(group: h5py.Group, name: str, variable: Variable, length: int) -> h5py.Dataset:
    data = variable.data
    stored = group.create_dataset(
        name,
        shape=(length, *data.shape[1:]),
        dtype=data.dtype,
        chunks=_chunk(length, data),
        compression="gzip",
        compression_opts=1,
        shuffle=True,
        fletcher32=True,
    )
    for axis, dim in enumerate(variable.dims):
        stored.dims[axis].attach_scale(group[dim])
    stored.attrs[DIM_NUMBERS] = np.array([group[dim].attrs[DIM_NUMBER] for dim in variable.dims])
    put_attrs(stored, {"units": variable.units, "long_name": variable.long_name, **variable.attrs})
    return stored


def _chunk(length: int, plane: NDArray[Any]) -> tuple[int, ...]:
    """Shape of chunks: a few rows of the first dimension by as much of the second as fits."""
    rows = min(length, 8)
    second = plane.shape[1] if plane.ndim > 1 else 1
    share = max(1, min(second, CHUNK_BYTES * second // max(1, rows * plane.nbytes)))
    return (rows, *((share, *plane.shape[2:]) if plane.ndim > 1 else ()))
