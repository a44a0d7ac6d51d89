"""Shares and quantiles of blocks that are never together: NumPy's of all of them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastmech.ensembles.status import Status
from fastmech.scan_types.disturbed import Tally

pytestmark = pytest.mark.nojit

ENDS = st.sampled_from(
    [Status.RETURNED, Status.ELSEWHERE, Status.OUT_OF_RANGE, Status.UNDECIDED, Status.NOT_FINITE]
)
#: Status and time to return, which only those that returned may have.
LANES = st.lists(
    st.tuples(ENDS, st.one_of(st.none(), st.integers(0, 9).map(lambda k: 0.05 * k))), max_size=30
)


@given(st.lists(LANES, max_size=5))
def test_quantiles_and_shares(blocks: list[list[tuple[Status, float | None]]]) -> None:
    tally = Tally()
    for block in blocks:
        outcome = np.array([end for end, _ in block], dtype=np.int8)
        times = np.array(
            [t if end == Status.RETURNED and t is not None else np.nan for end, t in block], dtype=np.float64
        )
        one = Tally.of(outcome, times)
        tally.add(one.tile({}))
    lanes = [lane for block in blocks for lane in block]
    ends = [end for end, _ in lanes]
    back = [np.inf if t is None else t for end, t in lanes if end == Status.RETURNED]
    assert tally.ended["not_finite"] == ends.count(Status.NOT_FINITE)
    wanted = (0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 1.0)
    # NumPy makes infinity less infinity, and 0 times infinity, no number: it is asked about neighbours.
    ranks = [q * (len(back) - 1) for q in wanted]
    upper = np.array([sorted(back)[int(np.ceil(k))] if back else np.nan for k in ranks])
    finite = np.quantile(np.minimum(back, 1e9), wanted) if back else upper
    right = np.where(np.isinf(upper), np.inf, finite)
    np.testing.assert_allclose(tally.quantiles(), right, rtol=1e-14, atol=1e-16)
    shares = tally.shares()
    if not lanes:
        assert np.isnan(list(shares.values())).all()
        return
    assert shares["share_returned"] == len(back) / len(lanes)
    lost = ends.count(Status.ELSEWHERE) + ends.count(Status.OUT_OF_RANGE)
    assert shares["share_returned_at_most"] == pytest.approx(1.0 - lost / len(lanes))
    assert shares["share_returned_lower"] <= shares["share_returned"] + 1e-15
    assert shares["share_returned_upper"] >= shares["share_returned_at_most"] - 1e-15
