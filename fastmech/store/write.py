"""Writing a result file: whole under its final name, or not at all.

A file for HDF5 on a disk that may fill up. HDF5 may crash the process when a write fails, at the latest when
it closes the file. So it never learns of it: after the first failure nothing is written any more, and whoever
writes asks for the failure.

Chunks of streamed variables, packed in threads and written in order. HDF5 packs one chunk at a time, and that
takes most of the time of writing a large result. Here its filters are applied outside of it: byte shuffling,
deflate and the Fletcher-32 checksum, as HDF5's file format specification (sections "Shuffle filter", "Deflate
filter", "Fletcher32 filter") lays them out. The bytes do not depend on the number of threads.
"""

from __future__ import annotations

import contextlib
import io
import itertools
import os
import secrets
import zlib
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import IO, Any, TypeAlias

import h5py
import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from fastmech.errors import InputError
from fastmech.results import Dataset, Variable, cf_attrs, check_name, checked_attrs
from fastmech.store import schema


def put_dataset(group: h5py.Group, dataset: Dataset, numbers: Iterator[int]) -> None:
    """Write a dataset with its groups into an empty group, dimensions first, to which variables refer.

    ``numbers`` gives a number to each dimension, unique in the file.
    """
    forms = {name: _form(variable) for name, variable in dataset.variables.items()}
    sizes = {d: n for dims, data in forms.values() for d, n in zip(dims, data.shape, strict=True)}
    dim_numbers = {dim: np.int32(next(numbers)) for dim in sizes}
    for dim, size in sizes.items():
        if dim in forms:
            _put_variable(group, dim, dataset[dim], forms[dim][1]).make_scale(dim)
        else:
            put_dimension(group, dim, size)
        group[dim].attrs[schema.DIM_NUMBER] = dim_numbers[dim]
    for name, (dims, data) in forms.items():
        if name not in sizes:
            _attach(_put_variable(group, name, dataset[name], data), group, dims)
        elif dims:
            group[name].attrs[schema.DIM_NUMBERS] = np.array([dim_numbers[dim] for dim in dims])
    put_attrs(group, dataset.attrs)
    for name, inner in dataset.groups.items():
        put_dataset(group.create_group(name, track_order=True), inner, numbers)


def put_dimension(group: h5py.Group, dim: str, size: int) -> h5py.Dataset:
    """Make a dimension without coordinate."""
    # never written, so it takes no room: only its shape counts
    scale = group.create_dataset(dim, shape=(size,), dtype=">f4")
    scale.make_scale(f"{schema.DIMENSION_ONLY}{size:10d}")
    return scale


def _attach(stored: h5py.Dataset, group: h5py.Group, dims: tuple[str, ...]) -> None:
    """Tell HDF5 and netCDF the dimensions of a variable."""
    for axis, dim in enumerate(dims):
        stored.dims[axis].attach_scale(group[dim])
    if dims:
        stored.attrs[schema.DIM_NUMBERS] = np.array([group[dim].attrs[schema.DIM_NUMBER] for dim in dims])


def put_variable_attrs(stored: h5py.Dataset, variable: Variable) -> None:
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


def _form(variable: Variable) -> tuple[tuple[str, ...], npt.NDArray[Any]]:
    """Dimensions and values as they are kept: texts as arrays of characters, which all decode alike."""
    if variable.data.dtype != object:
        return variable.dims, variable.data
    encoded = _encoded(variable.data)
    length = encoded.dtype.itemsize
    data = encoded.reshape(-1).view("S1").reshape(*encoded.shape, length)
    return (*variable.dims, f"{schema.CHARACTERS}{length}"), data


def _put_variable(group: h5py.Group, name: str, variable: Variable, data: npt.NDArray[Any]) -> h5py.Dataset:
    if data.nbytes <= schema.COMPACT_BYTES:
        stored = _create_compact(group, name, data.shape, data.dtype)
    else:
        packing = {"chunks": True, "compression": "gzip", "compression_opts": 4, "shuffle": True}
        stored = group.create_dataset(name, data.shape, data.dtype, fletcher32=True, **packing)
    if data.size:
        stored[...] = data
    if variable.data.dtype == object:
        put_attrs(stored, {schema.ENCODING: "utf-8"})
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


#: Endings of result files; one without an ending is allowed.
ENDINGS = ("", ".h5", ".hdf5", ".nc")


