"""Copies of a user's functions, for kernels that must not depend on where the functions come from."""

from __future__ import annotations

import dis
import types
from collections.abc import Callable, Iterator
from typing import Any

import numba
import numpy as np
from numba.core.registry import CPUDispatcher

from fastmech.ensembles.fingerprint import FIXED, enclosed

#: Functions to be called in the place of others; that of ``float`` makes constants another type.
Swaps = dict[Callable[[float], float], Callable[[float], float]]


def rebuilt(function: types.FunctionType, module: str, swaps: Swaps) -> types.FunctionType:
    """A function object of its own, said to be of ``module``, that calls others where ``swaps`` tells.

    Numba compiles one object once, whatever becomes of its globals; and a kernel from the disk wants to
    import the module of every function in it, which for the user's may be a notebook. Compiled functions
    that the function calls are rebuilt with it where they reach a swapped one; those given types of their
    own stay as they are.
    """
    return _copy(function, module, swaps, ())


def reaches(function: types.FunctionType, swaps: Swaps) -> bool:
    """Whether a copy calls anything in the place of something else."""
    return _reaches(function, swaps, ())


def raises(function: types.FunctionType) -> bool:
    """Whether a function raises or asserts itself."""
    return any(instruction.opname == "RAISE_VARARGS" for instruction in dis.get_instructions(function))


def returns(function: types.FunctionType) -> bool:
    """Whether a function gives anything back but None."""
    before = None
    for instruction in dis.get_instructions(function):
        given = before if instruction.opname == "RETURN_VALUE" else instruction
        gone = instruction.opname in ("RETURN_VALUE", "RETURN_CONST")
        if gone and given is not None and ("CONST" not in given.opname or given.argval is not None):
            return True
        before = instruction
    return False


def compiled_callees(function: types.FunctionType) -> Iterator[types.FunctionType]:
    """Sources of the compiled functions that a function can call, directly or through one another."""
    seen: set[tuple[int, frozenset[str]]] = set()  # another mention of a module may find more in it
    reached: list[tuple[Any, set[str]]] = [(function, set())]
    while reached:
        value, mentioned = reached.pop()
        if (id(value), frozenset(mentioned)) in seen:
            continue
        seen.add((id(value), frozenset(mentioned)))
        if isinstance(value, types.ModuleType):
            if value.__name__.split(".")[0] not in FIXED:
                reached += [(vars(value)[name], mentioned) for name in mentioned & vars(value).keys()]
            continue
        if isinstance(value, CPUDispatcher):
            dispatcher: Any = value
            value = dispatcher.py_func
            yield value
        elif value is not function:
            continue
        mentioned = set(_names(value.__code__))
        known = [value.__globals__[name] for name in mentioned & value.__globals__.keys()]
        reached += [(item, mentioned) for item in [*known, *enclosed(value).values()]]


def _reaches(function: Any, swaps: Swaps, above: tuple[Any, ...]) -> bool:
    return (
        bool(_changes(function, "", swaps, above) or _cell_changes(function, "", swaps, above))
        or float in swaps
    )


def _copy(function: Any, module: str, swaps: Swaps, above: tuple[Any, ...]) -> types.FunctionType:
    known, cells = function.__globals__, function.__closure__
    changed = _changes(function, module, swaps, above)
    if changed:
        known = {**known, **changed}
    exchanged = _cell_changes(function, module, swaps, above)
    if exchanged:
        cells = tuple(exchanged.get(number, cell) for number, cell in enumerate(cells))
    code = _with_constants(function.__code__, swaps)
    copy = types.FunctionType(code, known, function.__name__, function.__defaults__, cells)
    copy.__module__ = module
    return copy


def _constant(value: Any, swaps: Swaps) -> Any:
    """A constant of another type, where it then is a number still."""
    if isinstance(value, types.CodeType):
        return _with_constants(value, swaps)
    if isinstance(value, tuple):
        return tuple(_constant(item, swaps) for item in value)
    if type(value) is not float or float not in swaps:
        return value
    with np.errstate(over="ignore", under="ignore"):
        other = swaps[float](value)
    return other if np.isfinite(other) and (other != 0.0) == (value != 0.0) else value


def _with_constants(code: types.CodeType, swaps: Swaps) -> types.CodeType:
    return code.replace(co_consts=tuple(_constant(value, swaps) for value in code.co_consts))


def _changes(function: Any, module: str, swaps: Swaps, above: tuple[Any, ...]) -> dict[str, Any]:
    """Globals that a copy sees otherwise."""
    names = set(_names(function.__code__))
    found = {}
    for name in names & function.__globals__.keys():
        value = function.__globals__[name]
        other = _instead(value, names, module, swaps, above)
        if other is not value:
            found[name] = other
    return found


def _cell_changes(function: Any, module: str, swaps: Swaps, above: tuple[Any, ...]) -> dict[int, Any]:
    """Variables of enclosing functions that a copy sees otherwise."""
    names = set(_names(function.__code__))
    found = {}
    for number, value in enumerate(enclosed(function).values()):
        other = _instead(value, names, module, swaps, above)
        if other is not value:
            found[number] = types.CellType(other)
    return found


def _names(code: types.CodeType) -> Iterator[str]:
    """Globals and attributes that code mentions, nested functions' too."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _names(constant)


def _instead(value: Any, names: set[str], module: str, swaps: Swaps, above: tuple[Any, ...]) -> Any:
    """What a copy sees in the place of ``value``: the same, unless it reaches a swapped function."""
    for old, new in swaps.items():
        if value is old and old is not float:
            return new
    if type(value) is float:
        return _constant(value, swaps)
    if isinstance(value, CPUDispatcher):
        dispatcher: Any = value
        function = dispatcher.py_func
        if value in above or not dispatcher._can_compile or not _reaches(function, swaps, (*above, value)):
            return value
        return numba.jit(**dispatcher.targetoptions)(_copy(function, module, swaps, (*above, value)))
    if isinstance(value, types.ModuleType):
        return _module_instead(value, names, module, swaps, above)
    return value


def _module_instead(
    value: types.ModuleType, names: set[str], module: str, swaps: Swaps, above: tuple[Any, ...]
) -> types.ModuleType:
    changed = {}
    for name in names & vars(value).keys() | ({old.__name__ for old in swaps} & names):
        item = getattr(value, name, None)
        other = item if isinstance(item, types.ModuleType) else _instead(item, names, module, swaps, above)
        if other is not item:
            changed[name] = other
    if not changed:
        return value
    copy = types.ModuleType(value.__name__)
    vars(copy).update(vars(value) | changed)
    return copy
