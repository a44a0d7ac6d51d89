"""Block right-hand sides for lanes of float32: the same source, compiled when a run first asks for them."""

from __future__ import annotations

from functools import cache
from typing import Any

from numba import types

from fastmech.jit import rhs_signature, single


@cache
def in_single(rhs: Any) -> Any:
    """A shipped block right-hand side for lanes of float32."""
    return single(rhs, rhs_signature(types.float32))
