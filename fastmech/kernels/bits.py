"""The bits of a double as an integer and back: no instruction, so that integer masks select lanes."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload

from fastmech.jit import INLINED


def _recast(returned: Any, code: Any) -> Any:
    """A function that takes the bits of its argument as another type of the same size."""

    @intrinsic
    def recast(typingctx: Any, x: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return builder.bitcast(args[0], code)

        return returned(x), generate

    return recast


_integer, _double = _recast(types.int64, ir.IntType(64)), _recast(types.float64, ir.DoubleType())


def to_bits(x: float) -> Any:
    """The 64 bits of a double."""
    return np.float64(x).view(np.int64)


def from_bits(bits: Any) -> Any:
    """The double of 64 bits."""
    return np.int64(bits).view(np.float64)


@overload(to_bits, jit_options=INLINED, strict=False)
def _to_bits(x: Any) -> Any:
    return lambda x: _integer(x)


@overload(from_bits, jit_options=INLINED, strict=False)
def _from_bits(bits: Any) -> Any:
    return lambda bits: _double(bits)
