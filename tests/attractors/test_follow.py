"""Attractors along a parameter, against closed forms."""

from __future__ import annotations

import math

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


def test_an_attractor_that_becomes_another_kind_is_told() -> None:
    """A supercritical Hopf point at m = 0, where motions come to rest as t^(-1/2); it goes on as a cycle."""

    def hopf(t, x, y, m):  # type: ignore[no-untyped-def]
        r = x * x + y * y
        return (m - r) * x - y, x + (m - r) * y

    system = fm.System(hopf, ["x", "y"], {"m": 0.0})
    found = fm.follow_basins(system, "m", [-0.2, 0.0, 0.2], {"x": (-1.0, 1.0), "y": (-1.0, 1.0)}, 50)
    assert found.changes == [(0, "fixed point", "periodic", 0.0, 0.2)]
    assert "0 from fixed point to periodic between m = 0 and 0.2" in str(found)
    assert not found.tipping


def shifted(t, x, r, s):  # type: ignore[no-untyped-def]
    return (r + s + x - x * x * x,)


def test_attractors_have_the_same_numbers_over_two_parameters() -> None:
    """The upper and the lower equilibrium; lines number them by their shares, which change places."""
    system = fm.System(shifted, ["x"], {"r": 0.0, "s": 0.0})
    r, s = np.array([-0.3, 0.1, 0.3]), np.array([-0.25, 0.25])
    found = fm.follow_basins(system, "r", r, {"x": (-2.0, 2.0)}, 60, each={"s": s})
    assert isinstance(found, fm.BasinsOver)
    assert found.fractions.shape == (2, 3, 2)
    upper: dict[int, set[bool]] = {}
    for line, shift in zip(found.lines, s, strict=True):
        for value, there, shares in zip(r, line.attractors, line.fractions, strict=True):
            roots = np.roots([-1.0, 0.0, 1.0, shift + value])
            assert len(there) == (2 if np.isreal(roots).all() else 1)
            assert set(np.flatnonzero(np.isfinite(shares))) == set(there)
            for number, one in there.items():
                assert np.abs(roots - one.points[0, 0]).min() < 1e-9
                upper.setdefault(number, set()).add(bool(one.points[0, 0] > 0.0))
    assert sorted(map(list, upper.values())) == [[False], [True]]
    tips = {
        (t.kind, t.attractor): shift for line, shift in zip(found.lines, s, strict=True) for t in line.tipping
    }
    assert len(tips) == 2
    # Along the second parameter too: the folds are at r + s = +-FOLD, one of them for r = +-0.3.
    across = [(value, t) for value, column in zip(r, found.tipping, strict=True) for t in column]
    assert sorted((value, t.kind) for value, t in across) == [(-0.3, "born"), (0.3, "dies")]
    for value, t in across:
        assert t.low <= np.sign(value) * FOLD - value <= t.high < t.low + 1e-3
    assert found.plot().get_ylabel() == "s"
    dataset = found.to_xarray()
    np.testing.assert_array_equal(dataset["share"], found.fractions)


