"""The bits of a double as an integer and back, and flags of a loop over lanes: what keeps loops packed."""

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


#: What a loop over lanes begins with where it asks whether any lane has something. LLVM packs as many lanes
#: as numbers of the loop's widest type fit into a vector: a flag of 64 bits would halve loops of float32.
NO_LANE = np.int32(0)


def _either(typingctx: Any, flag: Any, condition: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.or_(
            args[0], builder.zext(context.cast(builder, args[1], condition, types.boolean), args[0].type)
        )

    return types.int32(types.int32, condition), generate


_either_of: Any = intrinsic(_either)


def noted(flag: Any, condition: Any) -> Any:
    """``flag`` of 32 bits, or 1 where the condition (a bool) holds."""
    return flag | np.int32(condition)


@overload(noted, jit_options=INLINED, strict=False)
def _noted(flag: Any, condition: Any) -> Any:
    return lambda flag, condition: _either_of(flag, condition)
