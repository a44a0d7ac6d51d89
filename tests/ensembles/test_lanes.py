"""Blocks of lanes: what is put into them comes out again; runs that would not fit are refused."""

from __future__ import annotations

import tracemalloc
from typing import Any

import numpy as np
import pytest
from ensembles.starts import Floats, random_starts

import fastmech as fm
from fastmech.ensembles import checks, integrate
from fastmech.ensembles.lanes import VECTOR_LANES, Lanes
from fastmech.errors import InputError
from fastmech.scene import Scene

pytestmark = pytest.mark.nojit

SIZES = pytest.mark.parametrize("n", [1, 15, 16, 17, 300, 5000])
RECORD = np.array([0.0, 7.0, -1.0])


def filled(n: int, block_lanes: int) -> tuple[Lanes, Floats, Floats]:
    """Lanes, and the states and parameters that they were given; members are odd numbers."""
    random = np.random.default_rng(n)
    states, params = random.normal(size=(n, 4)), random.normal(size=(n, 8))
    return Lanes(2 * np.arange(n) + 1, states, params, RECORD, block_lanes), states, params


@SIZES
@pytest.mark.parametrize("block_lanes", [1, 7, 16, 100, 256, 9000])
def test_what_goes_in_comes_out(n: int, block_lanes: int) -> None:
    lanes, states, params = filled(n, block_lanes)
    np.testing.assert_array_equal(lanes.rows(lanes.Y), states)
    np.testing.assert_array_equal(lanes.rows(lanes.params), params)
    np.testing.assert_array_equal(lanes.rows(lanes.record), np.tile(RECORD, (n, 1)))


@SIZES
@pytest.mark.parametrize("block_lanes", [1, 7, 16, 100, 256, 9000])
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
            np.testing.assert_array_equal(lanes.rows(lanes.params), params[stay])
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


TIMES = np.linspace(0.0, 0.1, 2001)
STATES = TIMES.size * 20 * 4 * 8  #: bytes of the states of 20 trajectories


@pytest.mark.parametrize("arguments", [{}, {"tol": 1e-4}, {"formulation": "hamilton"}])
def test_too_little_memory_is_refused_before_any_is_taken(
    arguments: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checks, "free_memory", lambda: float(STATES))
    starts = random_starts(20)
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=r"^y0, t_eval: the states would .* are free") as error:
            fm.integrate(Scene(), starts, t_eval=TIMES, **arguments)
        assert tracemalloc.get_traced_memory()[1] < STATES / 4
    finally:
        tracemalloc.stop()
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("arguments", [{}, {"fit": [0.0, 0.05]}, {"formulation": "hamilton"}, {"tol": 1e-4}])
def test_no_run_takes_more_than_it_was_checked_for(
    arguments: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a run asks for is what Python's own bookkeeping sees it take, but for small change."""
    asked: list[float] = []
    original = checks.memory

    def noted(numbers: int, copies: int) -> None:
        asked.append(8.0 * numbers * copies)
        original(numbers, copies)

    monkeypatch.setattr(integrate.checks, "memory", noted)
    starts = random_starts(400)
    fm.integrate(Scene(), starts, t_eval=TIMES[:3], **arguments)  # whatever is compiled, is by now
    tracemalloc.start()
    try:
        fm.integrate(Scene(), starts, t_eval=TIMES, **arguments)
        assert tracemalloc.get_traced_memory()[1] < 1.1 * asked[-1]
    finally:
        tracemalloc.stop()
