from __future__ import annotations

from functools import cache
from typing import Any

import mpmath
import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from fastmech.jit import FLAGS
from fastmech.kernels.sincos import REDUCTION_LIMIT, sincos

Floats = NDArray[np.float64]

DIGITS = 40
#: A double nearest to a multiple of pi/2 among those that hurt most: 29 pi/2 but for 5e-18 of its size.
HARD = 45.553093477052


@cache
def compiled() -> Any:
    """``sincos`` as kernels compile it."""

    @numba.njit(**FLAGS)
    def run(x: Floats, s: Floats, c: Floats) -> None:
        for i in range(x.size):
            s[i], c[i] = sincos(x[i])

    return run


def evaluate(x: Floats) -> tuple[Floats, Floats]:
    s, c = np.empty_like(x), np.empty_like(x)
    compiled()(x, s, c)
    return s, c


def errors(x: Floats) -> tuple[float, float]:
    """Largest absolute error of either function, and largest error relative to its value."""
    absolute = relative = 0.0
    with mpmath.workdps(DIGITS):
        for value, s, c in zip(x.tolist(), *(part.tolist() for part in evaluate(x)), strict=True):
            right = mpmath.cos_sin(value)
            for mine, theirs in zip((c, s), right, strict=True):
                error = abs(mine - theirs)
                absolute = max(absolute, float(error))
                if theirs:
                    relative = max(relative, float(error / abs(theirs)))
    return absolute, relative


@cache
def multiples(limit: float, most: int = 10**4) -> Floats:
    """The doubles nearest to the ``most`` largest multiples of pi/2 up to ``limit``, and their neighbours."""
    end = int(limit / (np.pi / 2))
    with mpmath.workdps(DIGITS):
        nearest = [float(k * mpmath.pi / 2) for k in range(max(end - most, 0), end)]
    x = np.array(nearest)
    return np.concatenate([x, np.nextafter(x, np.inf), np.nextafter(x, -np.inf), [HARD]])


def points(n: int, limit: float) -> Floats:
    return np.random.default_rng(7).uniform(-limit, limit, n)


@pytest.mark.nojit
def test_absolute_error_up_to_10_000() -> None:
    """2.3e-16: one unit in the last place below 1 is 1.1e-16."""
    assert errors(points(20_000, 1e4))[0] <= 2.3e-16


def test_absolute_error_at_100_000_points() -> None:
    assert errors(np.concatenate([points(60_000, 1e4), points(40_000, 10.0)]))[0] <= 2.3e-16


@pytest.mark.nojit
def test_multiples_of_half_pi_up_to_10_000() -> None:
    """Where one function all but vanishes, the error relative to its value is still bounded."""
    absolute, relative = errors(multiples(1e4))
    assert absolute <= 2.3e-16
    assert relative <= 5e-16


def test_relative_error_near_zeros() -> None:
    """Between 1e-16 and 1e-3 beside every hundredth zero up to 10,000: a few units in the last place."""
    near = multiples(1e4)[:6000:100]
    beside = near[:, None] + 10.0 ** np.linspace(-12, -3, 10) * np.array([[1.0]])
    assert errors(beside.ravel())[1] <= 5e-16


@pytest.mark.parametrize("limit", [1e5, REDUCTION_LIMIT])
def test_absolute_error_up_to_the_limit(limit: float) -> None:
    edge = np.array([limit, -limit, np.nextafter(limit, 0.0)])
    assert errors(np.concatenate([points(20_000, limit), multiples(limit, 1000), edge]))[0] <= 2.3e-16


@pytest.mark.nojit
def test_exact_values_and_signs() -> None:
    s, c = evaluate(np.array([0.0, -0.0, np.nan]))
    np.testing.assert_array_equal(s[:2], [0.0, 0.0])
    np.testing.assert_array_equal(c[:2], [1.0, 1.0])
    assert np.isnan(s[2])
    assert np.isnan(c[2])


@pytest.mark.nojit
def test_symmetries() -> None:
    """sin is odd and cos is even to the bit, except in the middle between quadrants."""
    x = points(2000, 300.0)
    (s, c), (minus_s, minus_c) = evaluate(x), evaluate(-x)
    np.testing.assert_array_equal(minus_s, -s)
    np.testing.assert_array_equal(minus_c, c)


@pytest.mark.nojit
def test_arrays_in_plain_python_are_refused_not_wrong() -> None:
    """The selection by quadrant is written for one lane; NumPy analysis uses NumPy's own functions."""
    with pytest.raises(ValueError, match="ambiguous"):
        sincos(np.array([0.1, 2.0]))  # type: ignore[arg-type]
