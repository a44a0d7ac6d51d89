from __future__ import annotations

import numpy as np
import pytest

from fastmech.disturbance.observe import EXCURSION, LAST_OUTSIDE, observe_departure

pytestmark = pytest.mark.nojit


def test_record_of_three_steps() -> None:
    """Unit metric with coupling 0.5, omega = 2, radius 1 about (1, -1); what was seen before is kept."""
    params = np.array([1.0, -1.0, 1.0, 0.5, 0.5, 1.0, 0.25, 1.0])
    record = np.zeros((3, 3))
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
    np.testing.assert_allclose(record[EXCURSION], [2.0, 0.0, 0.6], rtol=1e-15)
    np.testing.assert_allclose(record[EXCURSION + 1], [0.5, 0.0, 0.6], rtol=1e-15)
