"""Text that changes with whatever the compiled code of a user's function can depend on."""

from __future__ import annotations

import hashlib
import itertools
import os
import time
import types
from typing import Any

import numpy as np

from fastmech.errors import InputError

#: Modules whose contents are part of an installed version, not of the user's work.
FIXED = ("math", "cmath", "numpy", "fastmech", "builtins")

_unknown = itertools.count()


def fingerprint(value: Any) -> str:
    """Fingerprint of a function with everything that it reaches.

    Globals, closures, nested functions, compiled helpers and attributes of the user's modules are followed.
    What is not understood gets a text that no other process ever has, so nothing stale is found for it.
    """
    return hashlib.sha256(_text(value, set()).encode()).hexdigest()[:16]


def enclosed(function: types.FunctionType) -> dict[str, Any]:
    """Variables of enclosing functions that a function uses, by name.

    Raises:
        InputError: one of them has no value.
    """
    found = {}
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        try:
            found[name] = cell.cell_contents
        except ValueError:
            raise InputError(f"{function.__name__}: uses {name}, which has no value yet") from None
    return found


def _text(value: Any, seen: set[int]) -> str:
    value = getattr(value, "py_func", value)  # of what numba has compiled
    if value is None or isinstance(value, bool | int | float | complex | str | bytes):
        return repr(value)
    if isinstance(value, np.generic):
        return f"{value.dtype} {value!r}"
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        return (
            f"{value.dtype} {value.shape} {hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()}"
        )
    if isinstance(value, tuple | list | frozenset):
        return f"{type(value).__name__}({','.join(_text(item, seen) for item in value)})"
    home = str(getattr(value, "__module__", None) or getattr(value, "__name__", ""))
    if home.split(".")[0] in FIXED:
        return f"{getattr(value, '__module__', '')}.{getattr(value, '__name__', repr(value))}"
    if isinstance(value, types.FunctionType):
        return _function(value, seen)
    return f"unknown {os.getpid()} {time.time_ns()} {next(_unknown)}"


def _function(function: types.FunctionType, seen: set[int]) -> str:
    if id(function) in seen:
        return function.__qualname__
    seen.add(id(function))
    cells = [_text(value, seen) for value in enclosed(function).values()]
    defaults = _text(function.__defaults__ or (), seen)
    return "|".join([_code(function.__code__, function.__globals__, seen), defaults, *cells])


def _code(code: types.CodeType, known: dict[str, Any], seen: set[int]) -> str:
    parts = [code.co_code.hex(), repr(code.co_names), repr(code.co_varnames), repr(code.co_freevars)]
    for constant in code.co_consts:
        nested = isinstance(constant, types.CodeType)
        parts.append(_code(constant, known, seen) if nested else _text(constant, seen))
    for name in code.co_names:
        if name in known and isinstance(known[name], types.ModuleType):
            parts.append(_attributes(known[name], code.co_names, seen))
        elif name in known:
            parts.append(f"{name}={_text(known[name], seen)}")
    return "|".join(parts)


def _attributes(module: types.ModuleType, names: tuple[str, ...], seen: set[int]) -> str:
    """What code that mentions ``names`` can take from a module."""
    if module.__name__.split(".")[0] in FIXED:
        return module.__name__
    used = {name: vars(module)[name] for name in names if name in vars(module)}
    return ",".join(f"{module.__name__}.{name}={_text(value, seen)}" for name, value in used.items())
