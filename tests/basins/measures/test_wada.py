from __future__ import annotations

import numpy as np
import pytest
from analytic import newton
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


@pytest.mark.nojit
def test_stripes_done_by_hand() -> None:
    """Boundaries of 5, 2 and 9 against the rest: columns 3|4 and 7|8."""
    labels = np.repeat(np.repeat([5, 2, 9], 4)[None], 6, axis=0)
    result = wada_merge_test(labels, 3)
    assert result.labels.tolist() == [2, 5, 9]
    # That of 2 has both lines, columns 3, 4, 7, 8; column 8 is 4 from that of 5, which is columns 3, 4.
    np.testing.assert_array_equal(result.distance, [[0, 4, 4], [0, 0, 4], [0, 4, 0]])
    np.testing.assert_array_equal(result.far_share, [[0, 0.25, 0.25], [0, 0, 0.5], [0, 0.5, 0]])
    assert result.boundary_points.tolist() == [24, 12, 12]
    assert result.least_fattening == 4
    assert not result.wada
    assert wada_merge_test(labels, 4).wada  # fattened beyond the stripes everything is near everything


@pytest.mark.nojit
def test_missing_labels_make_no_boundary() -> None:
    labels = np.array([[0, -1, 1, 1], [0, -1, 1, 1], [0, -1, 1, 2]])
    result = wada_merge_test(labels)
    assert result.boundary_points.tolist() == [0, 3, 3]
    assert result.missing == 3
    assert np.isinf(result.least_fattening)
    assert not result.wada


@pytest.mark.nojit
def test_two_labels_are_never_wada() -> None:
    result = wada_merge_test(np.indices((8, 8)).sum(axis=0) % 2 * 4)
    assert result.least_fattening == 0
    assert not result.wada


@pytest.mark.nojit
def test_labels_may_have_any_numbers() -> None:
    labels = newton(200)
    renamed = np.where(labels < 0, -7, np.array([40, 3, 11])[labels])
    first, second = wada_merge_test(labels), wada_merge_test(renamed)
    order = [1, 2, 0]  # of 3, 11, 40 among the first names
    np.testing.assert_array_equal(second.distance, first.distance[np.ix_(order, order)])


@pytest.mark.nojit
@pytest.mark.parametrize("n", [300, 600])
def test_newton_s_basins_are_wada_at_every_resolution(n: int) -> None:
    """The boundary of each basin of a rational map is its Julia set: one set for all three."""
    assert wada_merge_test(newton(n)).wada


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


@pytest.mark.nojit
def test_wrong_arguments_are_refused() -> None:
    with pytest.raises(InputError, match=r"^fattening = -1: must be an integer not less than 0"):
        wada_merge_test([[0, 1], [1, 0]], -1)
