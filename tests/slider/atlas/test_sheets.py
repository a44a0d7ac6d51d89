"""Identity of equilibria across a map."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.optimize

from fastmech.scene import Scene
from fastmech.slider.atlas.map import EquilibriumMap, map_equilibria

PAPER = Scene(c2=1100 / 3, alpha=0.0)
BISTABLE = PAPER.replace(c1=294.9)

#: A scene and a grid off the values with symmetry.
MAPS = {
    "paper": (PAPER, {"F0": np.linspace(-400.0, 390.0, 60), "c1": np.linspace(0.0, 400.0, 57)}),
    "bistable": (BISTABLE, {"F0": np.linspace(-400.0, 390.0, 60), "c2": np.linspace(0.0, 500.0, 57)}),
    "stiffnesses": (PAPER, {"c1": np.linspace(1.0, 400.0, 60), "c2": np.linspace(1.0, 800.0, 57)}),
    "masses": (PAPER, {"m1": np.linspace(0.5, 60.0, 60), "m2": np.linspace(0.5, 60.0, 57)}),
    "length": (PAPER, {"l": np.linspace(0.2, 4.0, 60), "F0": np.linspace(-400.0, 390.0, 57)}),
}


@pytest.fixture(scope="module")
def atlas() -> EquilibriumMap:
    axes = {"F0": np.linspace(-400.0, 400.0, 90), "c2": np.linspace(0.0, 500.0, 71)}
    return map_equilibria(BISTABLE, axes)


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


def gradient_and_hessian(
    scene: Scene, values: dict[str, float], q: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Of U = Pi - F x2, written out from the design's potential."""
    p = {**scene.parameters, **values}
    a = (p["m1"] + p["m2"]) * p["g"] * p["l"] - p["c2"] * p["l"] ** 2
    b, C, f = p["m2"] * p["g"] * p["l"], p["c1"] * p["l"] ** 2, p["F0"] * p["l"]
    phi, theta = q
    k, s = C * np.cos(phi + theta), C * np.sin(phi + theta)
    g = [a * np.cos(phi) + f * np.sin(phi) - k, b * np.sin(theta) + f * np.cos(theta) - k]
    h = [[f * np.cos(phi) - a * np.sin(phi) + s, s], [s, b * np.cos(theta) - f * np.sin(theta) + s]]
    return np.array(g), np.array(h)


def continue_straight(scene: Scene, start: dict[str, float], end: dict[str, float], q: np.ndarray) -> Any:
    """The equilibrium at the end of a straight way, by small steps with SciPy; None: a fold is on the way."""
    at, step, sign = 0.0, 1.0 / 64.0, None
    while at < 1.0:
        step = min(step, 1.0 - at)
        values = {n: (1.0 - at - step) * start[n] + (at + step) * end[n] for n in start}
        found = scipy.optimize.root(
            lambda q, v=values: gradient_and_hessian(scene, v, q)[0],
            q,
            jac=lambda q, v=values: gradient_and_hessian(scene, v, q)[1],
            tol=1e-13,
        )
        determinant = np.linalg.det(gradient_and_hessian(scene, values, found.x)[1])
        before = np.linalg.det(gradient_and_hessian(scene, values, q)[1])
        sign = np.sign(before) if sign is None else sign
        near = np.hypot(*(found.x - q)) < 0.02 and 0.7 < determinant / before < 1.4
        if near and np.sign(determinant) == sign and np.abs(found.fun).max() < 1e-7:
            at, q, step = at + step, found.x, 1.5 * step
        else:
            step *= 0.5
            if step < 1e-5:
                return None
    return q


def on_sheet_all_the_way(
    atlas: EquilibriumMap, one: tuple[int, ...], two: tuple[int, ...], sheet: int
) -> bool:
    """Whether all corners of the cells on a straight way have the sheet, none of them at a break of it."""
    way = np.array(one) + np.linspace(0.0, 1.0, 400)[:, None] * (np.array(two) - np.array(one))
    torn = {tuple(row[:2]) for row in atlas.sheet_discontinuities.tolist() if row[-1] == sheet}
    for rounded in (np.floor, np.ceil):
        for other in (np.floor, np.ceil):
            i, j = rounded(way[:, 0]).astype(int), other(way[:, 1]).astype(int)
            if not (atlas.sheet[i, j] == sheet).any(axis=-1).all() or torn & set(zip(i, j, strict=True)):
                return False
    return True


@pytest.mark.parametrize("name", MAPS)
def test_a_sheet_is_one_equilibrium_continued(name: str) -> None:
    """Between neighbours on one sheet, but for its breaks, and between points with the sheet between them."""
    scene, axes = MAPS[name]
    atlas = map_equilibria(scene, axes)
    names, grid = list(axes), atlas.count.shape
    rng = np.random.default_rng(3)
    neighbours = far = 0
    for trial in range(240):
        one = tuple(int(rng.integers(n)) for n in grid)
        two = tuple(int(rng.integers(n)) for n in grid)
        if trial % 2:
            axis = int(rng.integers(len(grid)))
            two = tuple(k + (d == axis) for d, k in enumerate(one))
            if two[axis] == grid[axis]:
                continue
        both = np.intersect1d(atlas.sheet[one], atlas.sheet[two])
        sheet = int(rng.choice(both[both >= 0]))
        i, j = (list(atlas.sheet[k]).index(sheet) for k in (one, two))
        start, end = ({n: float(axes[n][k]) for n, k in zip(names, p, strict=True)} for p in (one, two))
        if not on_sheet_all_the_way(atlas, one, two, sheet):
            continue  # by another sheet of its branch it may come back as another equilibrium
        q = continue_straight(scene, start, end, np.array([atlas.phi[one][i], atlas.theta[one][i]]))
        if trial % 2:
            assert q is not None, (start, end, sheet)
            neighbours += 1
        if q is not None:
            away = np.abs(np.exp(1j * q) - np.exp(1j * np.array([atlas.phi[two][j], atlas.theta[two][j]])))
            assert away.max() < 1e-6, (start, end, sheet)
            far += not trial % 2
    assert neighbours > 90
    assert far > 50


