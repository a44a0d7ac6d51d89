from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.distance import cdist

import fastmech as fm
from fastmech.basins.measures.integrity import integrity
from fastmech.disturbance.motion import size_at
from fastmech.errors import InputError


def test_a_map_done_by_hand() -> None:
    labels = [
        [0, 0, 0, 0, 0, 1, 1],
        [0, 0, 0, 0, 0, 0, 1],
        [0, 0, 0, 0, 0, 0, 0],
        [0, 0, 0, 0, 0, 0, 0],
        [0, 0, 0, 0, 0, -1, 0],
        [2, 0, 0, 0, 0, 0, 0],
        [0, 0, 0, 0, 0, 0, 0],
    ]
    result = integrity(labels, [range(7), range(7)], 0, [4.0, 4.0], np.eye(2))
    assert result.gim == 44 / 49
    assert (result.lim, result.lim_at_window) == (1.0, False)  # the point without label beside it
    # Centres in the middle row and column are 3 from an edge; (3, 3) is sqrt(5) from the missing label,
    # (3, 2) is 2 from the edge and sqrt(8) from the label 2.
    assert result.factor == pytest.approx(np.sqrt(5.0))
    assert result.factor_at_window is False
    assert result.centre.tolist() == [3.0, 3.0]
    assert result.resolution == pytest.approx(np.sqrt(2.0))


def test_points_without_a_label_limit_what_they_could_add() -> None:
    labels = [
        [0, 0, 0, 0, 0, 1, 1],
        [0, 0, 0, 0, 0, 0, 1],
        [0, 0, 0, 0, 0, 0, 0],
        [0, 0, 0, 0, 0, 0, 0],
        [0, 0, 0, 0, 0, -1, 0],
        [2, 0, 0, 0, 0, -3, 0],
        [0, 0, 0, 0, 0, 0, 0],
    ]
    axes = [range(7), range(7)]
    result = integrity(labels, axes, 0, [4.0, 4.0], np.eye(2))
    assert (result.gim, result.gim_at_most) == (43 / 49, 45 / 49)
    # With the gaps filled the edges are 2 from (4, 4). They are 3 from (3, 3), the nearest labels to that,
    # (0, 5) and (5, 0), sqrt(13).
    assert (result.lim, result.lim_at_most) == (1.0, 2.0)
    assert result.factor == pytest.approx(np.sqrt(5.0))
    assert result.factor_at_most == 3.0
    # About a corner of the window there is no ball; a gap that belonged to the basin 1 would hold one.
    corner = integrity(labels, axes, 1, [0.0, 6.0], np.eye(2))
    assert (corner.lim, corner.lim_at_most, corner.factor, corner.factor_at_most) == (0.0, 0.0, 0.0, 1.0)


def test_a_gap_behind_another_basin_limits_nothing() -> None:
    labels = [[0, 0, 0, 0, 0, 1, -1]] * 5
    result = integrity(labels, [range(5), range(7)], 0, [2.0, 4.0], np.eye(2))
    assert result.gim_at_most > result.gim
    assert (result.lim, result.lim_at_most) == (1.0, 1.0)
    assert (result.factor, result.factor_at_most) == (2.0, 2.0)


def test_an_attractor_in_a_gap_may_have_room() -> None:
    labels = [[1] * 5, [1, -1, -1, -1, 1], [1, -1, -1, -1, 1], [1, -1, -1, -1, 1], [1] * 5]
    result = integrity(labels, [range(5), range(5)], 0, [2.0, 2.0], np.eye(2))
    assert (result.gim, result.lim, result.factor) == (0.0, 0.0, 0.0)
    assert np.isnan(result.centre).all()
    assert (result.gim_at_most, result.lim_at_most, result.factor_at_most) == (9 / 25, 2.0, 2.0)


def test_a_basin_that_fills_the_window_ends_at_its_edge() -> None:
    result = integrity(np.zeros((5, 9), int), [np.linspace(0, 1, 5), np.linspace(0, 2, 9)], 0, [0.5, 0.25],
                       np.eye(2))  # fmt: skip
    assert (result.gim, result.lim, result.factor) == (1.0, 0.25, 0.5)
    assert result.lim_at_window
    assert result.factor_at_window


