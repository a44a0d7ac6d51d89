from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from analytic import ANGLES, along, duffing, gaps, koch, newton, round_spots, smooth_map, stripes
from scipy.integrate import quad
from scipy.special import betainc, entr

from fastmech.basins.measures.entropy import (
    basin_entropy,
    fractal_boundary_test,
    smooth_boundary_entropy,
)
from fastmech.basins.measures.wada import wada_merge_test
from fastmech.errors import InputError

LN2 = np.log(2.0)


def binary(p: float) -> float:
    return float(entr(p) + entr(1.0 - p))


def test_maps_done_by_hand() -> None:
    """Boxes of 2 x 2: pure, halves, three of four, four different, two and two."""
    labels = np.array(
        [
            [3, 3, 3, 8, 3, 3, 3, 8, 8, 3, 99],
            [3, 3, 3, 8, 3, 8, 20, 41, 3, 8, 99],
        ]
    )
    result = basin_entropy(labels, 2)
    quarter = binary(0.25)
    assert (result.boxes, result.boundary_boxes, result.most_labels) == (5, 4, 4)
    assert result.basin == pytest.approx((3 * LN2 - LN2 + quarter + np.log(4)) / 5, abs=1e-15)
    assert result.boundary == pytest.approx((2 * LN2 + quarter + np.log(4)) / 4, abs=1e-15)
    assert result.boundary > LN2  # (2 ln 2 + 0.562 + 2 ln 2)/4 = 0.834
    assert result.fractal is None  # so few boxes do not show that the boundary is no smooth one


def test_two_labels_never_reach_the_ln_2_criterion() -> None:
    """A checkerboard is as mixed as two labels can be: exactly ln 2, and the criterion cannot tell."""
    board = np.indices((20, 20)).sum(axis=0) % 2
    result = basin_entropy(board, 4)
    assert result.basin == pytest.approx(LN2, abs=1e-15)
    assert result.boundary == pytest.approx(LN2, abs=1e-15)
    assert result.fractal is None


def test_three_smooth_stripes_are_not_fractal() -> None:
    labels = np.repeat(np.repeat([0, 1, 2], 9)[None], 28, axis=0)
    labels[14:16, 9:11] = 2  # one box with three labels, so that the criterion could fire
    result = basin_entropy(labels, 4)
    assert result.most_labels == 3
    assert result.fractal is None  # the criterion shows no boundary to be smooth


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("width", [1.0, 2.0, 3.0, 4.0, 6.0])
def test_straight_boundaries_are_neither_fractal_nor_one(angle: float, width: float) -> None:
    """Stripes of three labels and of uneven widths, in boxes that hold several of them, and checkerboards."""
    for seed in range(3):
        edges = np.cumsum(np.random.default_rng(seed).uniform(0.5, 1.5, 2000)) * width
        labels = np.searchsorted(edges - edges[-1] / 2, along(300, angle)) % 3
        assert not basin_entropy(labels).fractal
        assert not wada_merge_test(labels).wada
    board = sum(np.floor(along(300, angle + turn) / width).astype(int) for turn in (0.0, np.pi / 2)) % 3
    assert not basin_entropy(board).fractal
    assert not wada_merge_test(board).wada


def test_a_pure_map_has_no_entropy() -> None:
    result = basin_entropy(np.full((10, 10), 7), 5)
    assert result.basin == 0.0
    assert np.isnan(result.boundary)
    assert result.fractal is None
    test = fractal_boundary_test(np.full((40, 40), 7), balls=10)
    assert np.isnan(test.entropy).all()
    assert test.fractal is None
    assert test.reason.startswith("there is no boundary")


def test_missing_labels_have_no_share() -> None:
    labels = np.array([[0, -1, -1, -1], [0, 1, -1, -1]])
    result = basin_entropy(labels, 2)
    assert result.boxes == 1
    assert result.basin == pytest.approx(binary(1 / 3), abs=1e-15)


def test_boxes_of_one_and_three_axes() -> None:
    assert basin_entropy([0, 0, 0, 1], 2).basin == pytest.approx(LN2 / 2, abs=1e-15)
    cube = np.zeros((2, 2, 2), dtype=int)
    cube[0, 0, 0] = 1
    assert basin_entropy(cube, 2).basin == pytest.approx(binary(1 / 8), abs=1e-15)


@pytest.mark.parametrize(("dim", "radius", "near"), [(2, 60.0, 0.002), (3, 14.0, 0.005)])
def test_smooth_boundaries_have_the_known_entropy(dim: int, radius: float, near: float) -> None:
    """The share that a plane cuts off a ball is an incomplete beta function of its distance."""
    true = quad(lambda s: binary(0.5 * betainc((dim + 1) / 2, 0.5, 1 - s * s)), 0, 1)[0]
    if dim == 2:
        assert true == pytest.approx(0.4395093, abs=1e-7)  # printed by Puy et al. 2021
    assert abs(smooth_boundary_entropy(dim, radius) - true) < near


#: Straight and round boundaries, eight steps apart or more.
SMOOTH = (
    [
        (f"stripes of {w}, {k}, {a:.1f}", stripes(256, a, w, k))
        for w in (8, 13, 30)
        for k in (2, 3)
        for a in ANGLES
    ]
    + [(f"one straight line, {a:.1f}", (along(256, a, 3.3) > 0.0).astype(int)) for a in ANGLES]
    + [
        (f"one stripe of {w}, {a:.1f}", (np.abs(along(256, a)) < w / 2).astype(int))
        for w in (8, 20)
        for a in ANGLES
    ]
    + [(f"spots of {radius}", round_spots(256, radius)) for radius in (5.0, 8.0, 20.0, 60.0)]
    + [(f"{k} labels, {seed}", smooth_map(256, k, seed)) for k in (2, 3, 5) for seed in range(3)]
)