def test_around_a_cusp_one_attractor_goes_on_in_two() -> None:
    """x' = r + s x - x^3: one for s < 0, two between the folds beyond; no point has one number twice."""

    def cusp(t, x, r, s):  # type: ignore[no-untyped-def]
        return (r + s * x - x * x * x,)

    system = fm.System(cusp, ["x"], {"r": 0.0, "s": 0.0})
    r, s = np.array([-0.4, 0.0, 0.2]), np.array([-0.6, 1.0])
    found = fm.follow_basins(system, "r", r, {"x": (-2.0, 2.0)}, 60, each={"s": s})
    there = np.isfinite(found.fractions)
    number = [[int((np.roots([-1.0, 0.0, b, a]).imag == 0.0).sum() + 1) // 2 for a in r] for b in s]
    np.testing.assert_array_equal(there.sum(axis=2), number)
    assert there.shape[2] == 2


@pytest.mark.parametrize(
    ("each", "told"),
    [
        ({"q": [0.0, 1.0]}, "each = 'q'"),
        ({"r": [0.0, 1.0]}, "each = "),
        ({"s": [0.0]}, "each.s: "),
        (3, "each = 3"),
    ],
)
def test_a_wrong_second_parameter_gets_one_line(each: object, told: str) -> None:
    system = fm.System(shifted, ["x"], {"r": 0.0, "s": 0.0})
    with pytest.raises(fm.InputError, match=f"^{told}"):
        fm.follow_basins(system, "r", [0.0, 0.1], {"x": (-1.0, 1.0)}, each=each)  # type: ignore[arg-type]


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


def test_a_value_that_is_not_finite_and_a_system_without_parameters_get_one_line() -> None:
    system = fm.System(two_wells, ["x"], {"r": 0.0})
    with pytest.raises(fm.InputError, match=r"^values\[1\] = nan: must be finite$"):
        fm.follow_basins(system, "r", [0.2, math.nan], {"x": (-1.0, 1.0)})
    alone = fm.System(lambda t, x: (-x,), ["x"], {})
    with pytest.raises(fm.InputError, match=r"^parameter = 'q': the system has no parameters$"):
        fm.follow_basins(alone, "q", [0.2, 0.3], {"x": (-1.0, 1.0)})


@pytest.mark.slow
def test_a_place_of_rest_ends_where_it_turns_unstable() -> None:
    """r' = m r + r^3 - r^5: the cycle is born at m = -1/4, the place of rest loses its stability at 0."""

    def bautin(t, x, y, m):  # type: ignore[no-untyped-def]
        r2 = x * x + y * y
        g = m + r2 - r2 * r2
        return g * x - y, g * y + x

    system = fm.System(bautin, ["x", "y"], {"m": 0.0})
    found = fm.follow_basins(system, "m", [-0.4, -0.1, 0.1], {"x": (-1.5, 1.5), "y": (-1.5, 1.5)}, 60)
    ends = {t.kind: t for t in found.tipping}
    assert ends["born"].low <= -0.25 <= ends["born"].high
    assert ends["dies"].low <= 0.0 <= ends["dies"].high
    assert all(t.high - t.low < 2e-4 for t in found.tipping)


@pytest.mark.parametrize("values", [(-0.9, 1.1), (1.1, -0.9)])
def test_a_place_of_rest_that_splits_into_two_is_born_once(values: tuple[float, float]) -> None:
    def pitchfork(t, x, m):  # type: ignore[no-untyped-def]
        return (m * x - x * x * x,)

    system = fm.System(pitchfork, ("x",), {"m": 0.0})
    found = fm.follow_basins(system, "m", np.linspace(*values, 5), {"x": (-1.0, 1.0)}, 100)
    (tip,) = found.tipping  # at zero, where x = sqrt(m) begins
    assert tip.kind == ("born" if values[0] < values[1] else "dies")
    assert -1e-3 < tip.low < tip.high < 1e-3
    for m, there in zip(found.values, found.attractors, strict=True):
        places = sorted(float(one.points[0, 0]) for one in there.values())
        expected = [-math.sqrt(m), math.sqrt(m)] if m > 0.0 else [0.0]
        assert places == pytest.approx(expected, abs=1e-9)


def test_tipping_probabilities_of_what_holds_the_labels() -> None:
    """x' = r + x - x^3 from -1.8 to 1.8: at r = 0 both basins are halves, beyond the fold one is left."""
    starts = {"x": np.linspace(-1.8, 1.8, 10)}
    maps = [fm.map_basins(fm.System(two_wells, ["x"], {"r": r}), starts) for r in (0.0, 1.5 * FOLD)]
    np.testing.assert_allclose(fm.tipping_probabilities(*maps), [[1.0, 0.0], [1.0, 0.0]])
