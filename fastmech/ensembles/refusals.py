"""Why a user's function cannot be compiled, in one line: numba tells it on a page."""

from __future__ import annotations

import re
from types import FunctionType
from typing import Any

from numba import types

from fastmech.errors import InputError
from fastmech.kernels.attempt import attempted

#: What ends the part of numba's message that says what is wrong.
_END = re.compile(r"^(?:File |There are |During: |Return of: |$)", re.MULTILINE)
_COLOR = re.compile(r"\x1b\[[0-9;]*m")
_RAISED = re.compile(r"\.* Raised from None$")
_STEP = re.compile(r"^Failed in nopython mode pipeline.*\n")
_SIGNATURE = re.compile(r"No implementation of function .* found for signature:\s+>>> (.*)")
_LINE = re.compile(r'", line (\d+):')


def reason(error: Exception) -> str:
    """What is wrong, and in which line of the user's file, from numba's message."""
    text = _STEP.sub("", _COLOR.sub("", str(error)))
    unknown = _SIGNATURE.match(text)
    what = f"nothing known for {unknown[1]}" if unknown else " ".join(_END.split(text, maxsplit=1)[0].split())
    what = _RAISED.sub("", what)
    lines = _LINE.findall(text)
    return f"line {lines[-1]}: {what}" if lines else what


def explain(field: str, function: FunctionType, arguments: tuple[Any, ...], states: list[str] | None) -> None:
    """Refuse a function that cannot be compiled for these types, or gives something else than it must.

    ``states`` are the names for which a right-hand side gives rates, ``None`` for a stopping condition, empty
    where it writes them.

    Raises:
        InputError: it is refused.
    """
    compiled = attempted(function)
    try:
        compiled.compile(arguments)
    except Exception as error:  # numba lets those of the code it looks at pass
        raise InputError(
            f"{field}: cannot be compiled (arithmetic, numpy and math only; functions that it calls need "
            f"numba.njit): {reason(error)}"
        ) from None
    (overload,) = compiled.overloads.values()
    given: Any = overload.signature.return_type
    if states is None:
        if not _real(given):
            raise InputError(f"{field}: returns {given}, must return a real number, 0 while it runs on")
        return
    if not states:
        return
    wanted = f"must return a tuple of {len(states)}, the rate{'s' * (len(states) > 1)} of {', '.join(states)}"
    is_tuple = isinstance(given, types.BaseTuple)
    if not is_tuple or len(given) != len(states):
        returned = f"a tuple of {len(given)}" if is_tuple else given
        raise InputError(f"{field}: returns {returned}, {wanted}")
    for name, rate in zip(states, given, strict=True):
        if not _real(rate):
            raise InputError(f"{field}: returns {rate} as the rate of {name}, must be a real number")


def _real(kind: Any) -> bool:
    return isinstance(kind, types.Float | types.Integer | types.Boolean)
