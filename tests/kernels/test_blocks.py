"""Block right-hand sides against the mechanism's functions, and lanes against their neighbours."""

from __future__ import annotations

import os

import numpy as np
import pytest
from kernels.blocks_of_lanes import COMBINATIONS, TERMS, evaluate, expected, kernel, lanes
from oracles import oracle

from fastmech.kernels.sincos import REDUCTION_LIMIT
from fastmech.scene import Scene
from fastmech.slider.coefficients import force
from fastmech.slider.geometry import velocities
from fastmech.slider.kernels.work import lagrange_work
from fastmech.slider.lagrange import unit

pytestmark = pytest.mark.nojit

EVERY_KERNEL = pytest.mark.parametrize(("formulation", "terms"), COMBINATIONS)
UNALIKE = Scene(m1=3.0, m2=7.0, m3=5.0, l=0.8, c1=90.0, c2=210.0, beta=33.0, F0=-140.0, alpha=0.4)
PLAIN_PYTHON = os.environ.get("NUMBA_DISABLE_JIT") == "1"

# Rounding only: the largest terms of these draws are a few hundred 1/s^2, one unit of which is 6e-14.
CLOSE = {"rtol": 2e-14, "atol": 5e-13}


@EVERY_KERNEL
@pytest.mark.parametrize("scene", [Scene(), UNALIKE], ids=["table_1", "unalike"])
@pytest.mark.parametrize("n", [1, 7, 8, 33])
def test_kernel_equals_the_mechanism(formulation: str, terms: str, scene: Scene, n: int) -> None:
    """Lane counts with and without a remainder of whole vectors. All coefficients are given: those of terms
    that the kernel lacks must not matter.
    """
    Y, t = lanes(n, seed=n), 0.6
    actual = evaluate(kernel(formulation, terms), scene, Y, t)
    np.testing.assert_allclose(actual, expected(formulation, scene.replace(**TERMS[terms]), Y, t), **CLOSE)


@EVERY_KERNEL
def test_kernel_equals_the_oracle(formulation: str, terms: str) -> None:
    scene, Y, t = UNALIKE.replace(**TERMS[terms]), lanes(20, seed=4), 0.6
    params = scene.parameters
    actual = evaluate(kernel(formulation, terms), scene, Y, t)
    for lane, y in enumerate(Y.T):
        if formulation == "lagrange":
            right = [*y[2:], *oracle().accelerations(params, y, t)]
        else:
            rates = oracle().hamilton_rhs(params, y[:2], y[2:] * unit(scene), t)
            right = [*rates[:2], rates[2] / unit(scene), rates[3] / unit(scene)]
        np.testing.assert_allclose(actual[:, lane], np.array(right, dtype=float), rtol=1e-13, atol=1e-12)


@EVERY_KERNEL
@pytest.mark.parametrize("far", [np.nextafter(REDUCTION_LIMIT, np.inf), -3.3e6, 1e15, 1e300, np.nan])
def test_lanes_beyond_the_reduction_are_right_and_leave_others_alone(
    formulation: str, terms: str, far: float
) -> None:
    """Each angle in turn; the other lanes keep every bit."""
    scene, Y = Scene().replace(**TERMS[terms]), lanes(21, seed=9)
    rhs = kernel(formulation, terms)
    alone = evaluate(rhs, scene, Y)
    for angle, lane in ((0, 3), (1, 20)):
        disturbed = Y.copy()
        disturbed[angle, lane] = far
        actual = evaluate(rhs, scene, disturbed)
        others = np.arange(Y.shape[1]) != lane
        np.testing.assert_array_equal(actual[:, others], alone[:, others])
        right = expected(formulation, scene, disturbed[:, [lane]], 0.0)[:, 0]
        if np.isnan(far):
            assert np.isnan(actual[2:, lane]).all()
        else:
            np.testing.assert_allclose(actual[:, lane], right, **CLOSE)


@EVERY_KERNEL
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_lanes_that_are_not_finite_leave_others_alone(formulation: str, terms: str, bad: float) -> None:
    if PLAIN_PYTHON and np.isinf(bad):
        pytest.skip("math.sin(inf) raises in plain Python; compiled code gives NaN")
    scene, Y = Scene().replace(**TERMS[terms]), lanes(21, seed=9)
    rhs = kernel(formulation, terms)
    alone = evaluate(rhs, scene, Y)
    for row in range(4):
        disturbed = Y.copy()
        disturbed[row, 5] = bad
        actual = evaluate(rhs, scene, disturbed)
        others = np.arange(Y.shape[1]) != 5
        np.testing.assert_array_equal(actual[:, others], alone[:, others])
        assert not np.isfinite(actual[:, 5]).all()


@EVERY_KERNEL
def test_a_lane_does_not_depend_on_its_place(formulation: str, terms: str) -> None:
    """Vector body and remainder of the loop give the same bits."""
    scene, Y = Scene().replace(**TERMS[terms]), lanes(19, seed=2)
    whole = evaluate(kernel(formulation, terms), scene, Y)
    for lane in range(Y.shape[1]):
        single = evaluate(kernel(formulation, terms), scene, Y[:, lane : lane + 1])
        np.testing.assert_array_equal(single[:, 0], whole[:, lane])


@pytest.mark.parametrize("scene", [Scene(), UNALIKE], ids=["table_1", "unalike"])
def test_work_kernel_adds_the_powers_of_damper_and_force(scene: Scene) -> None:
    """-beta x3'^2 and F x2' from the geometry's velocities, over m2 l^2; the motion as without them."""
    Y, t = lanes(33, seed=6), 0.6
    actual = evaluate(lagrange_work, scene, np.concatenate([Y, np.ones((2, 33))]), t)
    np.testing.assert_array_equal(actual[:4], evaluate(kernel("lagrange", "damped_decaying"), scene, Y, t))
    v = velocities(scene, Y.T)
    powers = [-scene.beta * v.x3**2, force(scene, t) * v.x2]
    np.testing.assert_allclose(actual[4:], np.array(powers) / unit(scene), **CLOSE)
