from __future__ import annotations

import numpy as np
import pytest
from analytic import ANGLES, along, cantor, gaps, koch, newton, rough, round_spots, smooth_map, stripes

from fastmech.basins.measures.slopes import boundary_dimension
from fastmech.errors import InputError

X = np.linspace(-1, 1, 400)
SMOOTH = {
    "along an axis": X[:, None] + 0 * X > 0.013,
    "inclined": X[:, None] + 0.37 * X > 0.1,
    "circle": X[:, None] ** 2 + X**2 < 0.5,
    "ellipse": X[:, None] ** 2 + 4 * X**2 < 0.5,
    "wave": 0.3 * np.sin(5 * X[:, None]) < X,
}


@pytest.mark.parametrize("inside", SMOOTH.values(), ids=SMOOTH)
def test_smooth_boundaries_have_dimension_one_within_their_error_bar(inside: np.ndarray) -> None:
    result = boundary_dimension(np.where(inside, 5, 2))
    assert result.smooth
    assert abs(result.dimension - 1.0) < 0.005
    assert np.abs(result.local_dimensions - 1.0).max() < 0.02


def test_a_sphere_has_dimension_two() -> None:
    x = np.linspace(-1, 1, 64)
    inside = x[:, None, None] ** 2 + x[:, None] ** 2 + x**2 < 0.5
    result = boundary_dimension(inside.astype(int), [1, 2, 4])
    assert abs(result.dimension - 2.0) < 0.05
    assert result.smooth


def test_a_cantor_set_has_their_known_dimension() -> None:
    """A row of points in the middle of 3^-11 cells; edges by factors of 3 show the set's similarity."""
    x = (np.arange(3**11) + 0.5) / 3**11
    result = boundary_dimension(cantor(x[:, None]), [27, 81, 243, 729, 2187])
    assert abs(result.dimension - np.log(2) / np.log(3)) <= result.error < 0.1
    assert not result.smooth


def test_newton_s_boundary_is_fractal() -> None:
    result = boundary_dimension(newton(500))
    assert not result.smooth
    assert result.dimension - result.error > 1.3


def test_missing_labels_make_no_boundary() -> None:
    labels = np.where(SMOOTH["circle"], 0, 1)
    labels[np.random.default_rng(0).random(labels.shape) < 0.02] = -1
    assert abs(boundary_dimension(labels, [4, 8, 16]).dimension - 1.0) < 0.05
    assert np.isnan(boundary_dimension(np.where(labels == 0, 0, -1)).dimension)


def known_dimensions() -> list[tuple[str, float, np.ndarray]]:
    """Names, dimensions and maps of 4 to 9 sizes of boxes."""
    rng = np.random.default_rng(2)
    maps = [("three colours", 1.0, smooth_map(int(rng.integers(100, 500)), 3, k)) for k in range(40)]
    for angle in ANGLES:
        for power in (0.3, 0.5, 0.7):
            for seed in range(3):
                labels = rough(int(rng.integers(128, 400)), angle, power, seed)
                maps.append((f"Weierstrass {power}", 2.0 - power, labels))
        n = int(rng.integers(200, 500))
        maps += [
            ("straight", 1.0, (along(n, angle, 3.3) > 0.0).astype(int)),
            ("stripes", 1.0, stripes(n, angle, rng.uniform(5, 60), 3)),
            ("spots", 1.0, round_spots(n, rng.uniform(5, 60))),
            ("Koch", np.log(4) / np.log(3), koch(n, angle, rng.uniform(0.5, 0.85))),
        ]
        for ratio in (0.2, 0.25, 1 / 3, 0.4, 0.45):
            labels = gaps(along(n, angle) / (0.9 * n) + 0.5, ratio) % 2
            maps.append((f"Cantor {ratio:.2f}", 1.0 + np.log(2) / np.log(1 / ratio), labels))
    return maps


@pytest.mark.slow
def test_error_bars_cover_known_dimensions() -> None:
    """Of all maps nine in ten, of every kind four in five; and they are no wider than need be."""
    covered: dict[str, list[bool]] = {}
    width: dict[str, list[float]] = {}
    for name, true, labels in known_dimensions():
        result = boundary_dimension(labels)
        covered.setdefault(name, []).append(abs(result.dimension - true) <= result.error)
        width.setdefault(name, []).append(result.error)
        assert not (result.smooth is False and true == 1.0)
        assert not (result.smooth and true > 1.2)
    assert np.mean(np.concatenate(list(covered.values()))) >= 0.9
    assert min(np.mean(kind) for kind in covered.values()) >= 0.8
    assert np.median(width["three colours"]) < 0.12
    assert np.median(width["Koch"]) < 0.2


@pytest.mark.parametrize("angle", ANGLES)
def test_stripes_two_steps_wide_are_not_called_fractal(angle: float) -> None:
    result = boundary_dimension(stripes(200, angle, 2, 3))
    assert result.smooth is None


def test_wrong_edges_are_refused() -> None:
    with pytest.raises(InputError, match=r"^edges: must rise from 1 or more to at most a quarter of 40"):
        boundary_dimension(np.zeros((40, 40), int), [1, 2, 11])
    with pytest.raises(InputError, match=r"^edges: must be three or more integers"):
        boundary_dimension(np.zeros((40, 40), int), [1, 2])
    with pytest.raises(InputError, match=r"^labels: has shape \(20, 20\); without edges, 32 points"):
        boundary_dimension(np.zeros((20, 20), int))
