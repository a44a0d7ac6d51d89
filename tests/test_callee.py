"""Kernels as arguments of kernels."""

from __future__ import annotations

import numpy as np
import pytest
from numba import types
from numba.core import config

from fastmech.callee import Callee, CalleeType, callee
from fastmech.jit import kernel

SIGNATURE = types.float64(types.float64, types.float64)
OTHER = types.float64(types.int64)

pytestmark = pytest.mark.nojit
compiled_only = pytest.mark.skipif(config.DISABLE_JIT, reason="in Python a callee is the function")


@kernel(SIGNATURE)
def difference(x, y):
    return x - y


@kernel(SIGNATURE)
def quotient(x, y):
    return x / y


@kernel(OTHER)
def half(x):
    return 0.5 * x


@kernel(types.float64(CalleeType(SIGNATURE), types.float64))
def inner(function, x):
    return 2.0 * function(x, 3.0)


@kernel(types.float64(CalleeType(SIGNATURE), CalleeType(SIGNATURE), CalleeType(OTHER)))
def outer(first, second, third):
    return inner(first, 10.0) + second(7.0, 2.0) + third(9)


def test_each_is_called_with_its_own_arguments():
    assert outer(callee(difference), callee(quotient), callee(half)) == 2.0 * 7.0 + 3.5 + 4.5
    assert outer(callee(quotient), callee(difference), callee(half)) == 2.0 * (10.0 / 3.0) + 5.0 + 4.5


def test_a_number_that_is_none_comes_back():
    assert np.isnan(inner(callee(difference), np.nan))
    assert inner(callee(quotient), np.inf) == np.inf


@compiled_only
def test_a_callee_is_made_once_and_keeps_its_kernel():
    assert callee(half) is callee(half)
    assert callee(half).address != callee(quotient).address
    own = kernel(SIGNATURE)(lambda x, y: x + 2.0 * y)
    kept = Callee(own)
    del own
    assert inner(kept, 1.0) == 14.0


@compiled_only
def test_a_callee_of_another_signature_is_refused():
    with pytest.raises(TypeError, match="No matching definition"):
        outer(callee(half), callee(quotient), callee(half))
