"""Right-hand sides and observers for lanes of float32: the same source, compiled when a run asks for them."""

from __future__ import annotations

from functools import cache
from typing import Any

from numba import types

from fastmech.jit import observer_signature, rhs_signature, single


@cache
def in_single(rhs: Any) -> Any:
    """A shipped block right-hand side for lanes of float32."""
    return single(rhs, rhs_signature(types.float32))


@cache
def observer_in_single(observe: Any) -> Any:
    """An observer for lanes of float32; its record stays float64."""
    return single(observe, observer_signature(types.float32))
