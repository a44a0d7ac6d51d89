from __future__ import annotations

import numpy as np
import pytest
from analytic import cantor, disc

from fastmech.basins.measures.slopes import fit_counts, uncertainty_exponent
from fastmech.errors import InputError

SCALES = np.geomspace(3e-3, 5e-2, 7)


def test_a_smooth_boundary_has_exponent_one_within_its_error_bar() -> None:
    """Of 100 experiments at most 5 miss."""
    runs = [uncertainty_exponent(disc, [-1, -1], [1, 1], SCALES, n=20_000, seed=seed) for seed in range(100)]
    assert sum(run.smooth is False for run in runs) <= 5
    assert sum(run.smooth is True for run in runs) >= 70
    # An error bar that is merely wide would cover too: it must be that of the scatter, and of its parts.
    exponents = [run.law.exponent for run in runs]
    assert np.mean([run.law.error for run in runs]) < 3.0 * 1.96 * np.std(exponents)
    assert abs(np.mean(exponents) - 1.0) < 0.02
    assert runs[0].dimension == 2.0 - exponents[0]


def test_a_cantor_boundary_has_its_known_exponent() -> None:
    """Scales by factors of 3, at which the Cantor set is similar to itself."""
    scales = 3.0 ** np.arange(-12, -6)
    runs = [uncertainty_exponent(cantor, [0.0], [1.0], scales, n=20_000, seed=seed) for seed in range(40)]
    true = 1.0 - np.log(2) / np.log(3)
    assert sum(abs(run.law.exponent - true) <= run.law.error for run in runs) >= 34
    assert not any(run.smooth for run in runs)
    local = np.array([run.law.local_slopes - true for run in runs])
    inside = np.abs(local) <= [run.law.local_errors for run in runs]
    assert 0.9 < inside.mean() < 0.99
    assert runs[0].dimension == pytest.approx(1.0 - runs[0].law.exponent)


@pytest.mark.parametrize("ratio", [0.1, 0.2, 0.25, 1 / 3, 0.4, 0.45])
def test_error_bars_cover_cantor_sets_at_any_scales(ratio: float) -> None:
    """The law oscillates with period ln(1/ratio), and bends where the distance nears the box."""
    true, covered = 1.0 - np.log(2) / np.log(1 / ratio), []
    for scales in (
        np.geomspace(1e-4, 1e-1, 10), np.geomspace(1e-6, 1e-2, 12), np.geomspace(1e-3, 0.3, 8),
        np.geomspace(1e-3, 1e-2, 6), np.geomspace(1e-5, 1e-1, 5), np.geomspace(1e-4, 1e-1, 25),
    ):  # fmt: skip
        for seed in range(5):
            run = uncertainty_exponent(lambda y: cantor(y, ratio), [0.0], [1.0], scales, n=4096, seed=seed)
            if np.isfinite(run.law.error):
                covered.append(abs(run.law.exponent - true) <= run.law.error)
            assert not (run.smooth and true < 0.8)
    assert np.mean(covered) >= 0.9
    assert len(covered) >= 10  # of 30: near a ratio of 1/2 labels look disordered at most distances


@pytest.mark.parametrize("width", [0.002, 0.005, 0.05])
def test_stripes_narrower_than_the_distances_are_not_called_fractal(width: float) -> None:
    """Two colours in straight stripes: distances as wide as a stripe are no evidence, and are named."""
    for seed, angle in enumerate(np.linspace(0.2, 2.8, 12)):
        across = np.array([np.cos(angle), np.sin(angle)]) / width

        def stripes(y: np.ndarray, across: np.ndarray = across) -> np.ndarray:
            return np.floor(y @ across).astype(int) % 2

        for scales in (np.geomspace(1e-4, 1e-1, 7), np.geomspace(1e-3, 1e-1, 9)):
            run = uncertainty_exponent(stripes, [0, 0], [1, 1], scales, seed=seed)
            assert run.smooth is not False
            assert not run.fitted[scales > width / 2].any()


@pytest.mark.parametrize("slope", [0.02, 0.1])
@pytest.mark.parametrize("scales", [np.logspace(-4, -1, 10), np.logspace(-3.5, -0.5, 7)])
def test_error_bars_cover_a_wedge(slope: float, scales: np.ndarray) -> None:
    """Its boundaries are two straight lines; near the tip they are one at every distance."""

    def wedge(y: np.ndarray) -> np.ndarray:
        return (np.abs(y[:, 1] - 0.5) < slope * y[:, 0]).astype(int)

    laws = [uncertainty_exponent(wedge, [0, 0], [1, 1], scales, seed=seed).law for seed in range(40)]
    assert sum(abs(law.exponent - 1.0) <= law.error for law in laws) >= 36


def test_four_distances_have_no_error_bar() -> None:
    run = uncertainty_exponent(disc, [-1, -1], [1, 1], [0.01, 0.02, 0.05, 0.1])
    assert np.isinf(run.law.error)
    assert run.smooth is None


def test_fixed_states_do_not_count_as_dimensions() -> None:
    run = uncertainty_exponent(disc, [-1, -1, 0.5], [1, 1, 0.5], SCALES, n=4000)
    assert abs(run.dimension - 1.0) <= run.law.error


def test_starts_without_a_label_are_counted_and_left_out() -> None:
    def holed(y: np.ndarray) -> np.ndarray:
        return np.where(y[:, 0] > 0.5, -1, disc(y))

    run = uncertainty_exponent(holed, [-1, -1], [1, 1], SCALES, n=20_000)
    assert (run.missing > 4500).all()
    assert (run.starts + run.missing == 20_000).all()
    assert run.smooth


def test_without_a_boundary_there_is_no_exponent() -> None:
    run = uncertainty_exponent(lambda y: np.zeros(len(y), dtype=int), [0], [1], SCALES, n=50)
    assert np.isnan(run.law.exponent)
    assert not run.smooth


def test_a_power_law_is_fitted_exactly() -> None:
    scales = 2.0 ** np.arange(6)
    law = fit_counts(scales, 1000 * 4 ** np.arange(6), np.full(6, 10**7), np.ones(6, dtype=bool))
    assert law.exponent == pytest.approx(2.0, abs=1e-12)
    np.testing.assert_allclose(law.local_slopes, 2.0)


def test_scatter_beyond_counting_widens_the_error() -> None:
    trials, every = np.full(5, 10**6), np.ones(5, dtype=bool)
    law = fit_counts(2.0 ** np.arange(5), np.array([10_000, 30_000, 25_000, 90_000, 120_000]), trials, every)
    assert law.error > 0.3
    assert fit_counts(2.0 ** np.arange(5), 10_000 * 2 ** np.arange(5), trials, every).error < 0.03


@pytest.mark.parametrize(
    ("low", "high", "epsilon", "message"),
    [
        ([0, 0], [0, 0], SCALES, "high: must have the shape of low"),
        ([0], [1, 1], SCALES, "high: must have the shape of low"),
        ([0], [1], [0.1], "epsilon: must be two or more rising distances"),
        ([0], [1], [0.1, 0.9], "epsilon: must be two or more rising distances"),
    ],
)
def test_wrong_arguments_are_refused(low: list, high: list, epsilon: list, message: str) -> None:
    with pytest.raises(InputError) as refusal:
        uncertainty_exponent(disc, low, high, epsilon)
    assert str(refusal.value).startswith(message)
