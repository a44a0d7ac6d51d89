"""Whole steps of Adams methods: those of the definition, with right-hand sides in NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from kernels.blocks_of_lanes import TERMS, Floats, expected, kernel, lanes
from scipy.integrate import solve_ivp

from fastmech.integrators.method import Adams
from fastmech.integrators.methods import METHODS
from fastmech.kernels.blocks import VECTOR_LANES
from fastmech.kernels.far import FARTHEST, STRETCH, TURNED, may_be_far
from fastmech.kernels.last_term import LOOKED_AT
from fastmech.kernels.whole_adams import whole_adams_steps
from fastmech.mechanism.coefficients import reduce
from fastmech.scene import Scene

ADAMS = {name: method for name, method in METHODS.items() if isinstance(method, Adams)}
H, BEGIN = 0.004, 0.4


def history(method: Adams, scene: Scene, Y: Floats, off: float = 0.0) -> Floats:
    """Derivatives (rows, 4, lanes) on the way to Y by SciPy, the oldest first, wrong by ``off`` but at Y."""

    def slope(t: float, y: Floats) -> Floats:
        return expected("lagrange", scene, y.reshape(Y.shape), t).ravel()

    ages = np.arange(method.rows)[::-1]
    times = BEGIN - H * ages
    found = solve_ivp(slope, (BEGIN, times[0]), Y.ravel(), "DOP853", times[::-1], rtol=1e-12, atol=1e-12)
    path = [slope(t, y).reshape(Y.shape) for t, y in zip(times, found.y.T[::-1], strict=True)]
    return np.array(path) + off * (np.cos(7.0 * ages) * (ages > 0))[:, None, None]


def advanced(
    method: Adams, terms: str, scene: Scene, Y: Floats, F: Floats, steps: int, checked: bool = True
) -> tuple[Floats, Floats, int]:
    """States, the whole history and the steps done."""
    room = np.concatenate([F, np.full((steps, *Y.shape), np.nan)]).ravel()
    state, work = Y.copy(), np.zeros((1 + LOOKED_AT, Y.shape[1]))
    params = np.repeat(np.array(reduce(scene))[:, None], Y.shape[1], axis=1)
    advance = whole_adams_steps(kernel("lagrange", terms), method)
    with np.errstate(all="ignore"):  # plain Python warns where compiled code is silent
        done = advance(BEGIN, H, 0, steps, room, 0, state, params, work, checked)
    return state, room.reshape(-1, *Y.shape), done


def by_definition(method: Adams, scene: Scene, Y: Floats, F: Floats, steps: int) -> tuple[Floats, Floats]:
    """The same, formula by formula."""
    for step in range(steps):
        t, past = BEGIN + (step + 1) * H, F[: -method.rows - 1 : -1]
        state = Y + H * np.tensordot(method.predictor, past, axes=1)
        if method.corrects:
            first, *others = method.corrector
            slope = expected("lagrange", scene, state, t)
            state = Y + H * (np.tensordot(others, past, axes=1) + first * slope)
        F, Y = np.concatenate([F, expected("lagrange", scene, state, t)[None]]), state
    return Y, F


@pytest.mark.nojit
@pytest.mark.parametrize("terms", TERMS)
@pytest.mark.parametrize("name", ["ab6", "abm8"])
def test_steps_are_those_of_the_definition(name: str, terms: str) -> None:
    method, scene, Y = ADAMS[name], Scene(**TERMS[terms]), lanes(VECTOR_LANES)
    F = history(method, scene, Y)
    state, path, done = advanced(method, terms, scene, Y, F, 3)
    right, whole = by_definition(method, scene, Y, F, 3)
    assert done == 3
    np.testing.assert_allclose(state, right, rtol=0, atol=1e-12)
    np.testing.assert_allclose(path, whole, rtol=0, atol=1e-10)


@pytest.mark.nojit
@pytest.mark.parametrize("name", ADAMS)
def test_every_method(name: str) -> None:
    method, scene, Y = ADAMS[name], Scene(F0=0.0), lanes(VECTOR_LANES)
    F = history(method, scene, Y)
    state, path, _ = advanced(method, "damped", scene, Y, F, 2)
    right, whole = by_definition(method, scene, Y, F, 2)
    np.testing.assert_allclose(state, right, rtol=0, atol=1e-12)
    np.testing.assert_allclose(path, whole, rtol=0, atol=1e-10)


@pytest.mark.nojit
def test_sines_of_corrected_angles_are_right_to_fourth_order() -> None:
    """A history that fits no motion: corrections d of whole degrees, of which d^5 / 120 may be missing."""
    method, scene, Y = ADAMS["abm8"], Scene(F0=0.0), lanes(VECTOR_LANES)
    errors, sizes = [], []
    for off in (0.5, 1.0, 2.0):
        F = history(method, scene, Y, off)
        _, path, _ = advanced(method, "damped", scene, Y, F, 1)
        right, whole = by_definition(method, scene, Y, F, 1)
        predicted = Y + H * np.tensordot(method.predictor, F[::-1], axes=1)
        sizes.append(np.abs(right - predicted)[:2].max())
        errors.append(np.abs(path - whole)[-1].max() / np.abs(whole[-1]).max())
    assert min(sizes) > 0.002
    assert all(error < 10.0 * size**5 + 1e-14 for error, size in zip(errors, sizes, strict=True))
    assert errors[-1] < 1e-7


@pytest.mark.nojit
@pytest.mark.parametrize(
    ("row", "value"), [(0, 1.1 * FARTHEST), (1, -1e200), (2, 1.1 * TURNED / H), (3, -np.inf)]
)
def test_a_stretch_that_a_lane_begins_far_out_is_left_to_others(row: int, value: float) -> None:
    method, scene, Y = ADAMS["abm8"], Scene(F0=0.0), lanes(VECTOR_LANES)
    F = history(method, scene, Y)
    healthy, *_ = advanced(method, "damped", scene, Y, F, 1)
    Y[row, 3] = value
    with np.errstate(over="ignore"):
        assert may_be_far(Y, H)
    state, _, done = advanced(method, "damped", scene, Y, F, 1)
    assert done == 0
    np.testing.assert_array_equal(state, Y)
    state, _, done = advanced(method, "damped", scene, Y, F, 1, checked=False)
    assert done == 1
    np.testing.assert_array_equal(np.delete(state, 3, 1), np.delete(healthy, 3, 1))


@pytest.mark.nojit
def test_it_is_asked_where_a_stretch_begins() -> None:
    """A lane whose history throws it out in the first step; lost ones, NaN, keep nobody."""
    method, scene, Y = ADAMS["ab5"], Scene(F0=0.0), lanes(VECTOR_LANES)
    Y[0, 5], Y[2, 5] = np.sqrt(0.5) * FARTHEST - 0.1, 10.0
    F = history(method, scene, Y)
    assert not may_be_far(Y, H)
    assert advanced(method, "damped", scene, Y, F, 2 * STRETCH + 1)[2] == STRETCH
    Y[2, 5] = np.nan
    assert advanced(method, "damped", scene, Y, F, 2 * STRETCH + 1)[2] == 2 * STRETCH + 1
