"""Whole steps: the formulas of the methods with right-hand sides in NumPy, lane by lane, whoever is lost."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from ensembles.starts import random_starts
from kernels.blocks_of_lanes import TERMS, Floats, expected, kernel, lanes
from scipy.integrate import solve_ivp

import fastmech as fm
from fastmech.ensembles.problem import motion_problem
from fastmech.ensembles.run import Ensemble, run_ensemble
from fastmech.integrators.methods import METHODS, Adams, RungeKutta, bashforth
from fastmech.kernels.blocks import VECTOR_LANES, Rates
from fastmech.kernels.sincos import REDUCTION_LIMIT
from fastmech.kernels.steps import EVERY, MOST_STATES, LaneArrays, Steps, term_weights, whole_steps
from fastmech.scene import Scene
from fastmech.slider.coefficients import reduce

ADAMS = {name: method for name, method in METHODS.items() if isinstance(method, Adams)}
EXPLICIT = {name: method for name, method in METHODS.items() if isinstance(method, Adams | RungeKutta)}
H, BEGIN = 0.004, 0.4
FORMULATIONS = ["lagrange", "hamilton"]


def history(method: Adams, formulation: str, scene: Scene, Y: Floats, off: float = 0.0) -> Floats:
    """Derivatives (rows, 4, lanes) on the way to Y by SciPy, the oldest first, wrong by ``off`` but at Y."""

    def slope(t: float, y: Floats) -> Floats:
        return expected(formulation, scene, y.reshape(Y.shape), t).ravel()

    ages = np.arange(method.rows)[::-1]
    times = BEGIN - H * ages
    found = solve_ivp(slope, (BEGIN, times[0]), Y.ravel(), "DOP853", times[::-1], rtol=1e-12, atol=1e-12)
    path = [slope(t, y).reshape(Y.shape) for t, y in zip(times, found.y.T[::-1], strict=True)]
    return np.array(path) + off * (np.cos(7.0 * ages) * (ages > 0))[:, None, None]


def stepped(
    method: Any, rhs: Any, scene: Scene, Y: Floats, steps: int, past: Floats | None = None
) -> tuple[Floats, Floats, int]:
    """States, the derivative at them (NaN of a one-step method), and what the steps give."""
    rows = 0 if past is None else len(past)
    memory = np.full((2 * rows + 3, *Y.shape), np.nan)
    if past is not None:
        memory[1 : rows + 1] = past
        memory[rows + 2 : 2 * rows + 2] = past
        memory[-1] = 0.0
    params = np.repeat(np.array(reduce(scene))[:, None], Y.shape[1], axis=1)
    state = Y.copy().ravel()
    flat = LaneArrays(state, params.ravel(), memory.ravel(), np.zeros(Y.shape[1], dtype=bool))
    with np.errstate(all="ignore"):  # plain Python warns where compiled code is silent
        done = whole_steps(rhs.rates, method.formulas[1], "float64")(
            flat, Steps(BEGIN, H, 0, steps, 0, 1, 0, 0)
        )
    newest = (steps - 1) % (rows + 1)
    return state.reshape(Y.shape), flat.memory.reshape(memory.shape)[newest], done


def runge_kutta(method: RungeKutta, formulation: str, scene: Scene, Y: Floats) -> Floats:
    """The tableau's stages with the mechanism's functions in NumPy."""
    tableau, K = method.tableau, []
    for s in range(tableau.stages):
        stage = Y + H * sum((a * k for a, k in zip(tableau.a[s], K, strict=True)), np.zeros_like(Y))
        K.append(expected(formulation, scene, stage, BEGIN + tableau.c[s] * H))
    return np.asarray(Y + H * sum(b * k for b, k in zip(tableau.b, K, strict=True)))


def adams(
    method: Adams, formulation: str, scene: Scene, Y: Floats, F: Floats, steps: int
) -> tuple[Floats, Floats]:
    """States and their derivative, formula by formula."""
    for step in range(steps):
        t, past = BEGIN + (step + 1) * H, F[: -method.rows - 1 : -1]
        state = Y + H * np.tensordot(method.predictor, past, axes=1)
        if method.corrects:
            first, *others = method.corrector
            slope = expected(formulation, scene, state, t)
            state = Y + H * (np.tensordot(others, past, axes=1) + first * slope)
        F, Y = np.concatenate([F, expected(formulation, scene, state, t)[None]]), state
    return Y, F[-1]


@pytest.mark.nojit
@pytest.mark.parametrize(
    ("name", "formulation", "terms"),
    [(name, "lagrange", "damped") for name in EXPLICIT]
    + [(name, "lagrange", terms) for name in ("rk4", "abm8") for terms in TERMS]
    + [(name, "hamilton", "damped_decaying") for name in ("rk4", "ab6", "abm8")],
)
def test_steps_are_those_of_the_definition(name: str, formulation: str, terms: str) -> None:
    """Every method, and every combination of terms."""
    method, scene, Y = EXPLICIT[name], Scene(**TERMS[terms]), lanes(VECTOR_LANES)
    rhs = kernel(formulation, terms)
    if isinstance(method, Adams):
        F = history(method, formulation, scene, Y)
        state, newest, done = stepped(method, rhs, scene, Y, 3, F)
        right, slope = adams(method, formulation, scene, Y, F, 3)
        assert done == 3
        np.testing.assert_allclose(newest, slope, rtol=0, atol=1e-10)
    else:
        state, _, done = stepped(method, rhs, scene, Y, 1)
        right = runge_kutta(method, formulation, scene, Y)
        assert done == 1
    size = 1e-15 * (np.abs(method.tableau.b).sum() if isinstance(method, RungeKutta) else 1.0) ** 2
    np.testing.assert_allclose(state, right, rtol=0, atol=1e-12 + size)


@pytest.mark.nojit
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_sines_of_corrected_angles_are_right_to_fourth_order(formulation: str) -> None:
    """A history that fits no motion: corrections d of whole degrees, of which d^5 / 120 may be missing."""
    method, scene, Y = ADAMS["abm8"], Scene(F0=0.0), lanes(VECTOR_LANES)
    errors, sizes = [], []
    for off in (0.5, 1.0, 2.0):
        F = history(method, formulation, scene, Y, off)
        _, newest, _ = stepped(method, kernel(formulation, "damped"), scene, Y, 1, F)
        right, slope = adams(method, formulation, scene, Y, F, 1)
        predicted = Y + H * np.tensordot(method.predictor, F[::-1], axes=1)
        sizes.append(np.abs(right - predicted)[:2].max())
        errors.append(np.abs(newest - slope).max() / np.abs(slope).max())
    assert min(sizes) > 0.002
    assert all(error < 10.0 * size**5 + 1e-14 for error, size in zip(errors, sizes, strict=True))
    assert errors[-1] < 1e-7


@pytest.mark.parametrize(
    ("row", "value"), [(0, 1.1 * REDUCTION_LIMIT), (1, -1e200), (2, 0.6 * REDUCTION_LIMIT / H), (3, -np.inf)]
)
@pytest.mark.parametrize("name", ["rk4", "ab5", "abm8"])
def test_a_lost_lane_keeps_its_state_and_leaves_the_others_alone(name: str, row: int, value: float) -> None:
    method, scene, Y = EXPLICIT[name], Scene(F0=0.0), lanes(VECTOR_LANES)
    F = history(method, "lagrange", scene, Y) if isinstance(method, Adams) else None
    rhs = kernel("lagrange", "damped")
    healthy, *_ = stepped(method, rhs, scene, Y, 1, F)
    if F is not None and row > 1:
        F[-1, row - 2, 3] = value  # the history turns it away
    Y[row, 3] = value
    state, _, done = stepped(method, rhs, scene, Y, 5, F)
    assert done == -1
    np.testing.assert_array_equal(state[:, 3], Y[:, 3])
    np.testing.assert_array_equal(np.delete(state, 3, 1), np.delete(healthy, 3, 1))


def test_what_is_too_long_has_none() -> None:
    def functions(module: str, precision: str) -> dict[str, Any]:
        raise AssertionError

    many = Rates("many", MOST_STATES + 1, (), functions)
    assert whole_steps(many, METHODS["rk4"].formulas[1], "float64") is None  # type: ignore[attr-defined]
    vector = Rates("vector", 2, (), functions, vector=True)
    assert whole_steps(vector, METHODS["rk4"].formulas[1], "float64") is None  # type: ignore[attr-defined]


#: gamma_0, gamma_1, ... (Hairer, Norsett, Wanner, Solving ODEs I, table III.1.1).
GAMMA = [Fraction(*g) for g in ((1, 1), (1, 2), (5, 12), (3, 8), (251, 720), (95, 288), (19087, 60480))]

LONG, MANY = 0.02, 60


@pytest.mark.parametrize("k", range(1, 8))
def test_weights_of_the_last_term_are_those_of_the_difference(k: int) -> None:
    """The last term of t^(k-1) is gamma_(k-1) (k-1)!, and polynomials of lower degree have none."""
    weights = np.array(term_weights([float(w) for w in bashforth(k)]))
    times = -np.arange(float(k))
    for degree in range(k):
        right = float(GAMMA[k - 1]) * float(np.prod(np.arange(1.0, k))) if degree == k - 1 else 0.0
        rounding = 1e-15 * np.abs(weights) @ np.abs(times**degree)
        assert weights @ times**degree == pytest.approx(right, abs=rounding)


def kept(name: str, formulation: str, outputs: Floats, starts: Floats) -> Ensemble:
    problem = motion_problem(Scene(alpha=0.0), len(starts), {}, formulation)
    times = np.concatenate([[0.0], outputs])
    return run_ensemble(problem.rhs, problem.params, problem.inward(starts), times, LONG, METHODS[name])


def pendulum(t: float, x: float, v: float) -> tuple[float, float]:
    return v, -fm.sin(x)


def pendulum_of_arrays(t: float, y: Floats, p: Floats, rates: Floats) -> None:
    rates[0] = y[1]
    rates[1] = -np.sin(y[0])


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("name", ["ab6", "abm8"])
def test_the_greatest_last_term_is_kept(name: str, formulation: str) -> None:
    """Against NumPy's differences of the rates at every step; one piece is looked at every few steps."""
    starts, method = random_starts(20), METHODS[name]
    assert isinstance(method, Adams)
    problem = motion_problem(Scene(alpha=0.0), 20, {}, formulation)
    every = kept(name, formulation, LONG * np.arange(1.0, MANY + 1.0), starts)
    rates = np.concatenate([starts[None], problem.outward(every.states)])[:, :, 2:]
    k = method.predictor.size
    terms = np.abs(np.diff(rates, n=k - 1, axis=0)).max(axis=2) * LONG * float(GAMMA[k - 1])
    # Of one step each: before every step but the first ones. A step's history ends where it begins.
    np.testing.assert_allclose(every.last_term, terms[:-1].max(axis=0), rtol=1e-6)
    looked = [step - k + 1 for step in range(0, MANY, EVERY) if step >= k - 1]
    whole = kept(name, formulation, np.array([LONG * MANY]), starts)
    np.testing.assert_allclose(whole.last_term, terms[looked].max(axis=0), rtol=1e-6)
    assert (whole.last_term < every.last_term).any()


def test_a_one_step_method_has_no_last_term() -> None:
    assert not kept("rk4", "lagrange", np.array([1.0]), random_starts(5)).last_term.size
