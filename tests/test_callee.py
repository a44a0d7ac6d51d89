"""Kernels as arguments of kernels."""

from __future__ import annotations

import numpy as np
import pytest
from numba import types
from numba.core import config

from fastmech.callee import Callee, CalleeType, callee, entry
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


@kernel(types.void(types.Array(types.float64, 1, "C")))
def double_all(x):
    for i in range(x.size):
        x[i] *= 2.0


def test_an_entry_does_what_its_kernel_does():
    assert entry(difference)(7.0, 2.0) == 5.0
    assert entry(inner)(callee(quotient), 6.0) == 4.0


@compiled_only
def test_an_entry_refuses_numbers_of_another_size():
    x = np.arange(4.0)
    entry(double_all)(x)
    assert x.tolist() == [0.0, 2.0, 4.0, 6.0]
    with pytest.raises(TypeError):
        entry(double_all)(x.astype(np.float32))


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
