"""Adams methods in whole steps: the motions of the general driver, and nobody notices the others."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from integrators.driving import observe_times, one_block
from kernels.blocks_of_lanes import Floats, lanes

from fastmech.integrators.batch import Batch
from fastmech.integrators.driver import observe_nothing
from fastmech.integrators.method import Adams
from fastmech.integrators.methods import METHODS
from fastmech.integrators.whole import in_whole_steps
from fastmech.integrators.whole_multistep import WholeAdams
from fastmech.kernels import lagrange
from fastmech.kernels.blocks import VECTOR_LANES
from fastmech.kernels.far import FARTHEST
from fastmech.mechanism.coefficients import reduce
from fastmech.scene import Scene

ADAMS = {name: method for name, method in METHODS.items() if isinstance(method, Adams)}
EVERY_ADAMS = pytest.mark.parametrize("name", ADAMS)
STEPS, END = 60, 0.15


def batch_of(Y: Floats, pieces: list[int], rows: int = 0) -> Any:
    """One block of damped motion without force, through pieces of equal steps."""
    params = np.repeat(np.array(reduce(Scene(F0=0.0)))[:, None], Y.shape[1], axis=1)
    times = END * np.concatenate([[0.0], np.cumsum(pieces)]) / sum(pieces)
    return replace(
        one_block(Y, params, times, STEPS),
        steps=np.array(pieces),
        out=np.empty((1, len(pieces), *Y.shape)),
        record=np.zeros((1, rows, Y.shape[1])),
        observer_params=np.ones(1),
    )


def through(method: Adams, Y: Floats, pieces: list[int] | None = None) -> Floats:
    """Last states (4, lanes)."""
    batch = batch_of(Y, pieces or [STEPS])
    with np.errstate(all="ignore"):  # plain Python warns where compiled code is silent
        method.run(lagrange.lagrange_damped, observe_nothing, batch)
    np.testing.assert_array_equal(batch.out[0, -1], batch.Y[0])
    return np.asarray(batch.Y[0])


def whole(name: str) -> WholeAdams:
    method = in_whole_steps(ADAMS[name], lagrange.lagrange_damped)
    assert isinstance(method, WholeAdams)
    return method


@pytest.mark.nojit
@EVERY_ADAMS
def test_motions_are_those_of_the_general_driver(name: str) -> None:
    Y = lanes(VECTOR_LANES)
    np.testing.assert_allclose(through(whole(name), Y), through(ADAMS[name], Y), rtol=0, atol=1e-11)


@pytest.mark.nojit
@pytest.mark.parametrize("name", ["ab6", "abm12"])
def test_motions_far_out_are_those_of_the_general_driver_and_others_do_not_notice(name: str) -> None:
    method, near = whole(name), lanes(VECTOR_LANES)
    alone, mixed = through(method, near), near.copy()
    mixed[0, 2], mixed[1, 9] = 1e17, -1e200  # where the fast trigonometry gives nonsense; the angles stay
    mixed[2, 12] = np.nan
    found, right = through(method, mixed), through(ADAMS[name], mixed)
    np.testing.assert_allclose(found[:, [2, 9]], right[:, [2, 9]], rtol=1e-9, atol=0)
    np.testing.assert_array_equal(found[:, [2, 9]], through(method, mixed[:, ::-1].copy())[:, [13, 6]])
    assert np.isnan(found[:, 12]).all()
    healthy = np.setdiff1d(np.arange(VECTOR_LANES), [2, 9, 12])
    np.testing.assert_array_equal(found[:, healthy], alone[:, healthy])


@pytest.mark.nojit
@pytest.mark.parametrize("direction", [-1.0, 1.0])
@pytest.mark.parametrize("name", ["ab6", "abm8"])
def test_motions_that_come_and_go_across_the_limit_depend_on_nobody(name: str, direction: float) -> None:
    method, Y = whole(name), lanes(VECTOR_LANES)
    Y[0], Y[2] = FARTHEST - direction, direction * np.linspace(1.0, 20.0, VECTOR_LANES)
    together = through(method, Y)
    assert len(set(np.sign(together[0] - FARTHEST))) == 2
    for i in range(VECTOR_LANES):
        one = np.repeat(Y[:, i : i + 1], VECTOR_LANES, axis=1)
        np.testing.assert_array_equal(through(method, one)[:, 0], together[:, i])


def forced(lane_blocks: int, rows: int = 0) -> Any:
    """Blocks of damped motion under a decaying force, own for each lane; the step changes and comes back."""
    times, steps = np.array([0.3, 0.45, 0.75, 0.9]), np.array([60, 50, 60])
    n = lane_blocks * VECTOR_LANES
    random = np.random.default_rng(5)
    own = [
        np.array(reduce(Scene(F0=force, alpha=alpha, c1=spring)))
        for force, alpha, spring in random.uniform([-300, 1, 100], [300, 9, 200], (n, 3))
    ]
    params = np.ascontiguousarray(np.array(own).reshape(lane_blocks, VECTOR_LANES, -1).transpose(0, 2, 1))
    Y = np.ascontiguousarray(lanes(n).reshape(4, lane_blocks, VECTOR_LANES).transpose(1, 0, 2))
    Y[1, 0, 3], Y[2, 1, 7] = 3e7, -1e17  # far out, where a motion that is seen has 9 digits, or none
    Y[2, 2, 8] = 1.0 / 3e-3  # turns by more than 1 rad a step
    blocks, dim, width = Y.shape
    return Batch(
        times=times,
        steps=steps,
        params=params,
        observer_params=np.ones(1),
        Y=Y,
        record=np.zeros((blocks, rows, width)),
        out=np.empty((blocks, steps.size, dim, width)),
    )


@EVERY_ADAMS
def test_blocks_with_their_own_parameters_under_a_force_of_time(name: str) -> None:
    """Against the general driver, observed or not; motions that a step is too long for are left out."""
    rhs, general = lagrange.lagrange_damped_decaying, forced(3)
    method = in_whole_steps(ADAMS[name], rhs)
    found, seen = forced(3), forced(3, rows=4)
    with np.errstate(all="ignore"):  # plain Python warns where compiled code is silent
        ADAMS[name].run(rhs, observe_nothing, general)
        method.run(rhs, observe_nothing, found)
        method.run(rhs, observe_times, seen)
    np.testing.assert_array_equal(found.out, seen.out)
    np.testing.assert_array_equal(seen.record[:, 1], seen.times[-1])
    ends = seen.times[:-1, None] + np.diff(seen.times)[:, None] / seen.steps[:, None] * np.arange(1, 61)
    every = sum(end[:steps].sum() for end, steps in zip(ends, seen.steps, strict=True))
    np.testing.assert_allclose(seen.record[:, 2], every, rtol=1e-13)
    steady = np.ones((3, VECTOR_LANES), dtype=bool)
    steady[1, 3] = steady[2, 8] = False
    off = np.abs(found.out - general.out).max(axis=(1, 2))
    assert off[steady].max() < 1e-10
    assert off[1, 3] < 1e-6  # an angle of 3e7 rad has 8 digits behind the point


@EVERY_ADAMS
def test_neither_calls_nor_observers_change_a_bit(name: str) -> None:
    """Two calls of pieces are one; who looks after every step sees the same states, far out too."""
    method, Y = whole(name), lanes(VECTOR_LANES)
    Y[0, 4] = 1e9
    pieces = [50, 70, 33]
    once = batch_of(Y, pieces)
    method.run(lagrange.lagrange_damped, observe_nothing, once)
    twice, phase, memory = [], np.zeros(3), np.zeros((1, method.carried * 4, VECTOR_LANES))
    state = Y[None].copy()
    for part in (slice(0, 1), slice(1, 3)):
        batch = batch_of(Y, pieces)
        batch = replace(
            batch,
            times=batch.times[part.start : part.stop + 1],
            steps=batch.steps[part],
            out=batch.out[:, part],
            Y=state,
            memory=memory,
            phase=phase,
        )
        method.run(lagrange.lagrange_damped, observe_nothing, replace(batch, out=batch.out.copy()))
        twice.append(state.copy())
    np.testing.assert_array_equal(once.Y, twice[-1])
    np.testing.assert_array_equal(once.out[:, 0], twice[0])
    seen = batch_of(Y, pieces, rows=4)
    method.run(lagrange.lagrange_damped, observe_times, seen)
    np.testing.assert_array_equal(seen.out, once.out)
    np.testing.assert_array_equal(seen.record[0, 0], float(sum(pieces)))
    np.testing.assert_array_equal(seen.record[0, 3], seen.out[0, -1, 0])


@EVERY_ADAMS
def test_another_step_starts_anew(name: str) -> None:
    """The same, bit for bit, as two runs."""
    method, Y = whole(name), lanes(VECTOR_LANES)
    batch = replace(batch_of(Y, [40, 40]), times=np.array([0.0, 0.1, 0.3]))
    method.run(lagrange.lagrange_damped, observe_nothing, batch)
    first = replace(batch_of(Y, [40]), times=np.array([0.0, 0.1]))
    method.run(lagrange.lagrange_damped, observe_nothing, first)
    second = replace(batch_of(first.Y[0], [40]), times=np.array([0.1, 0.3]))
    method.run(lagrange.lagrange_damped, observe_nothing, second)
    np.testing.assert_array_equal(batch.Y, second.Y)


@EVERY_ADAMS
def test_right_hand_sides_are_counted(name: str) -> None:
    """Those of the general driver, and one where the method starts and one after each of its first steps."""
    general, method = ADAMS[name], whole(name)
    for steps in (1, method.start_steps, 100):
        more = method.evaluations(steps) - general.evaluations(steps)
        assert more == 1 + min(steps, method.start_steps)


def test_other_right_hand_sides_have_the_general_driver() -> None:
    assert in_whole_steps(ADAMS["ab6"], observe_nothing) is ADAMS["ab6"]
