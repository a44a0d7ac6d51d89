"""Selections along coordinates: the nearest point, ranges, and what is refused."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from fastmech.errors import InputError
from fastmech.results import Dataset, Variable
from fastmech.store.read import Section, open_results
from fastmech.store.write import write_results

#: Unequal spacings, falling, out of order, a single value, whole numbers; and one without coordinate.
AXES: dict[str, tuple[Any, str]] = {
    "F0": ([-10.0, 0.0, 10.0, 100.0], "N"),
    "c1": ([30.0, 20.0, 0.0], "N/m"),
    "c2": ([5.0, 1.0, 3.0], "N/m"),
    "alpha": ([0.25], "1/s"),
    "sample": ([2, 4], "1"),
}


@pytest.fixture
def section(content: dict[str, Any], tmp_path: Path) -> Iterator[Section]:
    dims = (*AXES, "root")
    shape = (*(len(values) for values, _ in AXES.values()), 6)
    variables = {"phi": Variable(dims, np.arange(np.prod(shape), dtype=float).reshape(shape), "rad", "angle")}
    for name, (values, unit) in AXES.items():
        variables[name] = Variable((name,), np.array(values), unit, name)
    path = tmp_path / "axes.h5"
    write_results(path, **{**content, "sections": {"map": Dataset(variables)}})
    with open_results(path) as results:
        yield results["map"]


@pytest.mark.parametrize(
    ("name", "value", "place"),
    [
        ("F0", 0.0, 1),
        ("F0", 54.0, 2),
        ("F0", -15.0, 0),  # half a spacing beyond the end
        ("F0", 145.0, 3),  # and beyond the other, whose spacing is larger
        ("F0", np.float32(9.0), 2),
        ("F0", np.array(9.0), 2),
        ("F0", np.int64(9), 2),
        ("F0", Fraction(19, 2), 2),
        ("c1", -9.0, 2),
        ("c1", 34.0, 0),
        ("c2", 3.4, 2),
        ("alpha", 0.25, 0),
        ("sample", 3.9, 1),
        ("root", 5, 5),
    ],
)
def test_the_nearest_point(section: Section, name: str, value: Any, place: int) -> None:
    part = section.select(["phi"], **{name: value})
    whole = section["phi"]
    np.testing.assert_array_equal(part["phi"].data, whole.data.take(place, whole.dims.index(name)))
    assert part["phi"].dims == tuple(dim for dim in whole.dims if dim != name)
    if name in AXES:
        assert part[name].data == AXES[name][0][place]


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("F0", 5000.0, r"^F0 = 5000: must be within -10 to 100 N, or at most half a spacing beyond; .*map$"),
        ("F0", -15.1, "F0 = -15.1: must be within -10 to 100 N"),
        ("F0", 145.1, "F0 = 145.1: must be within"),
        ("c1", -10.1, "c1 = -10.1: must be within 0 to 30 N/m"),
        ("alpha", 0.26, "alpha = 0.26: must be within 0.25 to 0.25 1/s"),
        ("root", 6, "root = 6: must be one of the places 0 to 5"),
        ("root", 1.5, "root = 1.5: must be one of the places 0 to 5"),
        ("F1", 1.0, "F1: is no dimension of .*; it has F0, c1"),
        ("F0", slice(11, 99), "F0 = 11 to 99: must be within -10 to 100 N and hold at least one value"),
        ("F0", slice(10, 0), "F0 = 10 to 0: the low end"),
        ("F0", slice(0, 10, 2), "without a step"),
        ("root", slice(6, None), "root = 6 to inf: must be within 0 to 5"),
        *(
            (name, value, f"^{name} = .*: must be a finite number or a range slice")
            for name in ("F0", "root")
            for value in (
                float("nan"), float("inf"), True, np.True_, "a", "1.0", None, [1, 2], np.ones(2), 1j,
                10**400, slice("a", None), slice(float("nan"), 1.0), slice(False, True),
            )
        ),
    ],
)  # fmt: skip
def test_what_is_refused(section: Section, name: str, value: Any, message: str) -> None:
    with pytest.raises(InputError, match=message) as refused:
        section.select(["phi"], **{name: value})
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("name", "wanted", "places"),
    [
        ("F0", slice(0.0, 10.0), [1, 2]),
        ("F0", slice(None, 9.0), [0, 1]),
        ("F0", slice(1.0, None), [2, 3]),
        ("F0", slice(None, None), [0, 1, 2, 3]),
        ("F0", slice(-1e9, 1e9), [0, 1, 2, 3]),
        ("F0", slice(100, 100), [3]),
        ("c1", slice(15.0, 30.0), [0, 1]),
        ("c2", slice(2.0, 5.0), [0, 2]),
        ("root", slice(2, 4), [2, 3, 4]),
    ],
)
def test_a_range(section: Section, name: str, wanted: slice, places: list[int]) -> None:
    part = section.select(["phi"], **{name: wanted})
    whole = section["phi"]
    assert part["phi"].dims == whole.dims
    np.testing.assert_array_equal(part["phi"].data, whole.data.take(places, whole.dims.index(name)))
    if name in AXES:
        np.testing.assert_array_equal(part[name].data, np.array(AXES[name][0])[places])


def test_a_range_beside_a_point(section: Section) -> None:
    part = section.select(["phi"], F0=slice(0.0, 100.0), c2=slice(2.0, None), c1=20.0, root=1)
    assert part["phi"].dims == ("F0", "c2", "alpha", "sample")
    np.testing.assert_array_equal(part["phi"].data, section["phi"].data[1:, 1, :, :, :, 1][:, [0, 2]])


@hypothesis_settings(
    deadline=None, max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(value=st.floats(-400.0, 400.0))
def test_nearest_or_refused(section: Section, value: float) -> None:
    """The nearest point of all wherever a value is not refused, and refused only off the axis."""
    axis = np.array(AXES["F0"][0])
    try:
        taken = section.select(["F0"], F0=value)["F0"].data
    except InputError:
        assert value < -15.0 or value > 145.0
    else:
        assert abs(taken - value) == np.abs(axis - value).min()
        assert -15.0 - 1e-6 <= value <= 145.0 + 1e-6


def test_only_what_is_named_and_its_coordinates_come(write: Callable[[], Path]) -> None:
    with open_results(write()) as results:
        part = results["atlas"].select(["energy"], F0=slice(0.0, 20.0), c2=100.0)
        assert set(part) == {"energy", "F0", "c2"}
