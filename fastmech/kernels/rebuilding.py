"""Copies of a user's functions, for kernels that must not depend on where the functions come from."""

from __future__ import annotations

import dis
import hashlib
import itertools
import os
import time
import types
from collections.abc import Callable, Iterator
from typing import Any

import numba
import numpy as np
from numba import types as kinds
from numba.core.registry import CPUDispatcher
from numba.extending import overload

from fastmech.errors import InputError
from fastmech.jit import INLINED

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


#: Functions to be called in the place of others; that of ``float`` makes constants another type.
Swaps = dict[Callable[..., Any], Callable[..., Any]]


def chosen(condition: Any, x: Any, y: Any) -> Any:
    """What ``np.where`` gives; of single numbers without the arrays that numba makes of them."""
    return np.where(condition, x, y)


@overload(chosen, jit_options=INLINED, strict=False)
def _chosen(condition: Any, x: Any, y: Any) -> Any:
    single = isinstance(x, kinds.Number) and isinstance(y, kinds.Number)
    if single and isinstance(condition, kinds.Number | kinds.Boolean):
        return lambda condition, x, y: x if condition else y
    return lambda condition, x, y: np.where(condition, x, y)


#: Holds for every compiled copy of a user's function.
CHOSEN: Swaps = {np.where: chosen}


def rebuilt(
    function: types.FunctionType, module: str, swaps: Swaps, plain: bool = False
) -> types.FunctionType:
    """A function object of its own, said to be of ``module``, that calls others where ``swaps`` tells.

    Numba compiles one object once, whatever becomes of its globals; and a kernel from the disk wants to
    import the module of every function in it, which for the user's may be a notebook. Compiled functions
    that the function calls are rebuilt with it where they reach a swapped one; those given types of their
    own stay as they are. ``plain`` gives all of them uncompiled.
    """
    return _Rebuilder(module, swaps, plain).copy(function)


def reaches(function: types.FunctionType, swaps: Swaps) -> bool:
    """Whether a copy calls anything in the place of something else."""
    return _Rebuilder("", swaps).reaches(function)


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


def _names(code: types.CodeType) -> Iterator[str]:
    """Globals and attributes that code mentions, nested functions' too."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _names(constant)


class _Rebuilder:
    """Makes copies that are said to be of one module, with the same swaps."""

    def __init__(self, module: str, swaps: Swaps, plain: bool = False) -> None:
        self._module, self._swaps, self._plain = module, swaps, plain
        self._above: list[Any] = []  # compiled functions that are being copied

    def copy(self, function: Any) -> types.FunctionType:
        """The copy of a function."""
        known, cells = self._changes(function)
        code, closure = function.__code__, function.__closure__
        if cells:
            own = zip(code.co_freevars, closure, strict=True)
            closure = tuple(types.CellType(cells[name]) if name in cells else cell for name, cell in own)
        known = {**function.__globals__, **known} if known else function.__globals__
        made = self._constant(code)
        copy = types.FunctionType(made, known, function.__name__, function.__defaults__, closure)
        copy.__module__ = self._module
        return copy

    def reaches(self, function: Any) -> bool:
        """Whether its copy differs."""
        return any(self._changes(function)) or float in self._swaps

    def _changes(self, function: Any) -> tuple[dict[str, Any], dict[str, Any]]:
        """Globals, and variables of enclosing functions, that a copy sees otherwise."""
        names, known = set(_names(function.__code__)), function.__globals__
        mentioned = {name: known[name] for name in names & known.keys()}
        return self._changed(mentioned, names), self._changed(enclosed(function), names)

    def _changed(self, values: dict[str, Any], names: set[str]) -> dict[str, Any]:
        others = {name: self._instead(value, names) for name, value in values.items()}
        return {name: other for name, other in others.items() if other is not values[name]}

    def _constant(self, value: Any) -> Any:
        """A constant of another type, where it then is a number still."""
        if isinstance(value, types.CodeType):
            return value.replace(co_consts=tuple(self._constant(item) for item in value.co_consts))
        if isinstance(value, tuple):
            return tuple(self._constant(item) for item in value)
        if type(value) is not float or float not in self._swaps:
            return value
        with np.errstate(over="ignore", under="ignore"):
            other = self._swaps[float](value)
        return other if np.isfinite(other) and (other != 0.0) == (value != 0.0) else value

    def _instead(self, value: Any, names: set[str]) -> Any:
        """What a copy sees in the place of ``value``: the same, unless it reaches a swapped function."""
        for old, new in self._swaps.items():
            if value is old and old is not float:
                return new
        if type(value) is float:
            return self._constant(value)
        if isinstance(value, types.ModuleType):
            return self._module_instead(value, names)
        if not isinstance(value, CPUDispatcher):
            return value
        dispatcher: Any = value
        if value in self._above or not (self._plain or dispatcher._can_compile):
            return value
        self._above.append(value)
        try:
            if self._plain:
                return self.copy(dispatcher.py_func)
            if not self.reaches(dispatcher.py_func):
                return value
            return numba.jit(**dispatcher.targetoptions)(self.copy(dispatcher.py_func))
        finally:
            self._above.pop()

    def _module_instead(self, value: types.ModuleType, names: set[str]) -> types.ModuleType:
        own = names & vars(value).keys() | ({old.__name__ for old in self._swaps} & names)
        items = {name: getattr(value, name, None) for name in own}
        changed = self._changed(
            {name: item for name, item in items.items() if not isinstance(item, types.ModuleType)}, names
        )
        if not changed:
            return value
        copy = types.ModuleType(value.__name__)
        vars(copy).update(vars(value) | changed)
        return copy
