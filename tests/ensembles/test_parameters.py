"""Parameters of an ensemble: columns, of which most are one number."""

from __future__ import annotations

import numpy as np
import pytest

from fastmech.ensembles.lanes import Parameters

pytestmark = pytest.mark.nojit

SHARED = Parameters((np.array(2.0), np.array(-1.0)))
OWN = Parameters((np.array(2.0), np.array([3.0, 5.0, 7.0, 11.0]), np.array(-1.0)))


def test_shared_parameters_are_those_of_all():
    assert SHARED.at(np.arange(10**9, 10**9 + 5)).tolist() == [2.0, -1.0]
    assert SHARED.block(3).tolist() == [[2.0] * 3, [-1.0] * 3]


@pytest.mark.parametrize("members", [[1, 2, 3], [0, 3], [2], [], [1, 2, 3, 3, 3]])
def test_rows_of_own_parameters(members):
    expected = [[2.0, OWN.columns[1][k], -1.0] for k in members]
    assert OWN.at(np.array(members, dtype=np.int64)).tolist() == expected
    part = OWN.part(np.array(members, dtype=np.int64))
    assert part.at(np.arange(len(members))).tolist() == expected
    assert part.block(len(members)).T.tolist() == expected


def test_arrays_of_all_and_of_each():
    assert Parameters.of([2.0, -1.0]).at(np.arange(2)).tolist() == [2.0, -1.0]
    each = np.arange(12.0).reshape(4, 3)
    assert Parameters.of(each).at(np.array([1, 3])).tolist() == each[[1, 3]].tolist()
    assert Parameters.of(OWN) is OWN
    assert Parameters.of(np.zeros(0)).at(np.arange(3)).shape == (0,)


def test_no_column_is_repeated_for_the_trajectories():
    many = Parameters((np.array(2.0), np.zeros(100_000), np.array(1.0)))
    assert sum(column.nbytes for column in many.columns) == 8 * (100_000 + 2)


def test_too_large_for_single_precision_is_told_by_nobody_here():
    rows = Parameters((np.array([1e300, 1.0]),)).at(np.arange(2), np.float32)
    assert rows.dtype == np.float32
    assert rows[:, 0].tolist() == [np.inf, 1.0]
