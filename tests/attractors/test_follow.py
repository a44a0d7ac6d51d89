"""Attractors along a parameter, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import fastmech as fm

#: Folds of x' = r + x - x^3.
FOLD = 2.0 / (3.0 * np.sqrt(3.0))


def two_wells(t, x, r):  # type: ignore[no-untyped-def]
    return (r + x - x * x * x,)


def test_attractors_come_and_go_at_the_folds() -> None:
    system = fm.System(two_wells, ["x"], {"r": 0.0})
    found = fm.follow_basins(system, "r", np.linspace(-0.6, 0.6, 13), {"x": (-2.0, 2.0)}, 800)
    assert found.fractions.shape == (13, 2)
    kinds = {t.kind: t for t in found.tipping}
    assert kinds["born"].low <= -FOLD <= kinds["born"].high
    assert kinds["dies"].low <= FOLD <= kinds["dies"].high
    assert all(t.high - t.low < 1e-4 for t in found.tipping)
    # At r = 0.1 the boundary is the middle root.
    middle = np.sort(np.roots([-1.0, 0.0, 1.0, 0.1]).real)[1]
    k = int(np.argmin(np.abs(found.values - 0.1)))
    shares = np.sort(found.fractions[k])
    np.testing.assert_allclose(shares, np.sort([(2.0 + middle) / 4.0, (2.0 - middle) / 4.0]), atol=0.06)
    np.testing.assert_allclose(np.nansum(found.fractions, axis=1) + found.unlabelled, 1.0)
    axes = found.plot()
    assert axes.get_ylabel() == "share of the starts"


def test_tipping_probabilities_are_shares_of_each_basin() -> None:
    before = np.array([[0, 0, 0, 1], [1, 1, -1, 1]])
    after = np.array([[0, 1, -1, 1], [1, 1, 0, 0]])
    expected = [[1 / 3, 1 / 3, 1 / 3], [1 / 4, 3 / 4, 0.0]]
    np.testing.assert_allclose(fm.tipping_probabilities(before, after), expected)
    with pytest.raises(fm.InputError, match="same shape"):
        fm.tipping_probabilities(before, after[:1])
    with pytest.raises(fm.InputError, match="whole numbers"):
        fm.tipping_probabilities(before * 1.0, after)


@pytest.mark.parametrize("values", [[0.1], [0.1, 0.1], [[0.0, 1.0]], "r"])
def test_wrong_values_get_one_line(values: object) -> None:
    system = fm.System(two_wells, ["x"], {"r": 0.0})
    with pytest.raises(fm.InputError, match="values"):
        fm.follow_basins(system, "r", values, {"x": (-1.0, 1.0)})  # type: ignore[arg-type]
