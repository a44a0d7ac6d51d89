"""Chunks of streamed variables, packed in threads and written in order.

HDF5 packs one chunk at a time, and that takes most of the time of writing a large result. Here its filters
are applied outside of it: byte shuffling, deflate and the Fletcher-32 checksum, as HDF5's file format
specification (sections "Shuffle filter", "Deflate filter", "Fletcher32 filter") lays them out. The bytes do
not depend on the number of threads.
"""

from __future__ import annotations

import zlib
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Executor, Future
from itertools import product
from typing import Any, TypeAlias

import h5py
import numpy as np
from numpy.typing import NDArray

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
    """Writes parts of chunked variables.

    Args:
        pool: packs chunks.
        threads: how many it has.
        deflate: whether chunks are compressed.
    """

    def __init__(self, pool: Executor, threads: int, deflate: bool) -> None:
        self._pool, self._most, self._deflate = pool, DEPTH * threads, deflate
        self._open: dict[tuple[h5py.Dataset, Corner], tuple[NDArray[Any], int]] = {}
        self._waiting: deque[tuple[h5py.Dataset, Corner, Future[bytes]]] = deque()

    def write(self, stored: h5py.Dataset, place: tuple[slice, ...], array: NDArray[Any]) -> None:
        """Write a part that is whole along all but the first dimensions, which ``place`` names.

        A chunk is written when all of it has come; until then it is in memory.
        """
        starts = [piece.indices(size)[0] for piece, size in zip(place, stored.shape, strict=False)]
        starts += [0] * (stored.ndim - len(starts))
        for corner in _corners(starts, array.shape, stored.chunks):
            ends = zip(corner, stored.chunks, stored.shape, strict=True)
            whole = [(c, min(c + length, size)) for c, length, size in ends]
            there = [
                (max(low, start), min(high, start + size))
                for (low, high), start, size in zip(whole, starts, array.shape, strict=True)
            ]
            source = array[tuple(slice(a - s, b - s) for (a, b), s in zip(there, starts, strict=True))]
            target = tuple(slice(a - c, b - c) for (a, b), c in zip(there, corner, strict=True))
            self._add(stored, corner, target, source, int(np.prod([b - a for a, b in whole])))

    def finish(self) -> None:
        """Write what waits."""
        for (stored, corner), (chunk, _) in self._open.items():
            self._submit(stored, corner, chunk)
        self._open.clear()
        while self._waiting:
            self._write_first()

    def _add(
        self,
        stored: h5py.Dataset,
        corner: Corner,
        target: tuple[slice, ...],
        source: NDArray[Any],
        needed: int,
    ) -> None:
        if source.shape == stored.chunks:
            self._submit(stored, corner, np.ascontiguousarray(source))
            return
        chunk, filled = self._open.pop((stored, corner), (None, 0))
        if chunk is None:
            chunk = np.zeros(stored.chunks, dtype=stored.dtype)
        chunk[target] = source
        filled += source.size
        if filled < needed:
            self._open[stored, corner] = chunk, filled
        else:
            self._submit(stored, corner, chunk)

    def _submit(self, stored: h5py.Dataset, corner: Corner, chunk: NDArray[Any]) -> None:
        while len(self._waiting) >= self._most:
            self._write_first()
        self._waiting.append((stored, corner, self._pool.submit(packed, chunk, self._deflate)))

    def _write_first(self) -> None:
        stored, corner, future = self._waiting.popleft()
        stored.id.write_direct_chunk(corner, future.result())


def _corners(starts: list[int], shape: tuple[int, ...], chunks: tuple[int, ...]) -> Iterator[Corner]:
    """First places of the chunks that a part touches."""
    ranges = [
        range(start // length * length, start + size, length)
        for start, size, length in zip(starts, shape, chunks, strict=True)
    ]
    return product(*ranges)
