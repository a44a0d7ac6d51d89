"""Blocks of lanes: what is put into them comes out again."""

from __future__ import annotations

import numpy as np
import pytest
from ensembles.starts import Floats

from fastmech.ensembles.lanes import CACHE_LINE, Lanes, finite_rows, rows_at
from fastmech.kernels.blocks import VECTOR_LANES

pytestmark = pytest.mark.nojit

SIZES = pytest.mark.parametrize("n", [1, 15, 16, 17, 300, 5000])
RECORD = np.array([0.0, 7.0, -1.0])


def filled(n: int, block_lanes: int) -> tuple[Lanes, Floats, Floats]:
    """Lanes, and the states and parameters that they were given; members are odd numbers."""
    random = np.random.default_rng(n)
    states, params = random.normal(size=(n, 4)), random.normal(size=(n, 8))
    lanes = Lanes(2 * np.arange(n) + 1, states, params, RECORD, block_lanes, states[:, :3])
    return lanes, states, params


@SIZES
@pytest.mark.parametrize("block_lanes", [1, 7, 16, 100, 256, 9000])
def test_what_goes_in_comes_out(n: int, block_lanes: int) -> None:
    lanes, states, params = filled(n, block_lanes)
    np.testing.assert_array_equal(lanes.rows(lanes.Y), states)
    np.testing.assert_array_equal(lanes.own_params(), params)
    np.testing.assert_array_equal(lanes.rows(lanes.record), np.tile(RECORD, (n, 1)))


@SIZES
@pytest.mark.parametrize("block_lanes", [16, 100, 256, 9000])
def test_blocks_are_whole_vectors_and_filled_with_the_last(n: int, block_lanes: int) -> None:
    lanes, states, _ = filled(n, block_lanes)
    blocks, dim, width = lanes.Y.shape
    assert dim == 4
    assert width % VECTOR_LANES == 0
    assert width <= max(VECTOR_LANES, -(-block_lanes // VECTOR_LANES) * VECTOR_LANES)
    assert n <= blocks * width < n + blocks * VECTOR_LANES
    for array in (lanes.Y, lanes.params, lanes.record):
        assert array.flags.c_contiguous
    padding = lanes.Y.transpose(0, 2, 1).reshape(-1, 4)[n:]
    np.testing.assert_array_equal(padding, np.tile(states[-1], (len(padding), 1)))


@SIZES
def test_blocks_of_one_lane(n: int) -> None:
    assert filled(n, 1)[0].Y.shape == (n, 4, 1)


@SIZES
def test_what_all_share_is_given_to_every_lane(n: int) -> None:
    lanes = Lanes(np.arange(n), np.zeros((n, 4)), np.arange(8.0), RECORD, 100, 0)
    np.testing.assert_array_equal(lanes.params.transpose(0, 2, 1) - np.arange(8.0), 0.0)
    assert lanes.params.shape == (1, 8, lanes.Y.shape[2])
    assert lanes.own_params().tolist() == list(range(8))
    lanes.keep(np.arange(n) % 3 == 0, True)
    assert lanes.params.shape == (1, 8, lanes.Y.shape[2])
    assert lanes.own_params().tolist() == list(range(8))


@SIZES
@pytest.mark.parametrize("precision", [np.float64, np.float32])
def test_rows_begin_on_lines_of_the_cache(n: int, precision: type) -> None:
    states = np.random.default_rng(n).normal(size=(n, 4)).astype(precision)
    lanes = Lanes(np.arange(n), states, states, RECORD, 100, states)
    for array in (lanes.Y, lanes.params, lanes.memory):
        for row in array.reshape(-1, array.shape[2]):
            assert row.ctypes.data % CACHE_LINE == 0


def test_rows_that_lie_together_are_taken_without_copies() -> None:
    own = np.random.default_rng(1).normal(size=(5, 8))
    which = np.array([1, 4, 4])
    np.testing.assert_array_equal(rows_at(own, which), own[which])
    for together in (np.arange(1, 4), np.array([2])):
        np.testing.assert_array_equal(rows_at(own, together), own[together])
        assert np.shares_memory(rows_at(own, together), own)
    assert rows_at(own, np.arange(0)).shape == (0, 8)


@SIZES
@pytest.mark.parametrize("block_lanes", [16, 100, 256])
@pytest.mark.parametrize("stride", [1, 3])
@pytest.mark.parametrize("precision", [np.float64, np.float32])
def test_states_are_put_where_they_belong(n: int, block_lanes: int, stride: int, precision: type) -> None:
    """NaN too, and nothing beside them changes."""
    states = np.random.default_rng(n).normal(size=(n, 4)).astype(precision)
    states[0, 2] = np.nan
    members = 2 + stride * np.arange(n)
    lanes = Lanes(members, states, states, RECORD, block_lanes, states)
    values = np.full((members[-1] + 2, 4), -7.0)
    expected = values.copy()
    expected[members] = states
    lanes.put(lanes.Y, values)
    np.testing.assert_array_equal(values, expected)


def test_which_rows_are_finite() -> None:
    values = np.random.default_rng(1).normal(size=(9, 4))
    assert finite_rows(values).all()
    values[[2, 5], [0, 3]] = np.nan, -np.inf
    np.testing.assert_array_equal(np.flatnonzero(~finite_rows(values)), [2, 5])
    assert finite_rows(np.empty((0, 4))).shape == (0,)


@SIZES
def test_those_who_stay_keep_what_they_have(n: int) -> None:
    """Half leave, then half of the rest, until none is left; records are told apart by who they belong to."""
    lanes, states, params = filled(n, 64)
    random, stay = np.random.default_rng(1), np.arange(n)
    for block in lanes.record.transpose(0, 2, 1):
        block[:, 1] = 0.5
    lanes.Y *= 3.0
    while stay.size:
        which = random.random(stay.size) < 0.5
        lanes.keep(which, at_once=True)
        stay = stay[which]
        np.testing.assert_array_equal(lanes.members, 2 * stay + 1)
        if stay.size:
            np.testing.assert_array_equal(lanes.rows(lanes.Y), 3.0 * states[stay])
            np.testing.assert_array_equal(lanes.own_params(), params[stay])
            np.testing.assert_array_equal(lanes.rows(lanes.record), np.tile([0.0, 0.5, -1.0], (stay.size, 1)))
    assert lanes.members.size == 0


def test_few_are_not_worth_a_move() -> None:
    lanes, states, _ = filled(300, 64)
    which = np.arange(300) % 30 != 0  # ten leave
    lanes.keep(which, at_once=False)
    assert lanes.members.size == 300
    lanes.keep(np.ones(300, dtype=np.bool_), at_once=True)
    assert lanes.members.size == 300
    lanes.keep(which, at_once=True)
    np.testing.assert_array_equal(lanes.rows(lanes.Y), states[which])
