"""Identity of equilibria across a map."""

from __future__ import annotations

import numpy as np
import pytest

from fastmech.atlas.folds import trace_folds
from fastmech.atlas.map import EquilibriumMap, map_equilibria
from fastmech.scene import Scene

PAPER = Scene(c2=1100 / 3, alpha=0.0)
BISTABLE = PAPER.replace(c1=294.9)


@pytest.fixture(scope="module")
def atlas() -> EquilibriumMap:
    axes = {"F0": np.linspace(-400.0, 400.0, 90), "c2": np.linspace(0.0, 500.0, 71)}
    return map_equilibria(BISTABLE, axes)


def on_sheet(atlas: EquilibriumMap, values: np.ndarray, sheet: int) -> np.ndarray:
    there = atlas.sheet == sheet
    return np.where(there.any(axis=-1), np.where(there, values, 0.0).sum(axis=-1), np.nan)


def test_every_equilibrium_has_a_sheet_and_no_sheet_two_values(atlas: EquilibriumMap) -> None:
    assert ((atlas.sheet >= 0) == (atlas.morse_index >= 0)).all()
    ordered = np.sort(atlas.sheet, axis=-1)
    assert not ((ordered[..., 1:] == ordered[..., :-1]) & (ordered[..., 1:] >= 0)).any()
    filled = atlas.sheet >= 0
    assert (atlas.sheet_morse_index[atlas.sheet[filled]] == atlas.morse_index[filled]).all()


def test_the_stable_position_of_the_paper_is_one_sheet() -> None:
    axes = {"F0": np.linspace(-300.0, 300.0, 61), "c1": np.linspace(20.0, 250.0, 47)}
    atlas = map_equilibria(PAPER, axes)
    i, j = np.argmin(np.abs(axes["F0"] - 100.0)), np.argmin(np.abs(axes["c1"] - 162.5))
    slot = int(np.nanargmin(np.hypot(atlas.phi[i, j] - 1.45, atlas.theta[i, j] + 0.23)))
    sheet = atlas.sheet[i, j, slot]
    assert (atlas.sheet == sheet).any(axis=-1).all()
    assert atlas.sheet_morse_index[sheet] == 0


def test_values_on_a_sheet_change_little_between_neighbours(atlas: EquilibriumMap) -> None:
    """Where they jump a fold is near, or the sheet's cut at one."""
    folds = trace_folds(BISTABLE, *atlas.axes.items())
    near = np.stack([np.concatenate([getattr(c, k) for c in folds.curves]) for k in ("x", "y")])
    steps = np.array([np.diff(values)[0] for values in atlas.axes.values()])
    jumps = 0
    for sheet in range(len(atlas.sheet_morse_index)):
        for values in (atlas.phi, atlas.theta):
            angle = on_sheet(atlas, values, sheet)
            for along in (0, 1):
                change = np.abs(np.angle(np.exp(1j * np.diff(angle, axis=along))))
                for i, j in np.argwhere(change > 0.6):
                    jumps += 1
                    place = np.array([atlas.axes["F0"][i], atlas.axes["c2"][j]])
                    gap = np.abs((near - place[:, None]) / steps[:, None]).max(axis=0).min()
                    assert gap < 6.0, (sheet, place)
    assert jumps < 0.1 * atlas.count.size


def test_sheets_end_only_at_folds(atlas: EquilibriumMap) -> None:
    """Between neighbours with the same number of equilibria every sheet goes on."""
    kept = 0
    for along in (0, 1):
        one = atlas.sheet[:-1] if along == 0 else atlas.sheet[:, :-1]
        two = atlas.sheet[1:] if along == 0 else atlas.sheet[:, 1:]
        counts = (
            (atlas.count[:-1], atlas.count[1:]) if along == 0 else (atlas.count[:, :-1], atlas.count[:, 1:])
        )
        same = counts[0] == counts[1]
        kept += np.count_nonzero((np.sort(one, axis=-1) == np.sort(two, axis=-1)).all(axis=-1) & same)
        total = np.count_nonzero(same)
        assert np.count_nonzero(
            (np.sort(one, axis=-1) == np.sort(two, axis=-1)).all(axis=-1) & same
        ) == pytest.approx(total, rel=0.01)
    assert kept > 10_000


def test_one_call_or_many_pieces_give_the_same_sheets(monkeypatch: pytest.MonkeyPatch) -> None:
    axes = {"F0": np.linspace(-400.0, 400.0, 40), "c2": np.linspace(0.0, 500.0, 31)}
    whole = map_equilibria(BISTABLE, axes)
    monkeypatch.setattr("fastmech.atlas.map.SLAB", 100)
    pieces = map_equilibria(BISTABLE, axes)
    np.testing.assert_array_equal(whole.sheet_morse_index, pieces.sheet_morse_index)
    np.testing.assert_array_equal(np.sort(whole.sheet, axis=-1), np.sort(pieces.sheet, axis=-1))


def test_three_axes() -> None:
    axes = {"F0": np.linspace(-50.0, 50.0, 6), "c1": np.linspace(50.0, 200.0, 7), "c2": [300.0, 350.0, 400.0]}
    atlas = map_equilibria(PAPER, axes)
    assert atlas.sheet.shape == (6, 7, 3, 6)
    assert (atlas.sheet == atlas.sheet[0, 0, 0, 0]).any(axis=-1).all()