@pytest.mark.parametrize("labels", [labels for _, labels in SMOOTH], ids=[name for name, _ in SMOOTH])
def test_smooth_boundaries_are_not_fractal(labels: np.ndarray) -> None:
    result = fractal_boundary_test(labels, balls=2000)
    assert result.fractal is False, result.reason
    assert result.boxes.smooth is not False


NARROW = [(w, k, a) for w in (1, 1.5, 2, 3, 4, 5, 6) for k in (2, 3) for a in ANGLES]


@pytest.mark.parametrize(("width", "labels", "angle"), NARROW)
@pytest.mark.slow
def test_stripes_as_narrow_as_the_map_s_steps_are_never_fractal(
    width: float, labels: int, angle: float
) -> None:
    for picture in (stripes(200, angle, width, labels), (np.abs(along(200, angle)) < width / 2).astype(int)):
        result = fractal_boundary_test(picture, balls=2000)
        assert not result.fractal
        assert result.fractal is False or "finer map" in result.reason or "too few" in result.reason


@pytest.mark.parametrize("width", [1.0, 2.0, 3.0])
def test_a_band_too_thin_for_the_map_tells_nothing_about_its_boundaries(width: float) -> None:
    """Two straight lines so near to each other, in twelve directions: neither fractal, nor one boundary."""
    for angle in np.deg2rad(np.arange(0.0, 180.0, 15.0)):
        across = along(201, float(angle))
        band = np.where(across < -width / 2, 0, np.where(across < width / 2, 1, 2))
        result = fractal_boundary_test(band, balls=2000)
        assert result.fractal is None
        assert result.boxes.smooth is None
        assert not wada_merge_test(band).wada


#: Pictures that are made by their test.
FRACTAL: dict[str, Callable[[], Any]] = {
    "Newton's three": lambda: newton(400),
    "Newton's three, another window": lambda: newton(300, 0.3, 0.6, 0.2),
    "Newton's, one against two": lambda: np.minimum(newton(400), 1),
    "Koch's snowflake": lambda: koch(400, 0.2),
    "Koch's snowflake, turned and smaller": lambda: koch(300, 0.5, 0.6),
    "stripes on the Cantor set": lambda: gaps(along(400, 0.3) / 360 + 0.5) % 2,
    "stripes on another Cantor set": lambda: gaps(along(400, 1.1) / 360 + 0.5, 0.25) % 2,
    "stripes on a third, of three labels": lambda: gaps(along(400, 2.0) / 360 + 0.5, 0.4) % 3,
    "Duffing's two wells": lambda: duffing(160),
}


@pytest.mark.parametrize("name", FRACTAL)
def test_fractal_boundaries_are_fractal(name: str) -> None:
    result = fractal_boundary_test(FRACTAL[name](), balls=5000)
    assert result.fractal is True, result.reason
    assert result.boxes.smooth is False


def test_stripes_that_shrink_geometrically_are_not_settled() -> None:
    """x = r^k, and xy = c beside a saddle: the share of boxes is e ln(1/e), its power 1 - 1/ln(1/e)."""
    for angle in (0.3, 2.0):
        x, y = (along(512, a) / 512.0 + 1e-9 for a in (angle, angle + np.pi / 2))
        for levels in (
            np.log(np.abs(x)) / np.log(0.5),
            np.log(np.abs(x)) / np.log(0.7),
            np.log(np.abs(x * y)) / 0.8,
        ):
            result = fractal_boundary_test(np.floor(levels).astype(int) % 2, balls=2000)
            assert result.fractal is None, result.reason
            assert "not settled" in result.reason
            assert result.boxes.smooth is None


def test_a_map_finer_than_its_points_is_undecided() -> None:
    for labels in (
        np.indices((200, 200)).sum(axis=0) % 2,
        np.random.default_rng(0).integers(0, 3, (200, 200)),
    ):
        result = fractal_boundary_test(labels, balls=2000)
        assert result.fractal is None
        assert "% of the finest boxes: a finer map can tell" in result.reason


def test_balls_on_a_smooth_boundary_have_its_entropy() -> None:
    """A circle has all directions alike, as the value to compare with."""
    x = np.linspace(-1, 1, 600)
    result = fractal_boundary_test(np.where(np.hypot(x[:, None], x) < 0.7, 2, 5), balls=30_000)
    assert result.radius.tolist() == [4.0, 8.0, 16.0]
    np.testing.assert_allclose(result.entropy, result.smooth_value, atol=0.03)
    assert (np.abs(result.entropy - result.smooth_value) < result.error + 0.01).all()
    assert basin_entropy(np.minimum(newton(600), 1)).fractal is None
    assert basin_entropy(newton(600)).fractal is True


def test_wrong_arguments_are_refused() -> None:
    with pytest.raises(InputError, match=r"^labels: no label is known"):
        basin_entropy(np.full((6, 6), -1))
    with pytest.raises(InputError, match=r"^edge = 7: must be an integer not greater than 6"):
        basin_entropy(np.zeros((6, 6), int), 7)
    with pytest.raises(InputError, match=r"^labels: has shape \(6, 6\), must have two or more axes of 36"):
        fractal_boundary_test(np.zeros((6, 6), int))
    for radii in ([1.0, 4.0], [8.0, 4.0], [4.0, 20.0]):
        with pytest.raises(InputError, match=r"^radii: must rise from 2 or more, and the balls fit the map"):
            fractal_boundary_test(np.zeros((40, 40), int), radii)
