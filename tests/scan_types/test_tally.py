"""Quantiles of blocks that are never together: NumPy's of all of them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastmech.results import Dataset
from fastmech.scan_types.tally import Tally

pytestmark = pytest.mark.nojit

TIMES = st.lists(st.one_of(st.just(np.nan), st.integers(0, 9).map(lambda k: 0.05 * k)), max_size=30)


@given(st.lists(TIMES, max_size=5))
def test_quantiles_and_shares(blocks: list[list[float]]) -> None:
    tally = Tally()
    for block in blocks:
        one = Tally.of(np.array(block, dtype=np.float64), {"not_finite": int(np.isnan(block).sum())})
        tally.add(Dataset(one.variables(), one.attrs()))
    times = np.array([t for block in blocks for t in block], dtype=np.float64)
    back = times[np.isfinite(times)]
    assert (tally.total, tally.failed["not_finite"]) == (times.size, times.size - back.size)
    wanted = (0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 1.0)
    right = np.quantile(back, wanted) if back.size else np.full(len(wanted), np.nan)
    np.testing.assert_allclose(tally.quantiles(wanted), right, rtol=1e-14, atol=1e-16)
    np.testing.assert_equal(tally.share, back.size / times.size if times.size else np.nan)
