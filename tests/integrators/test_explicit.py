"""The driver: one block, any method, any right-hand side."""

from __future__ import annotations

import numpy as np
import pytest
from integrators.driving import A, W, drive, observe_times, polynomial, rotation
from integrators.systems import LINEAR, Floats

from fastmech.ensembles.run import run_ensemble
from fastmech.integrators.methods import METHODS, Adams, RungeKutta
from fastmech.integrators.tableaus import TABLEAUS
from fastmech.jit import RHS_SIGNATURE, interpreted, kernel
from fastmech.scene import Scene
from fastmech.slider.coefficients import reduce
from fastmech.slider.kernels.select import with_terms

pytestmark = pytest.mark.nojit

EVERY_TABLEAU = pytest.mark.parametrize("method", TABLEAUS)


def by_the_book(method: str, y: Floats, h: float, steps: int) -> Floats:
    """Runge-Kutta written down as its definition, for y' = A y."""
    tableau = TABLEAUS[method]
    for _ in range(steps):
        stages: list[Floats] = []
        for row in tableau.a:
            stages.append(
                A @ (y + h * sum((w * k for w, k in zip(row, stages, strict=True)), np.zeros_like(y)))
            )
        y = y + h * sum(w * k for w, k in zip(tableau.b, stages, strict=True))
    return y


def magnitude(method: str) -> float:
    """Sum of the weights' magnitudes: 1 or little more, but 354 for verner6; rounding grows with it."""
    return float(np.abs(TABLEAUS[method].b).sum())


@EVERY_TABLEAU
def test_driver_does_what_the_definition_says(method: str) -> None:
    """Coarse steps, where every coefficient shows."""
    Y = np.random.default_rng(0).standard_normal((3, 9))
    out, last, *_ = drive(rotation, method, Y, np.array([0.0, 2.0]), [4], W)
    atol = 1e-14 + 1e-16 * magnitude(method) ** 2
    np.testing.assert_allclose(out[0], by_the_book(method, Y, 0.5, 4), rtol=0, atol=atol)
    np.testing.assert_array_equal(out[0], last)


@EVERY_TABLEAU
def test_polynomials_up_to_the_order_are_exact(method: str) -> None:
    """One step of 2 s from t = 1; nodes and weights only."""
    order = TABLEAUS[method].order
    p = 1.0 / np.arange(1.0, order + 1)
    out, *_ = drive(polynomial, method, np.array([[0.5]]), np.array([1.0, 3.0]), [1], p)
    exact = 0.5 + sum(p[k] * (3.0 ** (k + 1) - 1) / (k + 1) for k in range(order))
    assert out[0, 0, 0] == pytest.approx(exact, rel=1e-14 * magnitude(method))


def test_outputs_steps_and_observer() -> None:
    """No step to the first output (its time is the start's), then 3, then 5; observed after every step."""
    times = np.array([0.25, 0.25, 1.0, 3.5])
    Y = np.zeros((1, 2))
    out, last, record, _ = drive(polynomial, "rk4", Y, times, [0, 3, 5], np.array([2.0]), observe_times)
    np.testing.assert_array_equal(out[0], Y)
    np.testing.assert_allclose(out[1:, 0, 0], [1.5, 6.5], rtol=1e-15)
    np.testing.assert_array_equal(out[2], last)
    ends = [*(0.25 + 0.25 * np.arange(1, 4)), *(1.0 + 0.5 * np.arange(1, 6))]
    np.testing.assert_allclose(record[:, 0], [8, 3.5, 2 * sum(ends), 6.5], rtol=1e-15)
    np.testing.assert_array_equal(record[:, 0], record[:, 1])


def test_a_user_s_system_through_the_ensemble() -> None:
    """Lanes in several blocks, outputs at several times, against the exact solution."""
    times = np.array([0.5, 0.75, 1.5])
    states = LINEAR.run(times, 0.025, "dop853", block_lanes=4, threads=2)
    assert states.shape == (2, 11, 2)
    for state, t in zip(states, times[1:], strict=True):
        np.testing.assert_allclose(state, LINEAR.exact(t), rtol=0, atol=1e-11)


@pytest.mark.parametrize("formulation", ["lagrange", "hamilton"])
@pytest.mark.parametrize("name", ["rk4", "dop853", "ab6", "abm8", "abm12"])
def test_whole_steps_are_those_stage_by_stage(name: str, formulation: str) -> None:
    """Own forces and springs, steps that change, motions far out; the same kernel without its rates."""
    assert isinstance(METHODS[name], Adams | RungeKutta)
    whole = with_terms(formulation, "damped_decaying")
    staged = kernel(RHS_SIGNATURE)(interpreted(whole))
    random, n = np.random.default_rng(5), 24
    draws = random.uniform([-300, 1, 100], [300, 9, 200], (n, 3))
    own = np.array([reduce(Scene(F0=force, alpha=alpha, c1=spring)) for force, alpha, spring in draws])
    starts = np.concatenate([random.uniform(-3, 3, (n, 2)), random.uniform(-2, 2, (n, 2))], axis=1)
    starts[3, 1], starts[20, 0] = 3e7, -2e6  # where an angle has 8 digits behind the point, and 9
    times = np.array([0.3, 0.45, 0.75, 0.9])
    found, right = (run_ensemble(rhs, own, starts, times, 0.0026, METHODS[name]) for rhs in (whole, staged))
    off = np.abs(found.states - right.states).max(axis=(0, 2))
    assert off[[3, 20]].max() < 1e-6
    assert np.delete(off, [3, 20]).max() < 1e-10
