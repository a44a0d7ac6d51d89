"""Whole steps: the same as the tableau's formula, stage by stage, and honest about angles out of range."""

from __future__ import annotations

import numpy as np
import pytest
from kernels.blocks_of_lanes import TERMS, Floats, expected, kernel, lanes

from fastmech.integrators.methods import METHODS as REGISTRY
from fastmech.integrators.tableaus import TABLEAUS
from fastmech.kernels.sincos import REDUCTION_LIMIT
from fastmech.kernels.whole_steps import METHODS, whole_step
from fastmech.mechanism.coefficients import reduce
from fastmech.scene import Scene

EVERY_STEP = pytest.mark.parametrize(("method", "terms"), [(m, t) for m in METHODS for t in TERMS])
H, BEGIN = 0.02, 0.4


def stepped(method: str, terms: str, Y: Floats, scene: Scene) -> tuple[Floats, int, Floats]:
    """States after a step, what the step says, and the marks of lanes that it could not do."""
    tableau = TABLEAUS[method]
    Z, work = np.full(Y.shape, np.nan), np.empty((tableau.stages + 1, Y.shape[1]))
    params = np.repeat(np.array(reduce(scene))[:, None], Y.shape[1], axis=1)
    step = whole_step(kernel("lagrange", terms), tableau)
    with np.errstate(all="ignore"):  # plain Python warns where compiled code is silent
        beyond = step(BEGIN, H, np.ascontiguousarray(Y), Z, params, work)
    return Z, beyond, work[-1]


def by_formula(method: str, Y: Floats, scene: Scene) -> Floats:
    """The tableau's stages with the mechanism's functions in NumPy."""
    tableau, K = TABLEAUS[method], []
    for s in range(tableau.stages):
        stage = Y + H * sum((a * k for a, k in zip(tableau.a[s], K, strict=True)), np.zeros_like(Y))
        K.append(expected("lagrange", scene, stage, BEGIN + tableau.c[s] * H))
    return np.asarray(Y + H * sum(b * k for b, k in zip(tableau.b, K, strict=True)))


@pytest.mark.nojit
@EVERY_STEP
def test_a_step_is_the_formula_of_its_tableau(method: str, terms: str) -> None:
    scene, Y = Scene(**TERMS[terms]), lanes(16)
    Z, beyond, marks = stepped(method, terms, Y, scene)
    np.testing.assert_allclose(Z, by_formula(method, Y, scene), rtol=0, atol=1e-13)
    assert not beyond
    assert not marks.any()


@pytest.mark.nojit
def test_only_lanes_out_of_range_are_marked() -> None:
    Y = lanes(16)
    Y[0, 3], Y[1, 8], Y[2, 11] = 1.1 * REDUCTION_LIMIT, -1e200, 1e9
    Y[3, 14] = np.nan  # failed before: nothing to be done again
    Z, beyond, marks = stepped("rk4", "damped", Y, Scene(F0=0.0))
    assert beyond
    assert np.flatnonzero(marks).tolist() == [3, 8, 11]
    alone = stepped("rk4", "damped", lanes(16), Scene(F0=0.0))[0]
    healthy = (marks == 0) & (np.arange(16) != 14)
    np.testing.assert_array_equal(Z[:, healthy], alone[:, healthy])


@pytest.mark.nojit
def test_other_methods_and_right_hand_sides_have_none() -> None:
    assert whole_step(kernel("lagrange", "free"), REGISTRY["tsit5"].tableau) is None  # type: ignore[attr-defined]
    assert whole_step(kernel("hamilton", "free"), TABLEAUS["rk4"]) is None
