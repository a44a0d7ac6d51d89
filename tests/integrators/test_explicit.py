"""The driver: one block, any method, any right-hand side."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from integrators.systems import LINEAR, Floats

from fastmech.integrators.explicit import integrate_block, observe_nothing
from fastmech.integrators.tableaus import METHODS
from fastmech.jit import OBSERVER_SIGNATURE, RHS_SIGNATURE, kernel

pytestmark = pytest.mark.nojit

EVERY_METHOD = pytest.mark.parametrize("method", METHODS)


@kernel(RHS_SIGNATURE)
def polynomial(t: float, Y: Floats, dY: Floats, p: Floats) -> None:
    """y' = p0 + p1 t + p2 t^2 + ...: a method of order k is exact up to t^(k-1)."""
    for i in range(Y.shape[1]):
        dY[0, i] = 0.0
        for power in range(p.shape[0]):
            dY[0, i] += p[power, i] * t**power


@kernel(RHS_SIGNATURE)
def rotation(t: float, Y: Floats, dY: Floats, p: Floats) -> None:
    """A linear system of three states, y' = p x y."""
    for i in range(Y.shape[1]):
        dY[0, i] = p[1, i] * Y[2, i] - p[2, i] * Y[1, i]
        dY[1, i] = p[2, i] * Y[0, i] - p[0, i] * Y[2, i]
        dY[2, i] = p[0, i] * Y[1, i] - p[1, i] * Y[0, i]


@kernel(OBSERVER_SIGNATURE)
def observe_times(t: float, Y: Floats, params: Floats, record: Floats) -> None:
    """Number of calls, last time, sum of times, and the first state so far as it was seen last."""
    for i in range(Y.shape[1]):
        record[0, i] += 1.0
        record[1, i] = t
        record[2, i] += t * params[0]
        record[3, i] = Y[0, i]


def drive(
    rhs: Any,
    method: str,
    Y: Floats,
    times: Floats,
    steps: list[int],
    params: Floats,
    observe: Any = observe_nothing,
) -> tuple[Floats, Floats, Floats]:
    """Outputs, the block's last state and the record."""
    tableau = METHODS[method]
    packed = tableau.packed
    Y, record = Y.copy(), np.zeros((4, Y.shape[1]))
    out = np.empty((len(steps), *Y.shape))
    integrate_block(
        rhs,
        observe,
        packed.start,
        packed.stage,
        packed.weight,
        np.array(tableau.c),
        times,
        np.array(steps, dtype=np.int64),
        Y,
        np.repeat(params[:, None], Y.shape[1], axis=1),
        np.array([2.0]),
        record,
        out,
    )
    return out, Y, record


def by_the_book(method: str, A: Floats, y: Floats, h: float, steps: int) -> Floats:
    """Runge-Kutta written down as its definition, for y' = A y."""
    tableau = METHODS[method]
    for _ in range(steps):
        stages: list[Floats] = []
        for row in tableau.a:
            stages.append(
                A @ (y + h * sum((w * k for w, k in zip(row, stages, strict=True)), np.zeros_like(y)))
            )
        y = y + h * sum(w * k for w, k in zip(tableau.b, stages, strict=True))
    return y


@EVERY_METHOD
def test_driver_does_what_the_definition_says(method: str) -> None:
    """Coarse steps, where every coefficient shows."""
    w = np.array([0.7, -1.1, 0.4])
    A = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    Y = np.random.default_rng(0).standard_normal((3, 9))
    out, last, _ = drive(rotation, method, Y, np.array([0.0, 2.0]), [4], w)
    np.testing.assert_allclose(out[0], by_the_book(method, A, Y, 0.5, 4), rtol=0, atol=1e-14)
    np.testing.assert_array_equal(out[0], last)


@EVERY_METHOD
def test_polynomials_up_to_the_order_are_exact(method: str) -> None:
    """One step of 2 s from t = 1; nodes and weights only."""
    order = METHODS[method].order
    p = 1.0 / np.arange(1.0, order + 1)
    out, _, _ = drive(polynomial, method, np.array([[0.5]]), np.array([1.0, 3.0]), [1], p)
    exact = 0.5 + sum(p[k] * (3.0 ** (k + 1) - 1) / (k + 1) for k in range(order))
    assert out[0, 0, 0] == pytest.approx(exact, rel=1e-14)


def test_outputs_steps_and_observer() -> None:
    """No step to the first output (its time is the start's), then 3, then 5; observed after every step."""
    times = np.array([0.25, 0.25, 1.0, 3.5])
    Y = np.zeros((1, 2))
    out, last, record = drive(polynomial, "rk4", Y, times, [0, 3, 5], np.array([2.0]), observe_times)
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
