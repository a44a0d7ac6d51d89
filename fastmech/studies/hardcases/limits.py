"""Methods' limits on the axes, and the largest stable step as the method itself shows it.

That is where its differenced one-step map turns unstable. The map of one step about the equilibrium is
differenced (central differences through the compiled driver and the nonlinear equations of motion) and its
spectral radius watched: growth just beyond the limit may be 1e-5 a step, which no trajectory would show. An
Adams method's map takes its history, so its formula is applied to histories around the equilibrium, with the
compiled right-hand side.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastmech.arrays import Flags, Floats
from fastmech.ensembles.run import run_ensemble
from fastmech.integrators.methods import (
    Adams,
    Method,
    RungeKutta,
    bashforth,
    find_method,
    moulton,
    with_inverse,
)
from fastmech.scene import Scene
from fastmech.slider.coefficients import reduce
from fastmech.slider.equilibria import Equilibrium
from fastmech.slider.kernels.inverse import lagrange_inverse
from fastmech.slider.kernels.select import right_hand_side
from fastmech.slider.linearize import jacobian
from fastmech.step_limits.amplification import (
    amplifies,
    first_crossing,
    history_row,
    stability_function,
    stability_polynomial,
)

#: Half width of the differences [rad, rad/s]: its square and the rounding over it are both near 1e-11.
WIDTH = 1e-5


def measured_stable_step(scene: Scene, equilibrium: Equilibrium, method: str) -> float:
    """Least step [s] at which the spectral radius of the differenced one-step map crosses 1; inf if none.

    Raises:
        InputError: an argument is wrong.
    """
    formula = with_inverse(find_method(method), lagrange_inverse)
    fastest = float(np.abs(np.linalg.eigvals(jacobian(scene, equilibrium))).max())
    frozen = reduce(scene.replace(F0=equilibrium.force, alpha=0.0))
    at, params = np.array([*equilibrium.position, 0.0, 0.0]), np.array(frozen, dtype=np.float64)
    rhs = right_hand_side(frozen)

    def step_map(h: float) -> Floats:
        if isinstance(formula, Adams):
            return _history_map(formula, rhs, params, at, h)
        run = run_ensemble(rhs, params, _around(at).T, np.array([0.0, h]), h, method=formula, threads=1)
        return _difference(run.states[-1].T)

    def grow(steps: Floats) -> Flags:
        matrices = np.array([step_map(h) for h in steps.tolist()])
        return np.asarray(np.abs(np.linalg.eigvals(matrices)).max(axis=1) > 1.0)

    return first_crossing(grow, 0.01 / fastest, 100.0 / fastest)


def _around(at: Floats) -> Floats:
    """Columns: ``at`` with each component ahead by WIDTH, then each behind."""
    shifts = WIDTH * np.eye(at.size)
    return np.ascontiguousarray(at[:, None] + np.concatenate([shifts, -shifts], axis=1))


def _difference(after: Floats) -> Floats:
    ahead, behind = np.split(after, 2, axis=1)
    return np.asarray((ahead - behind) / (2.0 * WIDTH))


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


def companion(method: Adams, z: ArrayLike) -> NDArray[np.complex128]:
    """The matrices (..., k, k) that take the history (y_n, y_(n-1), ...) of y' = lambda y one step on."""
    row = history_row(method, z)
    size = row.shape[-1]
    matrices = np.tile(np.eye(size, k=-1, dtype=np.complex128), (*row.shape[:-1], 1, 1))
    matrices[..., 0, :] = row
    return matrices


def amplification(method: Method, z: ArrayLike) -> Floats:
    """Factor by which a step multiplies small motions: |R(z)|, or the history map's spectral radius."""
    if not isinstance(method, Adams):
        return np.abs(stability_function(method, z))
    return np.asarray(np.abs(np.linalg.eigvals(companion(method, z))).max(axis=-1))


#: Growth a step that rounding explains.
ROUNDED = 1e-11

#: Where the search begins and ends: a method that is stable to the end has no limit.
NEAREST, FARTHEST = 1e-3, 1e8

#: Where growth is looked for that begins at once, and decimal digits that show it: y to the power 14.
SMALL, DIGITS = 1e-4, 100


def real_limit(method: Method) -> float:
    """Largest x such that the method is stable at every -x' with 0 < x' <= x; inf if A-stable there."""
    return first_crossing(lambda x: amplifies(method, -x, 1.0 + ROUNDED), NEAREST, FARTHEST)


def imaginary_limit(method: Method) -> float:
    """Largest y such that the method is stable at every i y', 0 < y' <= y; 0 if growth begins at once."""
    if isinstance(method, RungeKutta):
        return _explicit_imaginary(method)
    if isinstance(method, Adams) and _grows_at_once(method):
        return 0.0
    return first_crossing(lambda y: amplifies(method, 1j * y, 1.0 + ROUNDED), NEAREST, FARTHEST)


def _grows_at_once(method: Adams) -> bool:
    """Whether motion grows at z = iy however small y is; in digits that show the growth's leading power."""
    import mpmath  # takes longer to import than a first run

    past = bashforth(method.start_steps + 1)
    with mpmath.workdps(DIGITS):
        z: Any = mpmath.mpc(0, SMALL)
        exact: Any = lambda w: mpmath.mpf(w.numerator) / w.denominator  # noqa: E731
        row = [int(age == 0) + z * exact(weight) for age, weight in enumerate(past)]
        if method.corrects:
            new, *others = map(exact, moulton(method.order))
            row = [int(age == 0) + z * (w + new * row[age]) for age, w in enumerate(others)]
        root = mpmath.findroot(lambda x: x - sum(w * x**-age for age, w in enumerate(row)), mpmath.exp(z))
        return bool(abs(root) > 1)


def _explicit_imaginary(method: RungeKutta) -> float:
    """From |R(iy)|^2 - 1, a polynomial in y^2 whose powers up to the order vanish."""
    r = stability_polynomial(method)
    powers = np.arange(r.size)
    signed = r * (-1.0) ** (powers // 2)  # coefficients by rising powers of y
    even, odd = np.where(powers % 2, 0.0, signed), np.where(powers % 2, signed, 0.0)
    growth = np.convolve(even, even) + np.convolve(odd, odd)
    growth[: method.order + 1] = 0.0
    magnitude = np.convolve(np.abs(even), np.abs(even)) + np.convolve(np.abs(odd), np.abs(odd))
    growth[np.abs(growth) < 1e-13 * magnitude] = 0.0
    present = np.flatnonzero(growth)
    if not present.size or growth[present[0]] > 0.0:
        return 0.0
    roots = np.roots(growth[present[0] : present[-1] + 1][::-1])
    real = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0.0)]
    return float(real.min())
