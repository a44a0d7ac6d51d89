"""One dataset as bytes in memory and back, for pieces of a result that are not published yet.

A length, so many bytes of JSON with everything but the arrays, then the arrays as they lie in memory. HDF5,
which lets one thread at a time do anything, would take some ten milliseconds for the same. Nothing is copied
on the way out and nothing on the way back: at tens of megabytes a copy costs as much as writing them.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastmech.results import Dataset, Variable

#: Every array begins at a multiple of so many bytes, as kernels want it.
ALIGNMENT = 64

_LENGTH_BYTES = 8


def dataset_image(dataset: Dataset) -> list[NDArray[np.uint8]]:
    """The bytes of a dataset in consecutive chunks, the same for the same dataset.

    The chunks are views of its arrays where these are contiguous.
    """
    assert not dataset.groups  # no tile has any
    arrays = {name: _numbers(variable.data) for name, variable in dataset.variables.items()}
    about = {
        "attrs": _plain(dataset.attrs),
        "variables": {
            name: {
                "dims": variable.dims,
                "units": variable.units,
                "long_name": variable.long_name,
                "attrs": _plain(variable.attrs),
                "dtype": arrays[name].dtype.str,
                "shape": arrays[name].shape,
            }
            for name, variable in dataset.variables.items()
        },
    }
    text = json.dumps(about).encode()
    first = np.frombuffer(len(text).to_bytes(_LENGTH_BYTES, "little") + text, dtype=np.uint8)
    chunks = []
    for flat in (first, *(array.reshape(-1).view(np.uint8) for array in arrays.values())):
        chunks += [flat, np.zeros(-flat.size % ALIGNMENT, dtype=np.uint8)]
    return chunks


def dataset_of_image(image: memoryview) -> Dataset:
    """The dataset that `dataset_image` has turned into bytes, which must be undamaged.

    Its arrays are views of the bytes, and as writable as these.
    """
    length = int.from_bytes(image[:_LENGTH_BYTES], "little")
    place = _LENGTH_BYTES + length
    about = json.loads(bytes(image[_LENGTH_BYTES:place]))
    variables = {}
    for name, entry in about["variables"].items():
        place += -place % ALIGNMENT
        dtype, shape = np.dtype(entry["dtype"]), entry["shape"]
        end = place + dtype.itemsize * math.prod(shape)
        array = np.frombuffer(image[place:end], dtype=np.uint8).view(dtype).reshape(shape)
        place = end
        data = array.astype(object) if dtype.kind == "U" else array
        variables[name] = Variable(
            tuple(entry["dims"]), data, entry["units"], entry["long_name"], _attributes(entry["attrs"])
        )
    return Dataset(variables, _attributes(about["attrs"]))


def _numbers(data: NDArray[Any]) -> NDArray[Any]:
    """An array as bytes can hold it: in order, texts padded to one length."""
    return np.asarray(data.astype(str) if data.dtype == object else data, order="C")


def _plain(attrs: Mapping[str, Any]) -> dict[str, Any]:
    plain: dict[str, Any] = {}
    for name, value in attrs.items():
        if isinstance(value, np.ndarray):
            plain[name] = {"dtype": value.dtype.str, "values": value.tolist()}
        elif isinstance(value, tuple):
            plain[name] = {"texts": value}
        else:
            plain[name] = value
    return plain


def _attributes(plain: Mapping[str, Any]) -> dict[str, Any]:
    attrs: dict[str, Any] = {}
    for name, value in plain.items():
        if not isinstance(value, dict):
            attrs[name] = value
        elif "texts" in value:
            attrs[name] = tuple(value["texts"])
        else:
            attrs[name] = np.array(value["values"], dtype=value["dtype"])
    return attrs
