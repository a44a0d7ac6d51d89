"""The one place where the package talks to the just-in-time compiler: flags, signatures, caching.

Flags. ``error_model="numpy"`` is what lets LLVM vectorize at all (with Python's division semantics every
division is a branch that may raise). Of the fast-math flags only ``contract`` is set: a product and a sum
may fuse, nothing may be reordered, and NaN and infinity keep their meaning because statuses are decided
by them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba
from numba import types
from numba.core import config as numba_config
from numba.extending import register_jitable

from fastmech.kernel_cache import cache_directory

F = TypeVar("F", bound=Callable[..., Any])

FLAGS: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract"}}

VECTOR = types.Array(types.float64, 1, "C")
MATRIX = types.Array(types.float64, 2, "C")
CUBE = types.Array(types.float64, 3, "C")
INTEGERS = types.Array(types.int64, 1, "C")
STATUSES = types.Array(types.int8, 1, "C")

#: ``rhs(t, Y, dY, params)``: derivatives of a block of lanes. ``Y`` and ``dY`` have shape (dim, lanes),
#: ``params`` (count, 1) where all lanes share them or (count, lanes) where each has its own.
RHS_SIGNATURE = types.void(types.float64, MATRIX, MATRIX, MATRIX)
RHS = types.FunctionType(RHS_SIGNATURE)

#: ``jacobian(t, Y, J, params)``: row ``r * dim + c`` of ``J`` (dim * dim, lanes) is the derivative of the
#: rate of state ``r`` by state ``c``.
JACOBIAN_SIGNATURE = types.void(types.float64, MATRIX, MATRIX, MATRIX)
JACOBIAN = types.FunctionType(JACOBIAN_SIGNATURE)

#: ``observe(t, Y, params, record)``: looks at a block after every step; ``record`` is (rows, lanes).
OBSERVER_SIGNATURE = types.void(types.float64, MATRIX, VECTOR, MATRIX)
OBSERVER = types.FunctionType(OBSERVER_SIGNATURE)


def kernel(signature: Any, **options: Any) -> Callable[[F], Any]:
    """Compile a function for one explicit signature, without the interpreter's lock, kept on disk.

    Explicit signatures make the disk entry usable in every later process even where an argument is a
    first-class function. The cache directory is set for this decoration only, so the user's own kernels
    keep theirs.
    """

    def decorate(function: F) -> Any:
        settings: Any = numba_config
        previous = settings.CACHE_DIR
        settings.CACHE_DIR = str(cache_directory())
        try:
            return numba.njit(signature, cache=True, nogil=True, **FLAGS, **options)(function)
        finally:
            settings.CACHE_DIR = previous

    return decorate


def inlined(function: F) -> F:
    """Make a small scalar function callable from kernels; in Python it stays the plain function.

    The same source therefore serves compiled lanes and NumPy arrays.
    """
    jitable: F = register_jitable(forceinline=True, **FLAGS)(function)
    return jitable
