"""Groups of like motions against the attractors that recurrences and Newton's method find."""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
import pytest

import fastmech as fm


def duffing(t, x, v, A):  # type: ignore[no-untyped-def]
    return v, -0.08 * v - x * x * x + A * fm.cos(t)


def pendulum(t, x, v, T):  # type: ignore[no-untyped-def]
    return v, -0.1 * v + T - fm.sin(x)


DUFFING = fm.System(duffing, ["x", "v"], {"A": 0.2}, period=2.0 * math.pi)
PENDULUM = fm.System(pendulum, ["x", "v"], {"T": 0.5}, angles=["x"])
REGION = {"x": (-1.0, 1.0), "v": (-0.5, 1.0)}


@pytest.mark.parametrize("method", ["dbscan", "hdbscan"])
def test_groups_are_the_attractors_of_duffing_s_oscillator(method: str) -> None:
    starts = fm.samplers.Uniform(REGION).draw(600, ("x", "v"))
    groups = fm.group_by_features(DUFFING, starts, 600, t_end=1000.0, method=method)
    found = fm.find_attractors(DUFFING, starts)
    pairs = {*zip(groups.label.tolist(), found.label.tolist(), strict=True)}
    assert len(pairs) == len(found) == 5  # each group is one attractor
    assert groups.fractions.sum() == pytest.approx(1.0)
    assert repr(groups).startswith("5 groups of 600 starts, 0 in none")


@pytest.mark.parametrize("method", ["dbscan", "hdbscan"])
def test_one_attractor_is_one_group(method: str) -> None:
    """All motions end at one place, but for rounding."""
    sink = fm.System(lambda t, x, y: (-x, -2.0 * y), ["x", "y"], {})
    region = {"x": (-1.0, 1.0), "y": (-1.0, 1.0)}
    groups = fm.group_by_features(sink, region, 300, t_end=50.0, method=method)
    assert repr(groups).startswith("1 group of 300 starts, 0 in none")


def test_groups_of_very_different_densities() -> None:
    """x' = 0 keeps starts where they are: three wide groups and, near one of them, a narrow one."""
    rng = np.random.default_rng(1)
    wide = [rng.normal(middle, 0.05, (200, 2)) for middle in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))]
    starts = np.concatenate([*wide, rng.normal((0.3, 0.0), 0.004, (100, 2))])
    still = fm.System(lambda t, x, y: (0.0 * x, 0.0 * y), ["x", "y"], {})
    groups = fm.group_by_features(
        still, starts, t_end=1.0, method="hdbscan", features=lambda t, y: y[-1], radius=1e-3
    )
    of = [groups.label[200 * k : 200 * k + (200 if k < 3 else 100)] for k in range(4)]
    assert sorted(np.bincount(one[one >= 0]).argmax() for one in of) == [0, 1, 2, 3]
    assert all((one == np.bincount(one[one >= 0]).argmax()).mean() > 0.8 for one in of)


def test_a_feature_of_one_s_own_tells_rest_from_turning() -> None:
    def mean_rate(t: np.ndarray, y: np.ndarray) -> Any:
        return (y[-1, 0] - y[0, 0]) / (t[-1] - t[0])

    starts = fm.samplers.Uniform({"x": (-2.6, 3.6), "v": (-10.0, 10.0)}).draw(300, ("x", "v"))
    groups = fm.group_by_features(PENDULUM, starts, 300, t_end=300.0, features=mean_rate, radius=0.1)
    turning, resting = (groups.features[groups.label == k, 0] for k in (0, 1))
    # On average 0.1 times the rate is the torque 0.5 less the mean sine, which is small.
    assert turning.min() > 4.9
    assert turning.max() < 5.0
    assert np.abs(resting).max() < 1e-6
    assert groups.names == ("feature 0",)


def test_what_escapes_is_in_no_group() -> None:
    def cubic(t, x):  # type: ignore[no-untyped-def]
        return (x * x * x - x,)

    starts = np.linspace(-1.5, 1.5, 60)[:, None]
    groups = fm.group_by_features(fm.System(cubic, ["x"], {}), starts, 60, t_end=50.0)
    assert ((groups.label == 0) == (np.abs(starts[:, 0]) < 1.0)).all()
    assert (groups.status[np.abs(starts[:, 0]) > 1.0] == fm.Status.ESCAPED).all()

    def last(t: np.ndarray, y: np.ndarray) -> Any:
        assert np.isfinite(y).all()  # nobody's function has to know of lost motions
        return y[-1]

    own = fm.group_by_features(fm.System(cubic, ["x"], {}), starts, 60, t_end=50.0, features=last)
    assert (np.isfinite(own.features[:, 0]) == (np.abs(starts[:, 0]) < 1.0)).all()
    assert "not finite" not in repr(own)
    none = fm.group_by_features(
        fm.System(cubic, ["x"], {}), starts, 60, t_end=50.0, features=lambda t, y: math.nan
    )
    assert repr(none) == "0 groups of 60 starts, 60 in none; features of 40 are not finite"


def test_a_feature_that_cannot_be_taken_gets_one_line() -> None:
    def of_none(t: np.ndarray, y: np.ndarray) -> Any:
        return 1.0 / (t.size - t.size)

    def more_and_more(t: np.ndarray, y: np.ndarray) -> Any:
        return np.zeros(1 + int(y[0, 0] > 0.0))

    for wrong, told in (
        (of_none, "raises ZeroDivisionError"),
        (more_and_more, "must give numbers, and as many"),
    ):
        with pytest.raises(fm.InputError, match=f"^features: {told}"):
            fm.group_by_features(DUFFING, REGION, 50, t_end=10.0, features=wrong)


def test_without_scikit_learn_one_line_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sklearn.cluster", None)
    with pytest.raises(fm.InputError, match=r"needs scikit-learn; pip install 'fastmech\[features\]'"):
        fm.group_by_features(DUFFING, REGION, t_end=10.0)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"t_end": -1.0}, "t_end"),
        ({"t_end": 10.0, "method": "kmeans"}, "method = 'kmeans': must be one of dbscan"),
        ({"t_end": 10.0, "radius": 0.0}, "radius"),
        ({"t_end": math.nan}, "t_end"),
    ],
)
def test_wrong_arguments_are_refused(wrong: dict[str, float], told: str) -> None:
    with pytest.raises(fm.InputError, match=told):
        fm.group_by_features(DUFFING, REGION, 50, **wrong)