def check_ending(path: str | Path) -> None:
    """Refuse a name that promises another format, such as ``map.csv``."""
    if (ending := Path(path).suffix) not in ENDINGS:
        raise InputError(f"{path}: a result file is HDF5: must end in .h5, .hdf5 or .nc, not {ending}")


def check_writable(path: str | Path, replace: bool = False) -> None:
    """Find out before a long run whether its result can be written; missing parent folders are made.

    Raises:
        InputError: the folder is unwritable, the path is a folder, or the file exists and `replace` is False.
    """
    with readable_reasons(path):
        probe = _target(path, replace).with_name(f".fastmech-{secrets.token_hex(8)}.tmp")
        probe.touch(exist_ok=False)
        probe.unlink()


def write_results(
    path: str | Path,
    *,
    scene_parameters: Mapping[str, Variable],
    sections: Mapping[str, Dataset | Stream],
    attrs: Mapping[str, Any] | Callable[[], Mapping[str, Any]],
    replace: bool = False,
    aside: Path | None = None,
    threads: int = 1,
    deflate: bool = True,
) -> None:
    """Write a result file (see `fastmech.store.schema`); missing parent folders are made.

    The file is written aside, flushed to the disk and then takes its final name at once: under that name
    there is always a complete file, or the older one, or none. Of streams a piece at a time is in memory.

    Args:
        path: the result file to be.
        scene_parameters: the scene's parameters, scalars with their units.
        sections: one dataset or stream for each section of the request.
        attrs: attributes of the whole, or what gives them in the end.
        replace: whether a file of that name may be replaced.
        aside: folder on the same file system in which it is written first, by default that of the file.
        threads: threads that compress streams; the file does not depend on it.
        deflate: whether streams are compressed, which takes most of the time.

    Raises:
        InputError: the folder is unwritable, the disk is full, the path is a folder, the file exists and
            `replace` is False, or the content does not fit the schema.
    """
    for name in sections:
        check_name(name, "sections")
        if name in scene_parameters:
            raise InputError(f"sections.{name}: is the name of a parameter of the scene; choose another")
    with (
        readable_reasons(path),
        published(_target(path, replace), replace, aside) as temporary,
        temporary.open("xb+", buffering=0) as disk,
        ThreadPoolExecutor(threads) as pool,
    ):
        guarded = GuardedFile(disk)
        try:
            with h5py.File(guarded, "w", libver=schema.LIBRARY_VERSIONS, track_order=True) as file:
                numbers = itertools.count()
                put_dataset(file, Dataset(scene_parameters), numbers)
                for name, section in sections.items():
                    group = file.create_group(name, track_order=True)
                    if isinstance(section, Stream):
                        chunks = ChunkWriter(pool, threads, deflate)
                        _put_stream(group, section, numbers, guarded, chunks)
                    else:
                        put_dataset(group, section, numbers)
                        guarded.check()
                own = {"format": schema.FORMAT, "schema_version": schema.SCHEMA_VERSION}
                put_attrs(file, own | {"Conventions": schema.CONVENTIONS})
                put_attrs(file, checked_attrs(attrs() if callable(attrs) else attrs, "attrs"))
        except (RuntimeError, ValueError, OSError):
            guarded.check()  # HDF5's complaint follows from the disk's
            raise
        guarded.check()
        os.fsync(disk.fileno())


