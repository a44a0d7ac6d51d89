"""Whole steps in their driver: lanes far out are done stage by stage, and nobody else notices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from integrators.driving import one_block
from kernels.blocks_of_lanes import Floats, lanes

from fastmech.integrators.driver import observe_nothing
from fastmech.integrators.method import RungeKutta
from fastmech.integrators.tableaus import TABLEAUS
from fastmech.integrators.whole import IN_WHOLE_STEPS, WholeSteps, in_whole_steps
from fastmech.kernels import lagrange
from fastmech.kernels.far import FARTHEST
from fastmech.mechanism.coefficients import reduce
from fastmech.scene import Scene

STEPS, END = 25, 0.5


def through(method: RungeKutta, Y: Floats, pieces: int = 1) -> Floats:
    """Last states (4, lanes) of damped motion without force."""
    params = np.repeat(np.array(reduce(Scene(F0=0.0)))[:, None], Y.shape[1], axis=1)
    times = np.linspace(0.0, END, pieces + 1)
    batch = one_block(Y, params, times, STEPS)
    batch = replace(
        batch,
        steps=np.full(pieces, STEPS // pieces),
        out=np.empty((1, pieces, *Y.shape)),
    )
    with np.errstate(all="ignore"):  # plain Python warns where compiled code is silent
        method.run(lagrange.lagrange_damped, observe_nothing, batch)
    np.testing.assert_array_equal(batch.out[0, -1], batch.Y[0])
    return batch.Y[0]


def both(name: str) -> tuple[RungeKutta, RungeKutta]:
    """A method stage by stage, and in whole steps."""
    staged = RungeKutta(TABLEAUS[name])
    whole = in_whole_steps(staged, lagrange.lagrange_damped)
    assert isinstance(whole, WholeSteps)
    return staged, whole


@pytest.mark.nojit
@pytest.mark.parametrize("name", IN_WHOLE_STEPS)
def test_motions_far_out_are_those_of_the_stages_and_others_do_not_notice(name: str) -> None:
    staged, whole = both(name)
    near = lanes(16)
    alone = through(whole, near)
    np.testing.assert_allclose(alone, through(staged, near), rtol=0, atol=1e-11)
    mixed = near.copy()
    mixed[0, 2], mixed[1, 9] = 1e17, -1e200  # where the fast trigonometry gives nonsense; the angles stay
    mixed[2, 12] = np.nan
    found, stages = through(whole, mixed), through(staged, mixed)
    np.testing.assert_allclose(found[:, [2, 9]], stages[:, [2, 9]], rtol=1e-9, atol=0)
    np.testing.assert_array_equal(found[:, [2, 9]], through(whole, mixed[:, ::-1].copy())[:, [13, 6]])
    assert np.isnan(found[:, 12]).all()
    healthy = np.setdiff1d(np.arange(16), [2, 9, 12])
    np.testing.assert_array_equal(found[:, healthy], alone[:, healthy])


@pytest.mark.nojit
@pytest.mark.parametrize("angle", [1e154, -1e300])
def test_a_motion_beyond_squares_needs_no_companions_that_are_far(angle: float) -> None:
    """What the fast step leaves of it is NaN, which does not tell that it still is far."""
    staged, whole = both("rk4")
    Y = lanes(16)
    Y[1, 5] = angle
    alone, right = through(whole, Y), through(staged, Y)
    assert np.isfinite(alone).all()
    np.testing.assert_allclose(alone[:, 5], right[:, 5], rtol=1e-9, atol=0)
    Y[0, 7] = 2.0 * FARTHEST
    np.testing.assert_array_equal(through(whole, Y)[:, 5], alone[:, 5])


@pytest.mark.nojit
@pytest.mark.parametrize("direction", [-1.0, 1.0])
def test_motions_that_come_and_go_across_the_limit_depend_on_nobody(direction: float) -> None:
    _, whole = both("rk4")
    Y = lanes(16)
    Y[0], Y[2] = FARTHEST - direction * 2.0, direction * np.linspace(12.0, 28.0, 16)  # cross it one by one
    together = through(whole, Y)
    assert (np.sign(together[0] - FARTHEST) == direction).any()
    for i in range(16):
        one = np.repeat(Y[:, i : i + 1], 16, axis=1)
        np.testing.assert_array_equal(through(whole, one)[:, 0], together[:, i])


@pytest.mark.nojit
@pytest.mark.parametrize("name", IN_WHOLE_STEPS)
def test_pieces_change_nothing(name: str) -> None:
    _, whole = both(name)
    np.testing.assert_allclose(through(whole, lanes(16)), through(whole, lanes(16), 5), rtol=0, atol=1e-13)
