"""The largest stable step as the method itself shows it: where its differenced one-step map turns unstable.

The map of one step about the equilibrium is differenced (central differences through the compiled driver and
the nonlinear equations of motion) and its spectral radius watched: growth just beyond the limit may be 1e-5 a
step, which no trajectory would show. An Adams method's map takes its history, so its formula is applied to
histories around the equilibrium, with the compiled right-hand side.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fastmech.arrays import Flags, Floats
from fastmech.integrators.explicit import Batch, observe_nothing
from fastmech.integrators.methods import Adams, Method, find_method, with_inverse
from fastmech.scene import Scene
from fastmech.slider.coefficients import reduce
from fastmech.slider.equilibria import Equilibrium
from fastmech.slider.kernels.inverse import lagrange_inverse
from fastmech.slider.kernels.select import right_hand_side
from fastmech.slider.linearize import jacobian
from fastmech.step_limits.amplification import first_crossing

#: Half width of the differences [rad, rad/s]: its square and the rounding over it are both near 1e-11.
WIDTH = 1e-5


def measured_stable_step(scene: Scene, equilibrium: Equilibrium, method: str) -> float:
    """Least step [s] at which the spectral radius of the differenced one-step map crosses 1; inf if none.

    Raises:
        InputError: an argument is wrong.
    """
    formula = with_inverse(find_method(method), lagrange_inverse)
    fastest = float(np.abs(np.linalg.eigvals(jacobian(scene, equilibrium))).max())
    frozen = scene.replace(F0=equilibrium.force, alpha=0.0)
    at = np.array([equilibrium.phi, equilibrium.theta, 0.0, 0.0])
    params = np.array(reduce(frozen), dtype=np.float64)
    rhs = right_hand_side(reduce(frozen))

    def grow(steps: Floats) -> Flags:
        step_map: Any = _history_map if isinstance(formula, Adams) else _step_map
        matrices = np.array([step_map(formula, rhs, params, at, float(h)) for h in steps])
        return np.asarray(np.abs(np.linalg.eigvals(matrices)).max(axis=1) > 1.0)

    return first_crossing(grow, 0.01 / fastest, 100.0 / fastest)


def _around(at: Floats) -> Floats:
    """Columns: ``at`` with each component ahead by WIDTH, then each behind."""
    shifts = WIDTH * np.eye(at.size)
    return np.ascontiguousarray(at[:, None] + np.concatenate([shifts, -shifts], axis=1))


def _difference(after: Floats) -> Floats:
    ahead, behind = np.split(after, 2, axis=1)
    return np.asarray((ahead - behind) / (2.0 * WIDTH))


def _step_map(method: Method, rhs: Any, params: Floats, at: Floats, h: float) -> Floats:
    Y = _around(at)
    batch = Batch(
        times=np.array([0.0, h]),
        steps=np.array([1]),
        params=np.repeat(params[None, :, None], Y.shape[1], axis=2),
        observer_params=np.zeros(0),
        Y=Y[None],
        record=np.zeros((1, 0, Y.shape[1])),
        out=np.empty((1, 1, *Y.shape)),
    )
    method.run(rhs, observe_nothing, batch)
    return _difference(batch.Y[0])


def _history_map(method: Adams, rhs: Any, params: Floats, at: Floats, h: float) -> Floats:
    rows = method.predictor.size
    history = _around(np.tile(at, rows)).reshape(rows, at.size, -1)
    own = np.repeat(params[:, None], history.shape[2], axis=1)

    def slope(Y: Floats) -> Floats:
        dY = np.empty_like(Y)
        rhs(0.0, np.ascontiguousarray(Y), dY, own)
        return dY

    slopes = np.array([slope(Y) for Y in history])
    ahead = history[0] + h * np.tensordot(method.predictor, slopes, 1)
    if method.corrects:
        corrected = method.corrector[0] * slope(ahead) + np.tensordot(method.corrector[1:], slopes, 1)
        ahead = history[0] + h * corrected
    return _difference(np.concatenate([ahead[None], history[:-1]]).reshape(rows * at.size, -1))
