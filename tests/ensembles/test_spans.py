"""The way through a run: pieces that no call changes."""

from __future__ import annotations

import numpy as np
import pytest
from ensembles.starts import Floats

from fastmech.ensembles.lanes import MOST_PIECE_STEPS, PIECE_STEPS, PIECES, output_steps, way

pytestmark = pytest.mark.nojit

TIMES = np.array([0.0, 0.0, 0.5, 1.28, 3.0, 30.0, 5000.0])


@pytest.mark.parametrize("dt", [0.01, 0.3, 1e-4])
def test_pieces_pass_every_output_in_all_its_steps(dt: float) -> None:
    passed, wanted = way(TIMES, dt), output_steps(TIMES, dt)
    ends = np.flatnonzero(passed.outputs >= 0)
    np.testing.assert_array_equal(passed.outputs[ends], np.arange(wanted.size))
    np.testing.assert_array_equal(passed.times[ends + 1], TIMES[1:])
    np.testing.assert_array_equal(np.diff(np.cumsum(passed.steps)[ends], prepend=0), wanted)
    assert passed.times[0] == TIMES[0]
    assert passed.steps.max() <= max(PIECE_STEPS, min(MOST_PIECE_STEPS, -(-wanted.max() // PIECES)))
    # All steps of an interval are as long, to rounding.
    owner = np.searchsorted(ends, np.arange(passed.steps.size))
    taken = passed.steps > 0
    lengths = np.diff(passed.times)[taken] / passed.steps[taken]
    mean = (np.diff(TIMES) / np.maximum(wanted, 1))[owner][taken]
    np.testing.assert_allclose(lengths, mean, rtol=0.0, atol=4e-16 * TIMES[-1] / PIECE_STEPS * 8)


@pytest.mark.parametrize("most", [1, 64, 100, 1000, 10**9])
def test_calls_share_out_the_same_pieces(most: int) -> None:
    whole = way(TIMES, 0.01)
    spans, piece = [], 0
    while piece < whole.steps.size:
        spans.append(whole.span(piece, most))
        piece += spans[-1].steps.size
    for name in ("steps", "outputs"):
        np.testing.assert_array_equal(
            np.concatenate([getattr(span, name) for span in spans]), getattr(whole, name)
        )
    times: list[Floats] = [whole.times[:1], *(span.times[1:] for span in spans)]
    np.testing.assert_array_equal(np.concatenate(times), whole.times)
    assert all(span.steps.sum() <= most or span.steps.size == 1 for span in spans)
    wanted = [np.count_nonzero(TIMES[1:] <= span.times[-1]) for span in spans]
    assert [span.passed for span in spans] == wanted
    assert spans[-1].passed == TIMES.size - 1


def test_no_outputs_no_pieces() -> None:
    assert way(np.array([0.0]), 0.1).steps.size == 0
