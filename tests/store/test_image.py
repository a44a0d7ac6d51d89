"""Datasets as bytes and back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from fastmech.results import Dataset, Variable
from fastmech.tiles.tile_file import dataset_image, dataset_of_image

pytestmark = pytest.mark.nojit

TYPES = st.sampled_from([np.float64, np.float32, np.int8, np.int16, np.int32, np.int64, np.uint8])
ARRAYS = TYPES.flatmap(
    lambda kind: hnp.arrays(kind, hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4))
)
TEXTS = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=5)


@given(ARRAYS, st.lists(TEXTS, max_size=4), TEXTS, st.floats(allow_nan=False), st.integers(-9, 9))
def test_there_and_back(array, texts, text, number, integer) -> None:
    dims = ("a", "b", "c")[: array.ndim]
    attrs = {"text": text, "number": number, "integer": integer, "texts": ("x", text), "array": np.arange(3)}
    words = np.array(texts, dtype=object)
    dataset = Dataset(
        {"array": Variable(dims, array, "m", text), "texts": Variable(("t",), words, attrs=attrs)}, attrs
    )
    image = dataset_image(dataset)
    again = dataset_of_image(image)
    assert dataset_image(again) == image
    assert list(again) == list(dataset)
    for name in dataset:
        one, two = dataset[name], again[name]
        assert (one.dims, one.units, one.long_name) == (two.dims, two.units, two.long_name)
        assert one.data.dtype == two.data.dtype
        assert two.data.flags.aligned
        assert two.data.flags.writeable
        assert one.data.shape == two.data.shape
        assert one.data.tolist() == two.data.tolist() or one.data.tobytes() == two.data.tobytes()
    for found in (again.attrs, again["texts"].attrs):
        assert (found["text"], found["texts"], found["integer"]) == (text, ("x", text), integer)
        assert repr(found["number"]) == repr(number)
        assert found["array"].tolist() == [0, 1, 2]