def _target(path: str | Path, replace: bool) -> Path:
    """The file that `path` names, symbolic links followed, in a folder that exists."""
    check_ending(path)
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise InputError(f"{path}: is a folder; give the name of a file in it")
    if target.exists() and not replace:
        raise _already_exists(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    return target


@contextlib.contextmanager
def published(target: Path, replace: bool, folder: Path | None = None) -> Iterator[Path]:
    """A path aside, in that folder, whose file takes its final name at once and for good after the block.

    Of a block that fails nothing is left.
    """
    aside = (folder or target.parent) / f".fastmech-{secrets.token_hex(8)}.tmp"
    try:
        yield aside
        _publish(aside, target, replace)
    finally:
        with contextlib.suppress(OSError):
            aside.unlink(missing_ok=True)


def _publish(temporary: Path, target: Path, replace: bool) -> None:
    if replace:
        os.replace(temporary, target)
    else:
        try:
            # a link is made only if the name is free, whoever else tries at the same time
            os.link(temporary, target)
        except FileExistsError:
            raise _already_exists(target) from None
        except OSError:
            # a file system without hard links: not exclusive against a race, but still all or nothing
            if target.exists():
                raise _already_exists(target) from None
            os.replace(temporary, target)
    with contextlib.suppress(OSError):  # the new name is durable, where the system can make it so
        folder = os.open(target.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def _already_exists(path: str | Path) -> InputError:
    return InputError(f"{path}: exists already; remove it, choose another name or allow replacing it")


@contextlib.contextmanager
def readable_reasons(path: str | Path, what: str = "written") -> Iterator[None]:
    """Turn the failures of a file system into one line with the path and the system's reason."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: cannot be {what}: {error.strerror or error}") from error


class GuardedFile(io.RawIOBase):
    """A file on ``disk``, open without a buffer, that keeps the first failure to itself until `check`."""

    def __init__(self, disk: IO[bytes]) -> None:
        self._disk = disk
        self._failure: OSError | None = None

    def check(self) -> None:
        """Raise the failure, if there was one."""
        if self._failure is not None:
            raise self._failure

    @contextlib.contextmanager
    def _kept(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self._failure = self._failure or error

    def write(self, data: object) -> int:
        """Write all of the data, or nothing any more after a failure."""
        view = memoryview(data).cast("B")  # type: ignore[arg-type]
        done = 0
        with self._kept():
            while self._failure is None and done < len(view):
                done += self._disk.write(view[done:])
        return len(view)

    def readinto(self, buffer: object) -> int:
        """Read as much as there is; what was never written reads as zeros."""
        view = memoryview(buffer).cast("B")  # type: ignore[arg-type]
        filled = 0
        with self._kept():
            while filled < len(view) and (part := self._disk.read(len(view) - filled)):
                view[filled : filled + len(part)] = part
                filled += len(part)
        view[filled:] = bytes(len(view) - filled)
        return len(view)

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Go to a place."""
        return self._disk.seek(offset, whence)

    def tell(self) -> int:
        """The place."""
        return self._disk.tell()

    def truncate(self, size: int | None = None) -> int:
        """Change the length."""
        length = self._disk.tell() if size is None else size
        with self._kept():
            if self._failure is None:
                self._disk.truncate(length)
        return length


#: Level of deflate: higher ones take many times as long for a few per cent.
LEVEL = 1

#: Chunks that wait to be written at most, for each thread.
DEPTH = 4

_CHECKSUM_BYTES = 4

Corner: TypeAlias = "tuple[int, ...]"


def packed(chunk: NDArray[Any], deflate: bool) -> bytes:
    """A chunk as it lies in the file: shuffled and deflated, or as it is, with its checksum behind."""
    if deflate:
        parts = chunk.reshape(-1).view(np.uint8).reshape(-1, chunk.itemsize)
        data = zlib.compress(np.ascontiguousarray(parts.T).data, LEVEL)
    else:
        data = chunk.tobytes()
    return data + fletcher32(data).to_bytes(_CHECKSUM_BYTES, "little")


def fletcher32(data: bytes) -> int:
    """The checksum of HDF5's filter: sums of words of 16 bits, modulo 65535, which 0 stands for only in 0."""
    even = data + b"\0" if len(data) % 2 else data
    words = np.frombuffer(even, dtype=">u2").astype(np.uint64)
    first = int(words.sum())
    second = int(np.dot(words, np.arange(words.size, 0, -1, dtype=np.uint64)))
    low, high = ((total - 1) % 65535 + 1 if total else 0 for total in (first, second))
    return high << 16 | low


class ChunkWriter:
    """Writes parts of chunked variables."""

    def __init__(self, pool: Executor, threads: int, deflate: bool) -> None:
        self._pool, self._most, self._deflate = pool, DEPTH * threads, deflate
        #: How HDF5 is told of what is done here.
        self.packing = {"compression": "gzip", "compression_opts": LEVEL, "shuffle": True} if deflate else {}
        #: Chunks of which a part has come, and how many of their values have not.
        self._open: dict[tuple[h5py.Dataset, Corner], tuple[NDArray[Any], int]] = {}
        self._waiting: deque[tuple[h5py.Dataset, Corner, Future[bytes]]] = deque()

    def write(self, stored: h5py.Dataset, place: tuple[slice, ...], array: NDArray[Any]) -> None:
        """Write a part that is whole along all but the first dimensions, which ``place`` names.

        A chunk is written when all of it has come; until then it is in memory.
        """
        starts = [piece.indices(size)[0] for piece, size in zip(place, stored.shape, strict=False)]
        starts += [0] * (stored.ndim - len(starts))
        each = zip(starts, array.shape, stored.chunks, strict=True)
        for corner in product(*(range(first // c * c, first + n, c) for first, n, c in each)):
            ends = np.minimum(np.add(corner, stored.chunks), stored.shape)
            low, high = np.maximum(corner, starts), np.minimum(ends, np.add(starts, array.shape))
            source = array[tuple(map(slice, low - starts, high - starts))]
            chunk, left = self._open.pop((stored, corner), (None, int(np.prod(ends - corner))))
            if chunk is None:
                chunk = np.zeros(stored.chunks, dtype=stored.dtype)
            chunk[tuple(map(slice, low - corner, high - corner))] = source
            if left > source.size:
                self._open[stored, corner] = chunk, left - source.size
            else:
                self._submit(stored, corner, chunk)

    def finish(self) -> None:
        """Write what waits."""
        for (stored, corner), (chunk, _) in self._open.items():
            self._submit(stored, corner, chunk)
        self._open.clear()
        while self._waiting:
            self._write_first()

    def _submit(self, stored: h5py.Dataset, corner: Corner, chunk: NDArray[Any]) -> None:
        while len(self._waiting) >= self._most:
            self._write_first()
        self._waiting.append((stored, corner, self._pool.submit(packed, chunk, self._deflate)))

    def _write_first(self) -> None:
        stored, corner, future = self._waiting.popleft()
        stored.id.write_direct_chunk(corner, future.result())


#: Where a part of the streamed variables lies: along the first dimension, or along several from the first on.
Place: TypeAlias = "slice | tuple[slice, ...]"

#: Part of the streamed variables, or small variables, groups and attributes that are known only then.
Piece: TypeAlias = "tuple[Place, Mapping[str, NDArray[Any]]] | Dataset"

#: Bytes of a chunk of a streamed variable, about: read as a whole, kept while it is filled.
CHUNK_BYTES = 1 << 20


@dataclass(frozen=True, eq=False)
class Stream:
    """A dataset that is computed while it is written."""

    fixed: Dataset  #: its attributes and small variables, the coordinates among them
    #: the streamed variables with one entry along their first dimension: types, units, meanings
    plane: Mapping[str, Variable]
    along: str  #: the streamed variables' first dimension, one of ``fixed``
    pieces: Callable[[], Iterator[Piece]]  #: computes the content
    rows: int = 8  #: entries along the first dimension that pieces have, about; a chunk has as many

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
    streamed = {name: replace(about, data=arrays[name]) for name, about in stream.plane.items()}
    return Dataset({**stream.fixed.variables, **streamed, **late}, attrs, groups)


def _put_stream(
    group: h5py.Group,
    stream: Stream,
    numbers: Iterator[int],
    guarded: GuardedFile,
    chunks: ChunkWriter,
) -> None:
    put_dataset(group, stream.fixed, numbers)
    length = stream.fixed.sizes[stream.along]
    for dim, size in Dataset(stream.plane).sizes.items():
        if dim not in group:
            put_dimension(group, dim, size).attrs[schema.DIM_NUMBER] = np.int32(next(numbers))
    rows, stored = min(length, stream.rows), dict[str, h5py.Dataset]()
    for name, variable in stream.plane.items():
        data, shape = variable.data, (length, *variable.data.shape[1:])
        how = {"chunks": _chunk(rows, data), "fletcher32": True, **chunks.packing}
        stored[name] = group.create_dataset(name, shape, data.dtype, **how)
        _attach(stored[name], group, variable.dims)
        put_variable_attrs(stored[name], variable)
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


def _chunk(rows: int, plane: NDArray[Any]) -> tuple[int, ...]:
    """Shape of chunks: a few rows of the first dimension by as much of the second as fits."""
    second = plane.shape[1] if plane.ndim > 1 else 1
    share = max(1, min(second, CHUNK_BYTES * second // max(1, rows * plane.nbytes)))
    return (rows, *((share, *plane.shape[2:]) if plane.ndim > 1 else ()))
