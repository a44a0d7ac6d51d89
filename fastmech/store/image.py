"""One dataset as bytes in memory and back, for pieces of a result that are not published yet.

A line of JSON with everything but the arrays, then the arrays in NumPy's own format. HDF5, which lets one
thread at a time do anything, would take some ten milliseconds for the same.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from fastmech.results import Dataset, Variable


def dataset_image(dataset: Dataset) -> memoryview:
    """The bytes of a dataset, the same for the same dataset."""
    buffer = io.BytesIO()
    about = {
        "attrs": _plain(dataset.attrs),
        "variables": {
            name: {
                "dims": variable.dims,
                "units": variable.units,
                "long_name": variable.long_name,
                "attrs": _plain(variable.attrs),
            }
            for name, variable in dataset.variables.items()
        },
    }
    buffer.write(json.dumps(about).encode() + b"\n")
    for variable in dataset.variables.values():
        text = variable.data.dtype == object
        array = variable.data.astype(str) if text else np.ascontiguousarray(variable.data)
        np.lib.format.write_array(buffer, array.reshape(variable.data.shape), allow_pickle=False)
    return buffer.getbuffer()


def dataset_of_image(image: bytes | memoryview) -> Dataset:
    """The dataset that `dataset_image` has turned into bytes, which must be undamaged."""
    buffer = io.BytesIO(image)
    about = json.loads(buffer.readline())
    variables = {}
    for name, entry in about["variables"].items():
        array = np.lib.format.read_array(buffer, allow_pickle=False)
        data = array.astype(object) if array.dtype.kind == "U" else array
        variables[name] = Variable(
            tuple(entry["dims"]), data, entry["units"], entry["long_name"], _attributes(entry["attrs"])
        )
    return Dataset(variables, _attributes(about["attrs"]))


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
