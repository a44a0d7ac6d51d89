from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
import scipy.linalg
from disturbance.known import center, equilibria, known, oracle_jacobian, oracle_size, scipy_motion

from fastmech import mechanisms
from fastmech.disturbance.motion import LinearRange, Size, linear_range
from fastmech.errors import InputError
from fastmech.scene import Scene

SCENE = known("table_1")[0]


def deviation(e: Any, ray: Any, size: float, horizon: float) -> float:
    """By SciPy: the ratio of maxima over 201 times."""
    times = np.linspace(0.0, horizon, 201)
    nonlinear = scipy_motion(SCENE, center(e) + size * ray, horizon, 1e-10).sol(times).T - center(e)
    J = oracle_jacobian(SCENE, e)
    linear = np.array([scipy.linalg.expm(t * J) @ (size * ray) for t in times])
    return float(oracle_size(SCENE, e, nonlinear - linear).max() / oracle_size(SCENE, e, nonlinear).max())


@pytest.mark.parametrize("morse_index", [0, 1])
def test_limits_against_scipy(morse_index: int) -> None:
    """The deviation is the tolerance at the limit, to half a percent, and less at smaller sizes."""
    e = equilibria("table_1", morse_index)[0]
    found = linear_range(SCENE, e, directions=4, seed=3, horizon=1.5, tolerance=0.08)
    assert (found.horizon, found.tolerance) == (1.5, 0.08)
    np.testing.assert_allclose(oracle_size(SCENE, e, found.directions), 1.0, rtol=1e-12)
    for ray, limit in zip(found.directions, found.limit, strict=True):
        assert deviation(e, ray, limit, 1.5) == pytest.approx(0.08, rel=5e-3)
        assert all(deviation(e, ray, limit * share, 1.5) < 0.08 for share in (0.98, 0.4))


def test_limit_grows_with_the_tolerance_and_ends_are_told_apart() -> None:
    (e,) = equilibria("table_1", 0)
    strict, loose = (linear_range(SCENE, e, directions=5, tolerance=x) for x in (0.02, 0.1))
    assert np.all(strict.limit < loose.limit)
    np.testing.assert_array_equal(linear_range(SCENE, e, directions=5, tolerance=1e-9).limit, 0.0)
    assert np.all(np.isinf(linear_range(SCENE, e, directions=5, tolerance=1e6).limit))


@pytest.mark.parametrize(
    ("device", "unit"), [(mechanisms.von_mises_truss, "m"), (mechanisms.cart_pendulum, "rad"), (Scene, "rad")]
)
def test_sizes_have_the_last_coordinate_s_unit_and_words_where_no_limit_was_met(
    device: Any, unit: str
) -> None:
    def found(*limit: float) -> LinearRange:
        return LinearRange(np.eye(4)[:2], np.array(limit), Size(np.eye(2), 3.0), 1.0, 0.05).of(device())

    assert found(0.5, 0.25).dataset()["limit"].units == unit
    for limit, told in (
        ((0.5, 0.25), f"0.25 {unit} in the worst of 2 directions, 0.5 {unit} in the best"),
        (
            (np.inf, 0.0),
            f"no size tried in the worst of 2 directions, 3.142 {unit} (the largest tried) in the",
        ),
    ):
        assert f"by up to {told}" in " ".join(str(found(*limit)).split())


def test_a_horizon_too_short_for_a_slow_device_is_told() -> None:
    (e,) = equilibria("table_1", 0)
    said = "a longer horizon tells"
    assert said not in str(linear_range(SCENE, e, directions=2))
    assert said in " ".join(str(linear_range(SCENE, e, directions=2, horizon=0.01)).split())


def test_the_seed_decides_and_threads_do_not() -> None:
    (e,) = equilibria("table_1", 0)
    first, again, other = (
        linear_range(SCENE, e, directions=20, seed=seed, threads=threads)
        for seed, threads in ((1, 1), (1, 2), (2, 1))
    )
    np.testing.assert_array_equal(first.directions, again.directions)
    np.testing.assert_array_equal(first.limit, again.limit)
    assert not np.any(first.directions == other.directions)


def test_a_size_that_leaves_double_precision_counts_as_deviating() -> None:
    """A step far too large: the nonlinear motion is not finite, so nothing can be said to agree."""
    (e,) = equilibria("table_1", 0)
    with np.errstate(all="ignore"):
        limit = linear_range(SCENE, e, directions=5, horizon=500.0, dt=10.0).limit
    assert not np.any(np.isinf(limit))


@pytest.mark.nojit
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"horizon": 0.0}, "horizon = 0.0: must be a finite number of s greater than 0"),
        ({"tolerance": -1.0}, "tolerance = -1.0: must be a finite number greater than 0"),
        ({"directions": 0}, "directions = 0: must be an integer not less than 1"),
        ({"seed": -1}, "seed = -1: must be an integer not less than 0"),
    ],
)
def test_wrong_arguments_are_refused(arguments: dict[str, Any], message: str) -> None:
    (e,) = equilibria("table_1", 0)
    with pytest.raises(InputError, match=f"^{re.escape(message)}"):
        linear_range(SCENE, e, **arguments)


@pytest.mark.nojit
def test_a_decaying_force_is_refused() -> None:
    (e,) = equilibria("table_1", 0)
    with pytest.raises(InputError, match=r"^scene\.alpha = 0\.7: must be 0 1/s"):
        linear_range(SCENE.replace(alpha=0.7), e)
