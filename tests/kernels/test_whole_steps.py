"""Whole steps: the same as the tableau's formula, stage by stage, and honest about angles out of range."""

from __future__ import annotations

import numpy as np
import pytest
from kernels.blocks_of_lanes import TERMS, Floats, expected, kernel, lanes

from fastmech.integrators.method import Adams
from fastmech.integrators.methods import METHODS as REGISTRY
from fastmech.integrators.tableaus import TABLEAUS
from fastmech.integrators.whole import IN_WHOLE_STEPS
from fastmech.kernels.far import FARTHEST, STRETCH, TURNED, mark_far
from fastmech.kernels.sincos import REDUCTION_LIMIT
from fastmech.kernels.whole_steps import is_lagrange, whole_step
from fastmech.mechanism.coefficients import reduce
from fastmech.scene import Scene

ADAMS = {name: method for name, method in REGISTRY.items() if isinstance(method, Adams)}
STARTERS = sorted({method.starter.name for method in ADAMS.values()})
EVERY_STEP = pytest.mark.parametrize(("method", "terms"), [(m, t) for m in IN_WHOLE_STEPS for t in TERMS])
H, BEGIN = 0.02, 0.4


def stepped(method: str, terms: str, Y: Floats, scene: Scene) -> Floats:
    """States after a step."""
    tableau = TABLEAUS[method]
    Z, work = np.full(Y.shape, np.nan), np.empty((tableau.stages, Y.shape[1]))
    params = np.repeat(np.array(reduce(scene))[:, None], Y.shape[1], axis=1)
    step = whole_step(kernel("lagrange", terms), tableau)
    with np.errstate(all="ignore"):  # plain Python warns where compiled code is silent
        step(BEGIN, H, np.ascontiguousarray(Y), Z, params, work)
    return Z


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
    Z = stepped(method, terms, Y, scene)
    np.testing.assert_allclose(Z, by_formula(method, Y, scene), rtol=0, atol=1e-13)


@pytest.mark.nojit
@pytest.mark.parametrize(
    ("row", "value"),
    [(0, 1.1 * FARTHEST), (1, -1e200), (2, 1.1 * TURNED / H), (3, -1e150), (2, np.inf)],
)
def test_a_lane_out_of_range_is_told_and_leaves_the_others_alone(row: int, value: float) -> None:
    Y, scene = lanes(16), Scene(F0=0.0)
    healthy, far = stepped("rk4", "damped", Y, scene), np.zeros(16, dtype=bool)
    assert not mark_far(Y, H, far)
    Y[row, 3] = value
    with np.errstate(over="ignore"):
        assert mark_far(Y, H, far)
    assert list(np.flatnonzero(far)) == [3]
    np.testing.assert_array_equal(
        np.delete(stepped("rk4", "damped", Y, scene), 3, 1), np.delete(healthy, 3, 1)
    )


@pytest.mark.nojit
def test_a_lane_that_is_lost_is_not_far() -> None:
    Y = lanes(16)
    Y[1, 3] = np.nan
    assert not mark_far(Y, H, np.zeros(16, dtype=bool))


@pytest.mark.nojit
@pytest.mark.parametrize("method", [*IN_WHOLE_STEPS, *STARTERS, *ADAMS])
def test_in_a_stretch_no_angle_leaves_the_range(method: str) -> None:
    rows = [ADAMS[method].predictor] if method in ADAMS else TABLEAUS[method].a
    reach = max(sum(abs(weight) for weight in row) for row in rows)
    assert FARTHEST + (STRETCH + reach) * TURNED < REDUCTION_LIMIT


@pytest.mark.nojit
def test_they_are_lagrange_s() -> None:
    assert is_lagrange(kernel("lagrange", "free"))
    assert not is_lagrange(kernel("hamilton", "free"))
