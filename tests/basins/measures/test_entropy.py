from __future__ import annotations

import numpy as np
import pytest
from analytic import newton
from scipy.integrate import quad
from scipy.special import betainc, entr

from fastmech.basins.measures.entropy import (
    basin_entropy,
    fractal_boundary_test,
    smooth_boundary_entropy,
)
from fastmech.errors import InputError

pytestmark = pytest.mark.nojit

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
    assert result.fractal is True  # (2 ln 2 + 0.562 + 2 ln 2)/4 = 0.834 > ln 2


def test_two_labels_never_reach_the_ln_2_criterion() -> None:
    """A checkerboard is as mixed as two labels can be: exactly ln 2, and the criterion cannot tell."""
    board = np.indices((20, 20)).sum(axis=0) % 2
    result = basin_entropy(board, 4)
    assert result.basin == pytest.approx(LN2, abs=1e-15)
    assert result.boundary == pytest.approx(LN2, abs=1e-15)
    assert result.fractal is None
    assert fractal_boundary_test(board, 3.0, balls=100).fractal


def test_three_smooth_stripes_are_not_fractal() -> None:
    labels = np.repeat(np.repeat([0, 1, 2], 9)[None], 28, axis=0)
    labels[14:16, 9:11] = 2  # one box with three labels, so that the criterion could fire
    result = basin_entropy(labels, 4)
    assert result.most_labels == 3
    assert result.fractal is False


def test_a_pure_map_has_no_entropy() -> None:
    result = basin_entropy(np.full((10, 10), 7), 5)
    assert result.basin == 0.0
    assert np.isnan(result.boundary)
    assert result.fractal is None
    assert np.isnan(fractal_boundary_test(np.full((10, 10), 7), 2.0, balls=10).entropy)


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


def test_the_test_for_two_labels_tells_smooth_from_fractal() -> None:
    x = np.linspace(-1, 1, 600)
    smooth = np.where(np.hypot(x[:, None], x) < 0.7, 2, 5)
    result = fractal_boundary_test(smooth, 5.0, balls=30_000)
    assert not result.fractal
    assert abs(result.entropy - result.smooth_value) < 0.02
    two = np.where(newton(600) == 0, 0, 1)
    fractal = fractal_boundary_test(two, 5.0, balls=5000)
    assert fractal.fractal
    assert basin_entropy(two).fractal is None
    assert basin_entropy(newton(600)).fractal is True


def test_wrong_arguments_are_refused() -> None:
    with pytest.raises(InputError, match=r"^labels: no label is known"):
        basin_entropy(np.full((6, 6), -1))
    with pytest.raises(InputError, match=r"^edge = 7: must be an integer not greater than 6"):
        basin_entropy(np.zeros((6, 6), int), 7)
    with pytest.raises(InputError, match=r"^radius = 4: a ball must fit"):
        fractal_boundary_test(np.zeros((6, 6), int), 4.0)