@pytest.mark.parametrize("name", MAPS)
def test_breaks_are_few_and_real(name: str) -> None:
    """On an edge that is listed the sheet's equilibrium does not get across.

    A curve from side to side crosses no more edges than the grid has lines; two sheets may be torn by it.
    """
    scene, axes = MAPS[name]
    atlas = map_equilibria(scene, axes)
    assert len(atlas.sheet_discontinuities) <= 2 * sum(atlas.count.shape)
    for *two, axis, sheet in atlas.sheet_discontinuities[:10].tolist():
        one = [k - (d == axis) for d, k in enumerate(two)]
        i, j = (list(atlas.sheet[tuple(k)]).index(sheet) for k in (one, two))
        start, end = ({n: float(axes[n][k]) for n, k in zip(axes, p, strict=True)} for p in (one, two))
        q = continue_straight(scene, start, end, np.array([atlas.phi[*one][i], atlas.theta[*one][i]]))
        if q is not None:
            there = np.array([atlas.phi[*two][j], atlas.theta[*two][j]])
            assert np.abs(np.exp(1j * q) - np.exp(1j * there)).max() > 1e-6


def test_the_papers_plane_has_the_sheets_that_its_folds_say() -> None:
    """Fourteen sheets of six branches, whatever the grid.

    Its folds (see ``trace_folds``) are a closed curve with four cusps around (0, 110) and two wedges that
    come in from the sides and end in a cusp. Outside there are a minimum, two saddles and a maximum. In the
    closed curve a saddle and a maximum are added; at its cusps a maximum between two saddles and a saddle
    between two maxima vanish in turn, so two saddles and two maxima in it are one each from outside, cut:
    four sheets more. In each wedge a minimum and a saddle are added; at its cusp the minimum vanishes between
    two saddles: the minimum and the two saddles, three sheets more a wedge. The branches: the minimum, the
    two saddles and the maximum from outside, and the minima of the wedges.
    """
    for n in (60, 101, 160):
        atlas = map_equilibria(PAPER, {"F0": np.linspace(-400.0, 400.0, n), "c1": np.linspace(0.0, 400.0, n)})
        assert list(atlas.sheet_morse_index) == [0] * 3 + [1] * 8 + [2] * 3
        assert len(set(atlas.sheet_branch)) == 6
        # The stable position of the paper is over the whole plane one sheet and a branch of its own.
        assert (atlas.sheet == 0).any(axis=-1).all()
        assert np.count_nonzero(atlas.sheet_branch == atlas.sheet_branch[0]) == 1


def test_islands_of_a_narrow_wedge_are_joined(monkeypatch: pytest.MonkeyPatch) -> None:
    axes = {"F0": np.linspace(-400.0, 400.0, 201), "c1": np.linspace(0.0, 400.0, 201)}
    joined = map_equilibria(PAPER, axes)
    monkeypatch.setattr("fastmech.slider.atlas.sheets.join_islands", lambda *_: None)
    apart = map_equilibria(PAPER, axes)
    assert len(joined.sheet_branch) == 14 < len(apart.sheet_branch)


def test_sheets_of_one_branch_are_the_minima_round_a_cusp(atlas: EquilibriumMap) -> None:
    """Two minima between the folds, one outside: three sheets at least, one branch."""
    minima = atlas.sheet_morse_index == 0
    assert len(set(atlas.sheet_branch[minima])) == 1
    bistable = atlas.count_stable == 2
    assert bistable.any()
    inside = set(atlas.sheet[bistable][atlas.morse_index[bistable] == 0])
    outside = set(atlas.sheet[~bistable][atlas.morse_index[~bistable] == 0])
    assert not inside & outside


def test_one_call_or_many_pieces_give_the_same_sheets(monkeypatch: pytest.MonkeyPatch) -> None:
    axes = {"F0": np.linspace(-400.0, 400.0, 40), "c2": np.linspace(0.0, 500.0, 31)}
    whole = map_equilibria(BISTABLE, axes)
    monkeypatch.setattr("fastmech.slider.atlas.map.SLAB", 100)
    pieces = map_equilibria(BISTABLE, axes)
    np.testing.assert_array_equal(whole.sheet_morse_index, pieces.sheet_morse_index)
    np.testing.assert_array_equal(np.sort(whole.sheet, axis=-1), np.sort(pieces.sheet, axis=-1))


def test_three_axes() -> None:
    axes = {"F0": np.linspace(-50.0, 50.0, 6), "c1": np.linspace(50.0, 200.0, 7), "c2": [300.0, 350.0, 400.0]}
    atlas = map_equilibria(PAPER, axes)
    assert atlas.sheet.shape == (6, 7, 3, 6)
    assert (atlas.sheet == atlas.sheet[0, 0, 0, 0]).any(axis=-1).all()
