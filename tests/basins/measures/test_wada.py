from __future__ import annotations

import numpy as np
import pytest
from analytic import ANGLES, along, gaps, newton, smooth_map, stripes
from own_ends import ends

import fastmech as fm
from fastmech.basins.measures.labels import number_turns
from fastmech.basins.measures.wada import wada_merge_test
from fastmech.errors import InputError


def henon_heiles(t, x, y, vx, vy):
    return vx, vy, -x - 2.0 * x * y, -y - x * x + y * y


def way_out(t, x, y, vx, vy):
    """Which of the three exits it has gone through: up, or down on the left or the right."""
    return 0.0 if x * x + y * y < 25.0 else (1.0 if y > 0.5 * abs(x) else (2.0 if x < 0.0 else 3.0))


def test_stripes_done_by_hand() -> None:
    """Boundaries of 5, 2 and 9 against the rest: between columns 3 and 4, and 7 and 8, 4 steps apart."""
    labels = np.repeat(np.repeat([5, 2, 9], 4)[None], 6, axis=0)
    result = wada_merge_test(labels, 3)
    assert result.labels.tolist() == [2, 5, 9]
    np.testing.assert_array_equal(result.distance, [[0, 4, 4], [0, 0, 4], [0, 4, 0]])
    np.testing.assert_array_equal(result.far_share, [[0, 0.5, 0.5], [0, 0, 1], [0, 1, 0]])
    assert result.boundary_points.tolist() == [12, 6, 6]
    assert result.least_fattening == 4
    # On every 4th point a stripe is a single one: still 4 steps. Mean distances: half of the places, and all.
    np.testing.assert_array_equal(result.apart, [4, 4, 4])
    assert result.wada is False
    assert wada_merge_test(labels, 4).wada is False  # however much they are fattened


def test_missing_labels_make_no_boundary() -> None:
    labels = np.array([[0, -1, 1, 1], [0, -1, 1, 1], [0, -1, 1, 2]])
    result = wada_merge_test(labels)
    assert result.boundary_points.tolist() == [0, 2, 2]
    assert result.missing == 3
    assert np.isinf(result.least_fattening)
    assert not result.wada


def test_two_labels_are_never_wada() -> None:
    result = wada_merge_test(np.indices((8, 8)).sum(axis=0) % 2 * 4)
    assert result.least_fattening == 0
    assert not result.wada


def test_labels_may_have_any_numbers() -> None:
    labels = newton(200)
    renamed = np.where(labels < 0, -7, np.array([40, 3, 11])[labels])
    first, second = wada_merge_test(labels), wada_merge_test(renamed)
    order = [1, 2, 0]  # of 3, 11, 40 among the first names
    np.testing.assert_array_equal(second.distance, first.distance[np.ix_(order, order)])


@pytest.mark.parametrize("n", [150, 300, 600])
@pytest.mark.parametrize("window", [(0.0, 1.5, 0.0), (0.3, 0.6, 0.2), (2.0, 0.5, 0.4)])
def test_newton_s_basins_are_wada_at_every_resolution(n: int, window: tuple) -> None:
    """The boundary of each basin of a rational map is its Julia set: one set for all three."""
    result = wada_merge_test(newton(n, *window), 6)
    assert result.wada is True, result.reason


def test_gaps_of_a_cantor_set_in_three_colours_are_wada() -> None:
    """Every point of the set is a limit of gaps of all orders."""
    for angle in (0.3, 1.2, 2.5):
        result = wada_merge_test(gaps(along(400, angle) / 360 + 0.5) % 3, 6)
        assert result.wada is True, result.reason
    for n in (200, 300, 400, 500):  # along an axis all rows are the same: too few points, but never apart
        assert wada_merge_test(gaps(along(n, 0.0) / (0.9 * n) + 0.5) % 3, 6).wada is not False


@pytest.mark.parametrize("width", [2, 2.5, 3, 5, 12])
@pytest.mark.parametrize("angle", ANGLES)
def test_touching_bands_are_not_wada(width: float, angle: float) -> None:
    for fattening in (5, 50):
        result = wada_merge_test(stripes(240, angle, width, 3), fattening)
        assert not result.wada
        if width > 2.5:
            assert result.wada is False
            assert result.reason.startswith("boundaries lie apart")


def test_smooth_maps_are_not_wada_and_what_is_finer_than_points_is_undecided() -> None:
    for seed in range(4):
        assert wada_merge_test(smooth_map(200, 3, seed), 200).wada is False
    for labels in (
        stripes(200, 0.0, 1, 3),
        stripes(200, 0.3, 1, 3),
        np.random.default_rng(0).integers(0, 3, (200, 200)),
    ):
        result = wada_merge_test(labels)
        assert result.wada is None
        assert "a finer map can tell" in result.reason


@pytest.mark.parametrize("n", [150, 300])
def test_exits_of_henon_heiles_are_wada(n: int) -> None:
    """At x = 0, energy 0.25 > 1/6: Aguirre, Vallejo, Sanjuan, Phys. Rev. E 64 (2001) 066208."""
    y, vy = np.meshgrid(np.linspace(-0.6, 0.9, n), np.linspace(-0.7, 0.7, n), indexing="ij")
    square = 2.0 * (0.25 - 0.5 * y**2 + y**3 / 3.0) - vy**2
    possible = square >= 0.0
    starts = np.stack([0.0 * y, y, np.sqrt(np.maximum(square, 0.0)), vy], axis=-1)[possible]
    system = fm.System(henon_heiles, ["x", "y", "vx", "vy"], {}, stop=way_out)
    run = fm.integrate(system, starts, 200.0, 0.05)
    assert run.stop_code is not None
    labels = np.full(y.shape, -1)
    labels[possible] = np.where(run.stop_code > 0, run.stop_code, -1)
    result = wada_merge_test(labels)
    assert result.labels.tolist() == [1, 2, 3]
    assert result.wada


def test_the_mechanism_s_basins_are_not_wada() -> None:
    """Rest starts at Table 1 under the constant force: turns are the labels, manifolds the borders."""
    scene = fm.Scene(alpha=0.0)
    phi, theta = np.meshgrid(np.linspace(-4, 4, 48), np.linspace(-6, 6, 48), indexing="ij")
    starts = np.stack([phi, theta, 0 * phi, 0 * phi], axis=-1).reshape(-1, 4)
    label, turns, _ = ends(scene, starts, 40.0)
    numbered, _ = number_turns(label, turns)
    result = wada_merge_test(numbered.reshape(phi.shape))
    assert len(result.labels) >= 3
    assert result.missing < 0.02 * phi.size
    assert not result.wada
    assert result.least_fattening > 15


def test_wrong_arguments_are_refused() -> None:
    with pytest.raises(InputError, match=r"^fattening = -1: must be an integer not less than 0"):
        wada_merge_test([[0, 1], [1, 0]], -1)
