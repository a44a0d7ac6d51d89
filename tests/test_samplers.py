"""Samplers: ranges, prefixes, seeds."""

from __future__ import annotations

import numpy as np
import pytest

import fastmech as fm
from fastmech.ensembles.checks import starts
from fastmech.samplers import Ball, Gaussian, Grid, LatinHypercube, Sampler, Sobol, Uniform

pytestmark = pytest.mark.nojit

NAMES = ("x", "y", "z")
RANGES = {"x": (-1.0, 3.0), "z": 0.5}
KINDS = [Uniform, Sobol, LatinHypercube, Gaussian, Ball]


@pytest.mark.parametrize("kind", KINDS)
def test_the_first_starts_are_the_same_for_every_number(kind: type[Sampler]) -> None:
    sampler = kind({**RANGES, "y": (0.0, 2.0)})
    many = sampler.draw(4096, NAMES, 7)
    np.testing.assert_array_equal(sampler.draw(100, NAMES, 7), many[:100])
    assert not np.array_equal(sampler.draw(100, NAMES, 8), many[:100])
    assert np.all(many[:, 2] == 0.5)
    if kind is not Gaussian:
        assert many[:, 0].min() >= -1.0
        assert many[:, 0].max() <= 3.0
    assert many[:, 0].mean() == pytest.approx(1.0, abs=0.12)


def test_a_ball_is_filled_evenly() -> None:
    """Half of a disk's area lies within radius sqrt(1/2)."""
    z = Ball({"x": (-2.0, 2.0), "y": (0.0, 1.0)}).draw(20_000, ("x", "y"))
    radius = np.hypot(z[:, 0] / 2.0, (z[:, 1] - 0.5) / 0.5)
    assert radius.max() <= 1.0
    assert np.mean(radius < np.sqrt(0.5)) == pytest.approx(0.5, abs=0.015)
    half = Ball({"x": (-2.0, 2.0), "y": (0.0, 1.0)}, radius=0.5).draw(20_000, ("x", "y"))
    np.testing.assert_allclose(half - [0.0, 0.5], 0.5 * (z - [0.0, 0.5]), atol=1e-15)


def test_a_ball_in_a_norm_is_filled_evenly() -> None:
    """Departures d with |d N| <= r, of which half of the area lies within r sqrt(1/2)."""
    norm = np.array([[2.0, 0.5], [0.0, 1.0]])
    ball = Ball({"x": 1.0, "y": (2.0, 4.0)}, norm=norm, radius=0.2)
    size = np.linalg.norm((ball.draw(20_000, ("x", "y")) - [1.0, 3.0]) @ norm, axis=1)
    assert 0.199 < size.max() <= 0.2 + 1e-12
    assert np.mean(size < 0.2 * np.sqrt(0.5)) == pytest.approx(0.5, abs=0.015)
    for wrong in (np.eye(3), np.ones((2, 2)), "a", [[np.nan, 0.0], [0.0, 1.0]]):
        with pytest.raises(fm.InputError, match=r"^norm = .*: must be a matrix \(2, 2\), not singular"):
            Ball({"x": 1.0}, norm=wrong).draw(3, ("x", "y"))
    with pytest.raises(fm.InputError, match=r"radius = 0\.0: must be"):
        Ball({"x": 1.0}, norm=norm, radius=0.0)
    with pytest.raises(fm.InputError, match=r"seed = -1: must be"):
        Sobol({"x": (0.0, 1.0)}, seed=-1)


def test_every_doubled_hypercube_has_a_point_in_every_slice() -> None:
    """Qian's nested designs; and states are independent of each other."""
    drawn = LatinHypercube({"x": (0.0, 1.0), "y": (0.0, 1.0)}).draw(5000, ("x", "y"))
    assert drawn.shape == (5000, 2)
    for n in 2 ** np.arange(13):
        for column in drawn[:n].T:
            np.testing.assert_array_equal(np.sort(np.floor(column * n)), np.arange(n))
    assert abs(np.corrcoef(drawn[:4096].T)[0, 1]) < 0.05
    assert abs(np.corrcoef((drawn[:4096].T * 2.0) % 1.0)[0, 1]) < 0.05


def test_checked_starts_know_their_number_and_seed() -> None:
    sampler = Sobol({"x": (0.0, 2.0)}, n=8, seed=3)
    np.testing.assert_array_equal(starts("y0", sampler, NAMES), sampler.draw(8, NAMES, 3))
    np.testing.assert_array_equal(starts("y0", sampler, NAMES, n=2, seed=4), sampler.draw(2, NAMES, 4))
    np.testing.assert_array_equal(starts("y0", sampler, NAMES), sampler.draw(8, NAMES))
    assert (sampler.draw(8, NAMES) != Sobol({"x": (0.0, 2.0)}).draw(8, NAMES)).any()
    assert len(starts("y0", Grid({"x": (0.0, 1.0)}, {"x": 5}), NAMES)) == 5
    assert len(starts("y0", {"x": (0.0, 1.0)}, NAMES, default=7)) == 7
    np.testing.assert_array_equal(starts("y0", np.eye(3), NAMES, n=2), np.eye(3)[:2])
    with pytest.raises(fm.InputError, match=r"^y0: how many starts\? such as fastmech.samplers.Uniform"):
        starts("y0", {"x": (0.0, 1.0)}, NAMES)
    with pytest.raises(fm.InputError, match=r"^n = 0: must be an integer not less than 1$"):
        starts("y0", Uniform({"x": (0.0, 1.0)}, n=0), NAMES)
    with pytest.raises(fm.InputError, match=r"^seed = -1: must be"):
        starts("y0", Uniform({"x": (0.0, 1.0)}, n=1, seed=-1), NAMES)


def test_a_grid_holds_its_ends() -> None:
    grid = Grid({"x": (0.0, 1.0), "z": (2.0, 4.0), "y": 9.0}, {"x": 2, "z": 3})
    expected = [[0, 9, 2], [0, 9, 3], [0, 9, 4], [1, 9, 2], [1, 9, 3], [1, 9, 4]]
    np.testing.assert_array_equal(grid.draw(6, NAMES), expected)
    with pytest.raises(fm.InputError, match="counts"):
        grid.draw(7, NAMES)
    with pytest.raises(fm.InputError, match="counts"):
        Grid({"x": (0.0, 1.0)}, {}).draw(1, NAMES)
    for wrong in ({"x": 1}, {"x": 2.5}, [2], None):
        with pytest.raises(fm.InputError, match=r"^counts = .*: must map names to integers of 2 or more$"):
            Grid({"x": (0.0, 1.0)}, wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "ranges", [{"w": (0.0, 1.0)}, {"x": (1.0, 0.0)}, {"x": "a"}, {"x": (0.0, np.nan)}, {"x": (1, 2, 3)}, 3]
)
def test_wrong_ranges_get_one_line(ranges: object) -> None:
    with pytest.raises(fm.InputError, match="ranges"):
        Uniform(ranges).draw(3, NAMES)  # type: ignore[arg-type]