def test_a_disc_has_its_radius_within_the_map_s_resolution() -> None:
    x = np.linspace(-1, 1, 201)
    labels = np.where(np.hypot(x[:, None] - 0.1, x + 0.2) < 0.6, 3, 8)
    result = integrity(labels, [x, x], 3, [0.3, -0.2], np.eye(2))
    assert -1e-12 < result.lim - 0.4 < result.resolution
    assert -1e-12 < result.factor - 0.6 < result.resolution
    np.testing.assert_allclose(result.centre, [0.1, -0.2], atol=0.02)
    assert abs(result.gim - np.pi * 0.36 / 4.0) < 0.005


def test_a_skew_norm_agrees_with_all_distances() -> None:
    rng = np.random.default_rng(6)
    x, y = np.linspace(-1, 1, 14), np.linspace(0, 3, 11)
    labels = (rng.random((14, 11)) < 0.06).astype(int)
    labels[7, 5] = 0
    norm = np.array([[1.0, 0.8], [0.0, 0.5]])
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    inside = labels.ravel() == 0
    away = cdist(points[inside] @ norm, points[~inside] @ norm).min(axis=1)
    # The window's edge: the least length over a fine row of points along it.
    edge = np.concatenate(
        [np.stack([np.full(4001, s), np.linspace(0, 3, 4001)], 1) for s in (-1, 1)]
        + [np.stack([np.linspace(-1, 1, 4001), np.full(4001, s)], 1) for s in (0, 3)]
    )
    room = np.minimum(away, cdist(points[inside] @ norm, edge @ norm).min(axis=1))
    result = integrity(labels, [x, y], 0, [x[7], y[5]], norm)
    assert result.factor == pytest.approx(room.max(), abs=1e-4)
    here = np.flatnonzero((points[inside] == [x[7], y[5]]).all(axis=1))[0]
    assert result.lim == pytest.approx(room[here], abs=1e-4)


def test_the_ball_round_the_attractor_counts_for_the_factor() -> None:
    """Between the points of a coarse map the attractor may have more room than any point."""
    labels = [[1, 1, 1, 1], [1, 0, 0, 1], [1, 0, 0, 1], [1, 1, 1, 1]]
    result = integrity(labels, [range(4), range(4)], 0, [1.5, 1.5], np.eye(2))
    assert result.lim == result.factor == 1.5
    assert result.lim_at_window


def test_an_empty_basin_has_no_integrity() -> None:
    result = integrity([[1, 1], [1, 1]], [[0, 1], [0, 1]], 0, [0.2, 0.2], np.eye(2))
    assert (result.gim, result.lim, result.factor) == (0.0, 0.0, 0.0)
    assert np.isnan(result.centre).all()


def test_an_attractor_outside_the_window_is_refused() -> None:
    with pytest.raises(InputError, match=r"^attractor = \[2\.0, 0\.0\]: must lie within"):
        integrity([[0, 0], [0, 0]], [[0, 1], [0, 1]], 0, [2.0, 0.0], np.eye(2))


def test_the_default_metric_is_the_kinetic_norm_at_the_well() -> None:
    """On axes by their names, in any order; the distances by the norm's own formula."""
    scene = fm.Scene(alpha=0.0)
    well = fm.find_equilibria(scene)[0]
    axes = {"theta_dot": np.linspace(-3.0, 3.0, 11), "phi": np.linspace(1.0, 2.0, 11)}
    labels = np.zeros((11, 11), dtype=int)
    labels[6, 6] = 1
    result = integrity(labels, axes, 0, well, scene=scene)
    size = size_at(scene, well.phi, well.theta)
    away = float(size(np.array([axes["phi"][6] - well.phi, 0.0, 0.0, axes["theta_dot"][6]])))
    assert result.lim == pytest.approx(away, rel=1e-12)
    assert not result.lim_at_window
    with pytest.raises(fm.InputError, match=r"^norm: missing; by default it is that of an equilibrium"):
        integrity(labels, axes, 0, well)
    with pytest.raises(fm.InputError, match=r"^axes.ph: unknown name; did you mean 'phi'"):
        integrity(labels, {"phi": [0.0, 1.0], "ph": [0.0, 1.0]}, 0, well, scene=scene)
