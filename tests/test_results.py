from __future__ import annotations

import pickle
import sys
from enum import IntEnum
from typing import Any

import numpy as np
import pytest

from fastmech.errors import InputError
from fastmech.results import Dataset, Variable, flags


class Kind(IntEnum):
    STABLE = 0
    SADDLE = 2
    UNKNOWN = -1


def test_sizes_and_access() -> None:
    dataset = Dataset(
        {
            "phi": Variable(("n",), [1.0, 2.0], "rad"),
            "n": Variable(("n",), [10, 20]),
            "y": Variable(("n", "k"), np.ones((2, 3))),
        }
    )
    assert dataset.sizes == {"n": 2, "k": 3}
    assert dataset["phi"].units == "rad"
    assert "phi" in dataset
    assert "psi" not in dataset
    assert list(dataset) == ["phi", "n", "y"]
    assert len(dataset) == 3
    with pytest.raises(InputError, match=r"'psi'.*phi, n, y"):
        dataset["psi"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((("n",), np.ones((2, 2))), "shape"),
        (((), np.ones(2)), "shape"),
        ((("n", "n"), np.ones((2, 2))), "twice"),
        ((("a b",), np.ones(2)), "'a b'"),
        ((("2n",), np.ones(2)), "'2n'"),
        (((), 1.0, ""), "units"),
        (((), 1j), "NAME_re and NAME_im"),
        (((), np.float16(1)), "float16"),
        (((), np.datetime64("2020-01-01")), "datetime64"),
        (((), {"a": 1}), "must be text"),
        (((), "a\0b"), "null"),
        (((), "\ud800"), "UTF-8"),
        (((), 1.0, "1", "", {"units": "m"}), "reserved"),
        (((), 1.0, "1", "", {"_FillValue": 0}), "_FillValue = 0: must be an integer of float64"),
        (((), np.int8(1), "1", "", {"_FillValue": 1000}), "_FillValue = 1000: must be an integer of int8"),
        (((), 1.0, "1", "", {"scale_factor": 2.0}), "reserved"),
        (((), 1.0, "1", "", {"a": None}), r"attrs\.a"),
        (((), 1.0, "1", "", {"a": [1, "b"]}), r"attrs\.a"),
        (((), 1.0, "1", "", {"a": np.ones((2, 2))}), "1-D"),
        (((), 1.0, "1", "", {"a": np.ones(5000)}), "make it a variable"),
        (((), 1.0, "1", "", {"a": 2**70}), r"attrs\.a"),
    ],
)
def test_variable_refuses(arguments: tuple[Any, ...], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        Variable(*arguments)
    assert "\n" not in str(caught.value)


def test_dataset_refuses_disagreeing_sizes() -> None:
    with pytest.raises(InputError, match=r"b: has 3 points along n, the others have 2"):
        Dataset({"a": Variable(("n",), np.ones(2)), "b": Variable(("n",), np.ones(3))})


def test_dataset_refuses_a_dimension_name_for_what_is_no_coordinate() -> None:
    with pytest.raises(InputError, match=r"must be \('n',\)"):
        Dataset({"a": Variable(("n",), np.ones(2)), "n": Variable((), 2)})


def test_bool_becomes_flags() -> None:
    variable = Variable(("n",), np.array([True, False]))
    assert variable.data.dtype == np.int8
    assert variable.data.tolist() == [1, 0]
    assert variable.attrs["flag_meanings"] == "false true"


def test_flags_follow_the_cf_conventions() -> None:
    attrs = flags(Kind)
    assert attrs["flag_values"].dtype == np.int8
    assert attrs["flag_values"].tolist() == [0, 2, -1]
    assert attrs["flag_meanings"] == "stable saddle unknown"


def test_numbers_are_not_copied() -> None:
    data = np.ones(3)
    assert Variable(("n",), data).data is data


def test_dataset_pickles() -> None:
    dataset = pickle.loads(pickle.dumps(Dataset({"a": Variable(("n",), [1.0, 2.0], "m")}, {"k": 1})))
    assert dataset["a"].data.tolist() == [1.0, 2.0]
    assert dataset.attrs == {"k": 1}


def test_to_xarray() -> None:
    dataset = Dataset(
        {
            "n": Variable(("n",), [10.0, 20.0], "N"),
            "a": Variable(("n",), [1.0, 2.0], "m", "length", {"k": 1}),
        },
        {"s": "t"},
    ).to_xarray()
    assert set(dataset.coords) == {"n"}
    assert dataset.a.sel(n=20.0) == 2.0
    assert dataset.a.attrs == {"units": "m", "long_name": "length", "k": 1}
    assert dataset.attrs == {"s": "t"}


def test_to_xarray_without_xarray_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(InputError, match=r"fastmech\[xarray\]"):
        Dataset({}).to_xarray()
