"""Chunks packed in threads are HDF5's own, byte for byte, however they come."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fastmech.results import Dataset, Variable
from fastmech.store.provenance import provenance
from fastmech.store.read import open_results
from fastmech.store.write import Piece, Stream, packed, write_results

ROWS, COLUMNS = 23, 37
VALUES = np.random.default_rng(3).normal(size=(ROWS, COLUMNS, 2))


@settings(max_examples=40, deadline=None)
@given(
    st.sampled_from(["f8", "f4", "i1", "i4", "u2"]),
    st.integers(1, 5),
    st.integers(1, 700),
    st.sampled_from(["random", "zeros", "full"]),
    st.booleans(),
)
def test_a_chunk_has_the_bytes_that_hdf5_writes(
    dtype: str, rows: int, columns: int, what: str, deflate: bool
) -> None:
    raw = np.random.default_rng(rows * columns).bytes(rows * columns * np.dtype(dtype).itemsize)
    raw = {"random": raw, "zeros": bytes(len(raw)), "full": b"\xff" * len(raw)}[what]
    chunk = np.frombuffer(raw, dtype=dtype).reshape(rows, columns)
    options = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if deflate else {}
    with h5py.File(io.BytesIO(), "w") as file:
        stored = file.create_dataset("a", data=chunk, chunks=chunk.shape, fletcher32=True, **options)
        file.flush()
        mask, right = stored.id.read_direct_chunk((0, 0))
    if mask == 0:  # HDF5 leaves the filter out where it would not make the chunk smaller
        assert packed(chunk, deflate) == right


def stream(rows: int, columns: int) -> Stream:
    """A section in pieces of so many rows and columns."""

    def pieces() -> Iterator[Piece]:
        for i in range(0, ROWS, rows):
            for j in range(0, COLUMNS, columns):
                place = slice(i, i + rows), slice(j, j + columns)
                yield place, {"v": VALUES[place]}
        yield slice(0, ROWS), {"w": VALUES[:, 0, 0]}

    plane = {"v": Variable(("x", "y", "z"), VALUES[:1]), "w": Variable(("x",), VALUES[:1, 0, 0])}
    fixed = Dataset({"x": Variable(("x",), np.arange(float(ROWS)))})
    return Stream(fixed, plane, "x", pieces, rows=5)


@pytest.mark.parametrize("deflate", [True, False])
def test_pieces_and_threads_do_not_show(
    deflate: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fastmech.store.write.CHUNK_BYTES", 1000)
    images = []
    attrs = {**provenance(1), "title": "chunks"}
    for k, (rows, columns, threads) in enumerate([(5, COLUMNS, 1), (1, 1, 3), (ROWS, 4, 2), (7, 9, 2)]):
        path = tmp_path / f"{k}.h5"
        section = {"one": stream(rows, columns)}
        write_results(
            path, scene_parameters={}, sections=section, attrs=lambda: attrs, threads=threads, deflate=deflate
        )
        with open_results(path) as results:
            assert results["one"]["v"].data.tobytes() == VALUES.tobytes()
            assert results["one"]["w"].data.tobytes() == VALUES[:, 0, 0].tobytes()
            stored = results["one"]._stored["v"]
            chunks = (stored.id.get_chunk_info(n).chunk_offset for n in range(stored.id.get_num_chunks()))
            images.append({corner: stored.id.read_direct_chunk(corner) for corner in chunks})
    assert len(images[0]) > 5
    assert all(image == images[0] for image in images)
