"""One dataset as bytes in memory and back, for pieces of a result that are not published yet."""

from __future__ import annotations

import io
import itertools

import h5py

from fastmech.results import Dataset
from fastmech.store.encode import put_dataset
from fastmech.store.read import Section
from fastmech.store.schema import LIBRARY_VERSIONS


def dataset_image(dataset: Dataset) -> memoryview:
    """An HDF5 file of one group, not compressed; the same bytes for the same dataset."""
    buffer = io.BytesIO()
    with h5py.File(buffer, "w", libver=LIBRARY_VERSIONS, track_order=True) as file:
        put_dataset(file.create_group("tile", track_order=True), dataset, itertools.count(), plain=True)
    return buffer.getbuffer()


def dataset_of_image(image: bytes | memoryview, where: str) -> Dataset:
    """The dataset that `dataset_image` has turned into bytes.

    Args:
        image: the bytes, known to be undamaged.
        where: what they are, for messages.
    """
    with h5py.File(io.BytesIO(image), "r") as file:
        return Section(file["tile"], where).load()
