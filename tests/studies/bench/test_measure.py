"""Speed at equal error: what is interpolated, and what is not guessed."""

from __future__ import annotations

import numpy as np
import pytest

from fastmech.studies.bench.measure import Row, fastest_at, frontier, rate_at
from fastmech.studies.bench.report import equal_error, same_step

pytestmark = pytest.mark.nojit


def row(family: str, rate: float, *errors: float, setting: str = "dt = 1 s") -> Row:
    return Row("rest", family, setting, 1000, 1000 / rate, 1000 / rate, 0.1, np.array(errors))


def test_a_setting_that_is_slower_and_less_accurate_is_left_out():
    rows = [row("a", 100.0, 1e-4), row("a", 50.0, 1e-3), row("a", 10.0, 1e-8), row("a", 900.0, np.inf)]
    assert frontier(rows) == [rows[2], rows[0]]


def test_between_two_settings_the_rate_is_interpolated_in_logarithms():
    rows = [row("a", 1000.0, 1e-2), row("a", 10.0, 1e-6)]
    assert rate_at(rows, 1e-4) == pytest.approx(100.0)


def test_nothing_is_guessed_beyond_the_settings():
    rows = [row("a", 1000.0, 1e-4), row("a", 10.0, 1e-6)]
    assert rate_at(rows, 1e-7) is None
    assert rate_at(rows, 1e-2) == pytest.approx(1000.0)  # it is only more accurate than asked for


def test_the_fastest_family_at_an_error():
    rows = [row("a", 1000.0, 1e-3), row("b", 300.0, 1e-8)]
    assert fastest_at(rows, 1e-3) == ("a", pytest.approx(1000.0))
    assert fastest_at(rows, 1e-6) == ("b", pytest.approx(300.0))
    assert fastest_at(rows, 1e-9) is None


def test_a_peer_with_fewer_trajectories_is_compared_on_those():
    """Over its one trajectory the package reaches 1e-5 with its fast setting, over both it does not."""
    rows = [row("fastmech rk4", 1000.0, 1e-5, 1e-3), row("fastmech rk4", 10.0, 1e-9, 1e-6)]
    rows.append(row("SciPy", 5.0, 1e-5))
    assert rate_at(rows[:2], 1e-5) < 100.0
    text = "\n".join(equal_error(rows))
    assert "| SciPy (first 1) |" in text
    assert "200.00 x (5)" in text


def test_ratios_at_the_same_step():
    rows = [row("fastmech rk4", 900.0, 0.1), row("hand-fused rk4", 1000.0, 0.1), row("Numba RK4", 100.0, 0.1)]
    text = "\n".join(same_step(rows))
    assert "| hand-fused rk4, dt = 1 s | 1,000 | 900 | 0.90 |" in text
    assert "| Numba RK4, dt = 1 s | 100 | 900 | 9.00 |" in text
