"""The exponential of lanes against mpmath, in either precision."""

from __future__ import annotations

from typing import Any

import mpmath
import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from fastmech.jit import FLAGS
from fastmech.kernels.exponential import exp


@numba.njit(**FLAGS)
def exponentials(x: Any, out: Any) -> None:
    for i in range(x.size):
        out[i] = exp(x[i])


@pytest.mark.nojit
@pytest.mark.parametrize(
    ("precision", "least", "ulp"), [(np.float64, -708.0, 2.3e-16), (np.float32, -87.0, 1.5e-7)]
)
def test_relative_error(precision: Any, least: float, ulp: float) -> None:
    if numba.config.DISABLE_JIT and precision is np.float32:
        pytest.skip("in plain Python there is the double one only")
    random = np.random.default_rng(5)
    spread = [
        random.uniform(least, 0.0, 4000),
        random.uniform(-1.0, 1.0, 4000),
        -random.exponential(1e-8, 50),
    ]
    x = np.concatenate([*spread, np.log(2.0) * (np.arange(-60, 4) + 0.5)]).astype(precision)
    found = np.empty_like(x)
    exponentials(x, found)
    with mpmath.workdps(30):
        right: NDArray[Any] = np.array([float(mpmath.exp(v)) for v in x.tolist()])
    assert np.abs(found / right - 1.0).max() <= ulp


@pytest.mark.nojit
def test_far_down_and_not_a_number() -> None:
    x, found = np.array([-709.0, -1e6, -np.inf, np.nan, 0.0, -0.0]), np.empty(6)
    exponentials(x, found)
    assert (found[:3] <= 1e-307).all()
    assert (found[:3] >= 0.0).all()
    assert np.isnan(found[3])
    np.testing.assert_array_equal(found[4:], 1.0)
