"""Adams methods: weights, the driver against the definition, starts and restarts, stability."""

from __future__ import annotations

from fractions import Fraction
from math import factorial

import numpy as np
import pytest
from integrators.driving import A, W, counting, drive, observe_times, rotation
from integrators.systems import Floats

from fastmech.integrators.methods import METHODS, Adams, bashforth, moulton
from fastmech.jit import RHS_SIGNATURE, kernel

ADAMS = {name: method for name, method in METHODS.items() if isinstance(method, Adams)}
EVERY_ADAMS = pytest.mark.parametrize("name", ADAMS)

#: Hairer, Norsett, Wanner, Solving ODEs I, tables III.1.1 and III.1.2 and the formulas after them.
PRINTED_BASHFORTH = {
    1: "1", 2: "3/2 -1/2", 3: "23/12 -16/12 5/12", 4: "55/24 -59/24 37/24 -9/24",
    5: "1901/720 -2774/720 2616/720 -1274/720 251/720",
    6: "4277/1440 -7923/1440 9982/1440 -7298/1440 2877/1440 -475/1440",
}  # fmt: skip
PRINTED_MOULTON = {
    1: "1", 2: "1/2 1/2", 3: "5/12 8/12 -1/12", 4: "9/24 19/24 -5/24 1/24",
    5: "251/720 646/720 -264/720 106/720 -19/720",
    6: "475/1440 1427/1440 -798/1440 482/1440 -173/1440 27/1440",
}  # fmt: skip
GAMMA = "1 1/2 5/12 3/8 251/720 95/288 19087/60480 5257/17280 1070017/3628800"
GAMMA_STAR = "1 -1/2 -1/12 -1/24 -19/720 -3/160 -863/60480 -275/24192 -33953/3628800"


def fractions(printed: str) -> list[Fraction]:
    return [Fraction(value) for value in printed.split()]


@pytest.mark.parametrize("order", PRINTED_BASHFORTH)
def test_weights_are_those_printed(order: int) -> None:
    assert list(bashforth(order)) == fractions(PRINTED_BASHFORTH[order])
    assert list(moulton(order)) == fractions(PRINTED_MOULTON[order])


@pytest.mark.parametrize("order", range(1, 9))
def test_error_constants(order: int) -> None:
    """What the formula leaves of the integral of t^order is order! gamma_order."""
    integral = Fraction(1, order + 1)
    explicit = integral - sum(w * Fraction(-age) ** order for age, w in enumerate(bashforth(order)))
    implicit = integral - sum(w * Fraction(1 - age) ** order for age, w in enumerate(moulton(order)))
    assert explicit == factorial(order) * fractions(GAMMA)[order]
    assert implicit == factorial(order) * fractions(GAMMA_STAR)[order]


def by_the_book(method: Adams, y: Floats, h: float, steps: int) -> Floats:
    """The method as its definition says, for y' = A y from the exact first steps."""
    rows = method.order - 1 if method.corrects else method.order
    values, vectors = np.linalg.eig(A)
    flow = [(vectors @ np.diag(np.exp(values * h * k)) @ np.linalg.inv(vectors)).real for k in range(rows)]
    path = [matrix @ y for matrix in flow]
    past = [float(w) for w in bashforth(rows)]
    for _ in range(steps - rows + 1):
        slopes = [A @ state for state in path[: -rows - 1 : -1]]
        state = path[-1] + h * sum(w * f for w, f in zip(past, slopes, strict=True))
        if method.corrects:
            weights = [float(w) for w in moulton(method.order)]
            state = path[-1] + h * sum(w * f for w, f in zip(weights, [A @ state, *slopes], strict=True))
        path.append(state)
    return path[-1]


