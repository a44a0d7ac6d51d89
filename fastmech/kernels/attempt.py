"""Calls whose exceptions are a flag beside their result: a loop over lanes goes on and stays packed.

A lane that needs what cannot be packed raises. Its result is then meaningless, and the block's kernel
computes that lane again in another way.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
from numba import types
from numba.extending import intrinsic, overload

from fastmech.jit import INLINED


def attempted(function: Callable[..., Any]) -> Any:
    """A function compiled into the kernels that :func:`attempt` it."""
    return numba.njit(**INLINED)(function)


def _tell(typingctx: Any, function: Any, arguments: Any) -> Any:
    called = function.get_call_type(typingctx, tuple(arguments), {})
    told = types.Tuple((types.boolean, called.return_type))  # type: ignore[no-untyped-call]

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        compiled = function.dispatcher.overloads[called.args]
        context.active_code_library.add_linking_library(compiled.library)
        given = [builder.extract_value(args[1], number) for number in range(len(called.args))]
        status, result = context.call_internal_no_propagate(builder, compiled.fndesc, called, given)
        return context.make_tuple(builder, told, (status.is_error, result))

    return told(function, arguments), generate


_told: Any = intrinsic(_tell)


def attempt(function: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[bool, Any]:
    """Whether ``function(*arguments)`` raised, and its result; ``function`` is an :func:`attempted` one.

    In Python an exception goes its usual way.
    """
    return False, function(*arguments)


@overload(attempt, jit_options=INLINED, strict=False)
def _attempt(function: Any, arguments: Any) -> Any:
    """A function around the call: without it LLVM splits the stores of a loop and leaves it unpacked."""
    return lambda function, arguments: _told(function, arguments)
