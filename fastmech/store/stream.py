"""Result files larger than memory: written piece by piece along one dimension, published whole as ever."""

from __future__ import annotations

import contextlib
import itertools
import os
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import h5py
import numpy as np
from numpy.typing import NDArray

from fastmech.results import Dataset, Variable
from fastmech.store import write
from fastmech.store.chunks import LEVEL, ChunkWriter
from fastmech.store.encode import put_attrs, put_dataset, put_variable_attrs
from fastmech.store.guarded import GuardedFile
from fastmech.store.schema import DIM_NUMBER, DIM_NUMBERS, DIMENSION_ONLY, LIBRARY_VERSIONS

#: Where a part of the streamed variables lies: along the first dimension, or along several from the first on.
Place: TypeAlias = "slice | tuple[slice, ...]"

#: Part of the streamed variables, or small variables, groups and attributes that are known only then.
Piece: TypeAlias = "tuple[Place, Mapping[str, NDArray[Any]]] | Dataset"

#: Bytes of a chunk of a streamed variable, about: read as a whole, kept while it is filled.
CHUNK_BYTES = 1 << 20


@dataclass(frozen=True, eq=False)
class Stream:
    """A dataset that is computed while it is written.

    Attributes:
        fixed: its attributes and small variables, the coordinates among them.
        plane: the streamed variables with one entry along their first dimension: types, units, meanings.
        along: the streamed variables' first dimension, one of ``fixed``.
        pieces: computes the content.
        rows: entries along the first dimension that pieces have, about; a chunk has as many.
    """

    fixed: Dataset
    plane: Mapping[str, Variable]
    along: str
    pieces: Callable[[], Iterator[Piece]]
    rows: int = 8

    @property
    def nbytes(self) -> int:
        """Size of the streamed variables in memory [bytes]."""
        return sum(variable.data.nbytes for variable in self.plane.values()) * self.fixed.sizes[self.along]


def in_memory(stream: Stream) -> Dataset:
    """The dataset that a stream makes, whole."""
    length = stream.fixed.sizes[stream.along]
    arrays = {
        name: np.empty((length, *variable.data.shape[1:]), variable.data.dtype)
        for name, variable in stream.plane.items()
    }
    late: dict[str, Variable] = {}
    attrs, groups = dict(stream.fixed.attrs), dict(stream.fixed.groups)
    for piece in stream.pieces():
        if isinstance(piece, Dataset):
            late |= piece.variables
            attrs |= piece.attrs
            groups |= piece.groups
            continue
        place, parts = piece
        for name, part in parts.items():
            arrays[name][place] = part
    streamed = {
        name: Variable(about.dims, arrays[name], about.units, about.long_name, about.attrs)
        for name, about in stream.plane.items()
    }
    return Dataset({**stream.fixed.variables, **streamed, **late}, attrs, groups)


def write_stream(
    path: str | Path,
    *,
    scene_parameters: Mapping[str, Variable],
    sections: Mapping[str, Dataset | Stream],
    attrs: Callable[[], Mapping[str, Any]],
    replace: bool = False,
    aside: Path | None = None,
    threads: int = 1,
    deflate: bool = True,
) -> None:
    """Like `fastmech.store.write.write_results`, for sections of which some are streams.

    The file is composed on the disk and takes its name once it is whole; a piece at a time is in memory.

    Args:
        path, scene_parameters, replace: as there.
        sections: one dataset or stream for each section of the request.
        attrs: gives the attributes of the whole, asked for in the end.
        aside: folder on the same file system in which it is composed, by default that of the file.
        threads: threads that compress; the file does not depend on it.
        deflate: whether streams are compressed, which takes most of the time.

    Raises:
        InputError: as there.
    """
    datasets = {name: part if isinstance(part, Dataset) else part.fixed for name, part in sections.items()}
    root = write._checked_root(scene_parameters, datasets)
    with write._readable_reasons(path):
        target = write._target(path, replace)
        temporary = write._aside(aside / target.name if aside is not None else target)
        try:
            with temporary.open("xb+", buffering=0) as disk, ThreadPoolExecutor(threads) as pool:
                guarded = GuardedFile(disk)
                try:
                    with h5py.File(guarded, "w", libver=LIBRARY_VERSIONS, track_order=True) as file:
                        numbers = itertools.count()
                        put_dataset(file, root, numbers)
                        for name, section in sections.items():
                            group = file.create_group(name, track_order=True)
                            if isinstance(section, Stream):
                                chunks = ChunkWriter(pool, threads, deflate)
                                _put_stream(group, section, numbers, guarded, chunks, deflate)
                            else:
                                put_dataset(group, section, numbers)
                                guarded.check()
                        put_attrs(file, write._checked_root_attrs(attrs()))
                except (RuntimeError, ValueError, OSError):
                    guarded.check()  # HDF5's complaint follows from the disk's
                    raise
                guarded.check()
                os.fsync(disk.fileno())
            write._publish(temporary, target, replace)
        finally:
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)


def _put_stream(
    group: h5py.Group,
    stream: Stream,
    numbers: Iterator[int],
    guarded: GuardedFile,
    chunks: ChunkWriter,
    deflate: bool,
) -> None:
    put_dataset(group, stream.fixed, numbers)
    length = stream.fixed.sizes[stream.along]
    _put_missing_dimensions(group, stream, numbers)
    rows = min(length, stream.rows)
    stored = {name: _create(group, name, v, length, rows, deflate) for name, v in stream.plane.items()}
    for piece in stream.pieces():
        if isinstance(piece, Dataset):
            put_dataset(group, piece, numbers)
            continue
        place, arrays = piece
        for name, array in arrays.items():
            chunks.write(stored[name], place if isinstance(place, tuple) else (place,), array)
        guarded.check()
    chunks.finish()
    guarded.check()


def _put_missing_dimensions(group: h5py.Group, stream: Stream, numbers: Iterator[int]) -> None:
    for dim, size in Dataset(stream.plane).sizes.items():
        if dim not in group:
            scale = group.create_dataset(dim, shape=(size,), dtype=">f4")
            scale.make_scale(f"{DIMENSION_ONLY}{size:10d}")
            scale.attrs[DIM_NUMBER] = np.int32(next(numbers))


def _create(
    group: h5py.Group, name: str, variable: Variable, length: int, rows: int, deflate: bool
) -> h5py.Dataset:
    data = variable.data
    packing = {"compression": "gzip", "compression_opts": LEVEL, "shuffle": True} if deflate else {}
    stored = group.create_dataset(
        name,
        shape=(length, *data.shape[1:]),
        dtype=data.dtype,
        chunks=_chunk(rows, data),
        fletcher32=True,
        **packing,
    )
    for axis, dim in enumerate(variable.dims):
        stored.dims[axis].attach_scale(group[dim])
    stored.attrs[DIM_NUMBERS] = np.array([group[dim].attrs[DIM_NUMBER] for dim in variable.dims])
    put_variable_attrs(stored, variable)
    return stored


def _chunk(rows: int, plane: NDArray[Any]) -> tuple[int, ...]:
    """Shape of chunks: a few rows of the first dimension by as much of the second as fits."""
    second = plane.shape[1] if plane.ndim > 1 else 1
    share = max(1, min(second, CHUNK_BYTES * second // max(1, rows * plane.nbytes)))
    return (rows, *((share, *plane.shape[2:]) if plane.ndim > 1 else ()))
