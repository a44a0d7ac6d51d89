"""Block Jacobians against SymPy's derivatives and against complex steps of the physics' own arithmetic."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from kernels.blocks_of_lanes import Floats, evaluate, kernel, lanes
from oracles import oracle

from fastmech.scene import Scene
from fastmech.slider.coefficients import reduce
from fastmech.slider.equations import canonical_rates
from fastmech.slider.kernels.jacobians import canonical_jacobian, lagrange_jacobian

SCENE = Scene(c2=1100 / 3)


def blocks(jacobian: Any, scene: Scene, Y: Floats, t: float) -> Floats:
    """Shape (lanes, 4, 4)."""
    J = np.full((16, Y.shape[1]), np.nan)
    params = np.repeat(np.array(reduce(scene))[:, None], Y.shape[1], axis=1)
    jacobian(t, np.ascontiguousarray(Y), J, params)
    return J.T.reshape(-1, 4, 4)


@pytest.mark.parametrize("change", [{}, {"beta": 0.0}, {"F0": 0.0}, {"alpha": 0.0}, {"beta": 1e6}])
def test_lagrange_against_sympy(change: dict[str, float]) -> None:
    scene, Y, t = SCENE.replace(**change), lanes(5), 0.7
    expected = [oracle().jacobian(scene.parameters, y, t) for y in Y.T]
    expected = np.array(expected, dtype=np.float64)
    found = blocks(lagrange_jacobian, scene, Y, t)
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-12 * np.abs(expected).max())


def test_canonical_against_complex_steps() -> None:
    """The canonical rates are checked against SymPy elsewhere; a complex step of 1e-30 loses no digit."""
    scene, Y, t = SCENE, lanes(9), 0.7
    c = reduce(scene)
    force = c.force * np.exp(-c.decay * t)
    expected = np.empty((9, 4, 4))
    for column in range(4):
        y = Y.astype(complex)
        y[column] += 1e-30j
        rates = canonical_rates(
            (np.sin(y[0]), np.cos(y[0]), np.sin(y[1]), np.cos(y[1])), y[2], y[3],
            c[:5], force, c.damping,
        )  # fmt: skip
        expected[:, :, column] = np.stack(np.broadcast_arrays(*rates)).imag.T * 1e30
    found = blocks(canonical_jacobian, scene, Y, t)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("jacobian", [lagrange_jacobian, canonical_jacobian])
def test_angles_beyond_the_fast_trigonometry(jacobian: Any) -> None:
    """Lanes 10^7 turns away have the Jacobian of their own angles, and leave the others alone."""
    Y = lanes(8)
    far = Y.copy()
    far[0, 3] += 2e7 * np.pi
    near, beyond = blocks(jacobian, SCENE, Y, 0.2), blocks(jacobian, SCENE, far, 0.2)
    np.testing.assert_allclose(beyond[3], near[3], rtol=0, atol=1e-6)
    np.testing.assert_array_equal(np.delete(beyond, 3, 0), np.delete(near, 3, 0))


def test_own_decay_rates() -> None:
    """Each lane's force decays by its own rate."""
    Y = lanes(4)
    params = np.repeat(np.array(reduce(SCENE))[:, None], 4, axis=1)
    params[7] = [0.0, 0.5, 1.0, 2.0]
    J = np.empty((16, 4))
    lagrange_jacobian(1.0, Y, J, params)
    for i, alpha in enumerate(params[7]):
        alone = blocks(lagrange_jacobian, SCENE.replace(alpha=float(alpha)), Y[:, i : i + 1], 1.0)
        np.testing.assert_allclose(J[:, i].reshape(4, 4), alone[0], rtol=1e-13)


def test_differences_of_the_block_right_hand_side() -> None:
    """The Jacobian belongs to the kernel that is integrated, row by row."""
    Y, step = lanes(3), 1e-5
    found = blocks(lagrange_jacobian, SCENE, Y, 0.3)
    for column in range(4):
        ahead, behind = Y.copy(), Y.copy()
        ahead[column] += step
        behind[column] -= step
        rates = [evaluate(kernel("lagrange", "damped_decaying"), SCENE, y, 0.3) for y in (ahead, behind)]
        np.testing.assert_allclose(found[:, :, column], ((rates[0] - rates[1]) / (2 * step)).T, atol=1e-5)
