from __future__ import annotations

import numpy as np
import pytest

from fastmech.disturbance.motion import EXCURSION, LAST_OUTSIDE, SWUNG, observe_departure

pytestmark = pytest.mark.nojit


def test_record_of_three_steps() -> None:
    """Unit metric with coupling 0.5, omega = 2, radius 1 about (1, -1); what was seen before is kept."""
    params = np.array([1.0, -1.0, 1.0, 0.5, 0.5, 1.0, 0.25, 1.0])
    record = np.zeros((EXCURSION + 6, 3))
    record[-4:-2] = [[1.0], [-1.0]]  # all begin at rest in the middle
    blocks = [
        # phi: out by 2; rates: 2.1/2 in size; in by sqrt(0.36 + 0.36 - 0.36) = 0.6
        np.array([[3.0, 1.0, 1.6], [-1.0, -1.0, -1.6], [0.0, 2.1, 0.0], [0.0, 0.0, 0.0]]),
        # the coupling puts the third out: sqrt(0.36 + 0.36 + 0.36) = 1.04
        np.array([[1.0, 1.0, 0.4], [-1.5, -1.0, -1.6], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]),
        np.array([[1.1, 1.0, 1.0], [-1.0, -1.0, -1.0], [0.0, 1.9, 0.0], [0.0, 0.0, 0.0]]),
    ]
    for t, Y in zip((1.0, 2.0, 3.0), blocks, strict=True):
        observe_departure(t, Y, params, record)
    np.testing.assert_array_equal(record[LAST_OUTSIDE], [1.0, 1.0, 2.0])
    np.testing.assert_array_equal(record[SWUNG], [2.0, 0.0, 1.0])
    np.testing.assert_allclose(record[EXCURSION], [2.0, 0.0, 0.6], rtol=1e-15)
    np.testing.assert_allclose(record[EXCURSION + 1], [0.5, 0.0, 0.6], rtol=1e-15)


def test_a_coordinate_that_turns_round_within_a_step_departs_there() -> None:
    """x = 3 s - 3 s^3 and -(s - s^2), s = 2 t from 0 to 1: largest at s^2 = 1/3 and s = 1/2, 0 at ends."""
    params = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0])
    record = np.zeros((EXCURSION + 6, 1))
    record[-4:, 0] = [0.0, 0.0, 6.0, -2.0]
    observe_departure(0.5, np.array([[0.0], [0.0], [-12.0], [2.0]]), params, record)
    np.testing.assert_allclose(record[EXCURSION : EXCURSION + 2, 0], [2.0 / np.sqrt(3.0), 0.25], rtol=1e-15)
    np.testing.assert_array_equal(record[-4:, 0], [0.0, 0.0, -12.0, 2.0])