@pytest.mark.nojit
@EVERY_ADAMS
def test_driver_does_what_the_definition_says(name: str) -> None:
    """Steps at which the starter is exact to rounding but for ab5 and ab6, whose starter has order 5."""
    Y = np.random.default_rng(0).standard_normal((3, 9))
    h = 2.0**-6 if ADAMS[name].starter.order < 6 else 2.0**-5
    out, last, *_ = drive(rotation, name, Y, np.array([0.0, 40 * h]), [40], W)
    np.testing.assert_allclose(out[0], by_the_book(ADAMS[name], Y, h, 40), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(out[0], last)


@pytest.mark.nojit
@EVERY_ADAMS
def test_runs_too_short_for_the_history_are_the_starter_s(name: str) -> None:
    Y, times = np.array([[1.0, 2.0], [0.0, 1.0], [0.5, 0.0]]), np.array([0.0, 0.5])
    steps = [ADAMS[name].start_steps]
    out, *_ = drive(rotation, name, Y, times, steps, W)
    right, *_ = drive(rotation, ADAMS[name].starter.name, Y, times, steps, W)
    np.testing.assert_array_equal(out, right)


@EVERY_ADAMS
def test_outputs_of_equal_steps_change_nothing(name: str) -> None:
    """Neither exact ones nor ones whose times are rounded, nor outputs at the start."""
    Y = np.random.default_rng(1).standard_normal((3, 5))
    once, *_ = drive(rotation, name, Y, np.array([0.0, 2.0]), [128], W)
    often, *_ = drive(rotation, name, Y, np.array([0.0, 0.0, 0.25, 1.0, 2.0]), [0, 16, 48, 64], W)
    np.testing.assert_array_equal(often[0], Y)
    np.testing.assert_array_equal(often[-1], once[-1])
    rounded = np.arange(101) * 0.1 + 1000.0
    *_, calls = drive(counting, name, Y[:1], rounded, [2] * 100, np.zeros(1))
    assert calls[0, 0] == ADAMS[name].evaluations(200)


@EVERY_ADAMS
def test_another_step_starts_anew(name: str) -> None:
    """The same, bit for bit, as two runs."""
    Y = np.random.default_rng(2).standard_normal((3, 5))
    both, *_ = drive(rotation, name, Y, np.array([0.0, 1.0, 2.0]), [50, 60], W)
    first, last, *_ = drive(rotation, name, Y, np.array([0.0, 1.0]), [50], W)
    second, *_ = drive(rotation, name, last, np.array([1.0, 2.0]), [60], W)
    np.testing.assert_array_equal(both, np.concatenate([first, second]))


@kernel(RHS_SIGNATURE)
def bent(t: float, Y: Floats, dY: Floats, p: Floats) -> None:
    """x'' = F that rises until 1 s and stays."""
    for i in range(Y.shape[1]):
        dY[0, i], dY[1, i] = Y[1, i], min(t, 1.0)


@EVERY_ADAMS
def test_a_piece_of_no_steps_starts_anew(name: str) -> None:
    """So steps of one length keep their order where a load bends: x is a cubic, then a parabola."""
    times, Y = np.array([0.0, 1.0, 1.0, 3.0]), np.zeros((2, 3))
    out, *_ = drive(bent, name, Y, times, [32, 0, 64], np.zeros(1))
    right = [[1 / 6, 1 / 2], [1 / 6, 1 / 2], [1 / 6 + 2 / 2 + 4 / 2, 1 / 2 + 2]]
    np.testing.assert_allclose(out, np.repeat(np.array(right)[:, :, None], 3, axis=2), rtol=1e-13)


@EVERY_ADAMS
def test_observed_after_every_step(name: str) -> None:
    """Steps of starter and method alike; the observer sees the state that is the output."""
    Y, times = np.ones((3, 2)), np.array([0.25, 1.0, 3.5])
    out, _, record, _ = drive(rotation, name, Y, times, [30, 50], W, observe_times)
    ends = [*(0.25 + 0.025 * np.arange(1, 31)), *(1.0 + 0.05 * np.arange(1, 51))]
    np.testing.assert_allclose(record[:3, 0], [80, 3.5, 2 * sum(ends)], rtol=1e-14)
    np.testing.assert_array_equal(record[3], out[-1, 0])


@EVERY_ADAMS
def test_a_lane_does_not_depend_on_its_block(name: str) -> None:
    Y = np.random.default_rng(3).standard_normal((3, 37))
    times = np.array([0.0, 1.5])
    whole, *_ = drive(rotation, name, Y, times, [40], W)
    for lanes in (slice(0, 1), slice(1, 9), slice(9, 37)):
        part, *_ = drive(rotation, name, np.ascontiguousarray(Y[:, lanes]), times, [40], W)
        np.testing.assert_array_equal(part, whole[:, :, lanes])


@kernel(RHS_SIGNATURE)
def decay(t: float, Y: Floats, dY: Floats, p: Floats) -> None:
    """y' = -p0 y."""
    for i in range(Y.shape[1]):
        dY[0, i] = -p[0, i] * Y[0, i]


@pytest.mark.parametrize(
    ("name", "limit"),
    [("ab5", 0.163), ("ab6", 0.0875), ("ab8", 0.024), ("abm8", 0.58), ("abm10", 0.337), ("abm12", 0.21)],
)
def test_stability_intervals_end_where_the_registry_says(name: str, limit: float) -> None:
    steps = 20000
    for factor, grows in ((0.96, False), (1.04, True)):
        _, last, *_ = drive(
            decay, name, np.array([[1.0]]), np.array([0.0, 1.0 * steps]), [steps], np.array([limit * factor])
        )
        assert (not abs(last[0, 0]) < 1.0) == grows
