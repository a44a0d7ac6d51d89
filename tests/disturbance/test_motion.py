from __future__ import annotations

import numpy as np
import pytest
from disturbance.known import center, equilibria, known, oracle_jacobian, scipy_motion, stiff_motion
from scipy.integrate import solve_ivp

from fastmech.disturbance.motion import disturbed_motion
from fastmech.errors import InputError
from fastmech.slider.equilibria import find_equilibria

SCENE = known("table_1")[0]
TIMES = np.array([0.0, 0.1, 0.5, 1.0, 2.0])
DISTURBANCES = np.array([[0.1, 0.0, 0.0, 0.0], [0.0, -0.2, 0.3, 0.0], [0.02, 0.03, -0.5, 0.7]])


@pytest.mark.parametrize("morse_index", [0, 1, 2])
def test_linearized_motion_solves_the_linear_system(morse_index: int) -> None:
    """x' = J x with the oracle's Jacobian, by SciPy."""
    for e in equilibria("table_1", morse_index):
        J = oracle_jacobian(SCENE, e)
        motion = disturbed_motion(SCENE, e, DISTURBANCES, TIMES)
        assert motion.linearized.shape == motion.nonlinear.shape == (5, 3, 4)
        for lane, start in enumerate(DISTURBANCES):
            reference = solve_ivp(
                lambda t, x, J=J: J @ x, (0, 2), start, method="DOP853", t_eval=TIMES, rtol=1e-12, atol=1e-13
            )
            scale = np.abs(reference.y).max()
            np.testing.assert_allclose(motion.linearized[:, lane], reference.y.T, rtol=0, atol=1e-9 * scale)


def test_nonlinear_motion_is_the_mechanism_s() -> None:
    (e,) = equilibria("table_1", 0)
    motion = disturbed_motion(SCENE, e, DISTURBANCES, TIMES)
    np.testing.assert_array_equal(motion.t, TIMES)
    for lane, disturbance in enumerate(DISTURBANCES):
        reference = scipy_motion(SCENE, center(e) + disturbance, 2.0).sol(TIMES).T - center(e)
        np.testing.assert_allclose(motion.nonlinear[:, lane], reference, rtol=0, atol=1e-9)


@pytest.mark.parametrize("beta", [1e5, 1e7])
def test_heavy_damping_is_followed_by_default(beta: float) -> None:
    """The damper stops the crank within a millisecond; ends by SciPy's Radau."""
    scene = SCENE.replace(beta=beta)
    e = find_equilibria(scene)[0]
    motion = disturbed_motion(scene, e, DISTURBANCES, TIMES)
    assert not motion.status.any()
    for lane, disturbance in enumerate(DISTURBANCES):
        end = stiff_motion(scene, center(e) + disturbance, 2.0) - center(e)
        np.testing.assert_allclose(motion.nonlinear[-1, lane], end, rtol=0, atol=1e-6)


@pytest.mark.nojit
def test_they_part_with_the_square_of_the_disturbance() -> None:
    (e,) = equilibria("table_1", 0)
    apart = []
    for size in (1e-2, 5e-3, 2.5e-3):
        motion = disturbed_motion(SCENE, e, size * np.ones(4), [0.25, 0.5], dt=0.05)
        apart.append(np.abs(motion.nonlinear - motion.linearized).max())
    assert np.log2(np.array(apart[:-1]) / apart[1:]) == pytest.approx(2.0, abs=0.1)


@pytest.mark.nojit
def test_wrong_arguments_are_refused() -> None:
    (e,) = equilibria("table_1", 0)
    with pytest.raises(InputError, match=r"^scene\.alpha = 0\.7: must be 0 1/s"):
        disturbed_motion(SCENE.replace(alpha=0.7), e, np.ones(4), [1.0])
    with pytest.raises(InputError, match=r"^disturbance: has shape \(3,\), must be \(n, 4\)"):
        disturbed_motion(SCENE, e, np.ones(3), [1.0])
    with pytest.raises(InputError, match=r"^times\[1\] = 0\.5: must be .*strictly rising"):
        disturbed_motion(SCENE, e, np.ones(4), [1.0, 0.5])
