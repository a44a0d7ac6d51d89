"""What keeps loops over lanes packed: the bits of a number, flags, arrays that do not overlap."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types

from fastmech.jit import lowered


def _recast(returned: Any, code: Any) -> Any:
    """The bits of an argument as another type of the same size."""

    def recast(typingctx: Any, x: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return builder.bitcast(args[0], code)

        return returned(x), generate

    return recast


@lowered(_recast(types.int64, ir.IntType(64)))
def to_bits(x: float) -> Any:
    """The 64 bits of a double."""
    return np.float64(x).view(np.int64)


@lowered(_recast(types.float64, ir.DoubleType()))
def from_bits(bits: Any) -> Any:
    """The double of 64 bits."""
    return np.int64(bits).view(np.float64)


def _scaled(typingctx: Any, value: Any, shifted: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        number = args[0].type
        size, digits = (32, 23) if number == ir.FloatType() else (64, 52)
        whole = ir.IntType(size)
        power = builder.shl(builder.bitcast(args[1], whole), ir.Constant(whole, digits))
        return builder.bitcast(builder.add(builder.bitcast(args[0], whole), power), number)

    return value(value, value), generate


@lowered(_scaled)
def times_power_of_two(value: Any, shifted: Any) -> Any:
    """``value`` 2^n; ``shifted`` is n + 1.5 2^52 (in float32 n + 1.5 2^23), which ends in the bits of n."""
    return np.ldexp(value, np.int64(shifted - 1.5 * 2.0**52)) if np.isfinite(shifted) else value * shifted


#: What a loop over lanes begins with where it asks whether any lane has something. LLVM packs as many lanes
#: as numbers of the loop's widest type fit into a vector: a flag of 64 bits would halve loops of float32.
NO_LANE = np.int32(0)


def _either(typingctx: Any, flag: Any, condition: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.or_(
            args[0], builder.zext(context.cast(builder, args[1], condition, types.boolean), args[0].type)
        )

    return types.int32(types.int32, condition), generate


@lowered(_either)
def noted(flag: Any, condition: Any) -> Any:
    """``flag`` of 32 bits, or 1 where the condition (a bool) holds."""
    return flag | np.int32(condition)


def _mark_apart(typingctx: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        for argument in builder.function.args:
            kind = getattr(argument.type, "pointee", None)
            if kind in (ir.DoubleType(), ir.FloatType()):
                argument.add_attribute("noalias")
        return context.get_dummy_value()

    return types.void(), generate


@lowered(_mark_apart)
def apart() -> None:
    """Tell the compiler that none of the arrays of numbers overlap which a kernel is given."""


def _mark_not_inlined(typingctx: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        builder.function.attributes.add("noinline")
        return context.get_dummy_value()

    return types.void(), generate


@lowered(_mark_not_inlined)
def not_inlined() -> None:
    """Keep a function out of those that call it: what is done seldom would spoil the loop beside it."""
