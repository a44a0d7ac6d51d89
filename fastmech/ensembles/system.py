"""Your own system: a right-hand side written as a small Python function, run by the same engine."""

from __future__ import annotations

import hashlib
import inspect
import os
import sys
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numba
import numpy as np

from fastmech.ensembles.fingerprint import fingerprint
from fastmech.ensembles.run import NOTHING, Observation
from fastmech.errors import InputError
from fastmech.jit import inlined
from fastmech.kernel_cache import cache_directory

_TEMPLATE = '''"""Made by fastmech: block kernels of {name!r}, whose functions are ``rhs`` and ``stop``."""

from fastmech.ensembles.stopping import note_stop
from fastmech.jit import OBSERVER_SIGNATURE, RHS_SIGNATURE, kernel


@kernel(RHS_SIGNATURE)
def block(t, Y, dY, p):
    for i in range(Y.shape[1]):
        derivatives = rhs({arguments})
{stores}
'''

_STOP_TEMPLATE = """

@kernel(OBSERVER_SIGNATURE)
def observe(t, Y, params, record):
    fresh = 0
    for i in range(Y.shape[1]):
        fresh |= (float(stop({arguments})) != 0.0) & (record[0, i] == 0.0)
    if fresh:
        for i in range(Y.shape[1]):
            note_stop(float(stop({arguments})), t, Y, record, i)
"""


@dataclass(frozen=True, eq=False)
class System:
    """A system of ordinary differential equations of your own.

    Attributes:
        rhs: ``rhs(t, *state, *parameters)`` gives the derivatives as a tuple, one for each state; plain
            arithmetic on floats. Use :func:`fastmech.sin` and :func:`fastmech.cos`, and values chosen by
            ``a if condition else b`` instead of branches: then the loop over trajectories becomes packed
            instructions.
        state: names of the states.
        parameters: the parameters' values by name; ``rhs`` takes arguments of these names after the states.
        stop: ``stop(t, *state)`` gives 0 while the trajectory runs on, any other number as the code of why it
            stops; it is looked at after every step. A trajectory that has stopped costs nothing any more.

    Raises:
        InputError: names do not match the functions' arguments, or a function cannot be compiled.
    """

    rhs: Callable[..., tuple[float, ...]]
    state: Sequence[str]
    parameters: Mapping[str, float]
    stop: Callable[..., float] | None = None

    def __post_init__(self) -> None:
        _check_names("state", list(self.state), least=1)
        _check_names("parameters", list(self.parameters), least=0)
        _check_arguments("rhs", self.rhs, list(self.state), list(self.parameters))
        if self.stop is not None:
            _check_arguments("stop", self.stop, list(self.state), [])

    @property
    def kernel(self) -> Any:
        """The compiled block right-hand side."""
        return self._compiled.block

    @property
    def observation(self) -> Observation:
        """What is watched while the system runs: its stopping condition, if it has one."""
        if self.stop is None:
            return NOTHING
        record = np.zeros(2 + len(self.state))
        return Observation(self._compiled.observe, np.zeros(0), record, stops=True)

    @cached_property
    def _compiled(self) -> types.ModuleType:
        """The system's kernels, loaded from the disk cache where they are there.

        Numba keeps on disk only what comes from a file, so the kernels' source is written into the cache
        directory under a name made from everything that the user's functions depend on.
        """
        source = self._source()
        functions: list[Any] = [self.rhs] if self.stop is None else [self.rhs, self.stop]
        prints = [source, *(fingerprint(function) for function in functions)]
        digest = hashlib.sha256("\0".join(prints).encode()).hexdigest()[:16]
        path = cache_directory() / "systems" / f"system_{digest}.py"
        _write_once(path, source)
        module = types.ModuleType(f"fastmech_{path.stem}")
        compilable = [inlined(_copy(function, module.__name__)) for function in functions]
        vars(module).update(zip(("rhs", "stop"), compilable, strict=False), __file__=str(path))
        sys.modules[module.__name__] = module  # where numba looks when it loads a kernel from the disk
        try:
            exec(compile(source, path, "exec"), vars(module))
        except numba.core.errors.NumbaError as error:
            reason = " ".join(str(error).split())
            raise InputError(
                "rhs or stop: cannot be compiled (arithmetic, numpy and math only; functions that it "
                f"calls need numba.njit): {reason[:200]}"
            ) from None
        return module

    def _source(self) -> str:
        states = [f"Y[{d}, i]" for d in range(len(self.state))]
        order = list(inspect.signature(self.rhs).parameters)[1 + len(self.state) :]
        given = [f"p[{list(self.parameters).index(name)}, i]" for name in order]
        stores = [f"        dY[{d}, i] = derivatives[{d}]" for d in range(len(self.state))]
        text = _TEMPLATE.format(
            name=getattr(self.rhs, "__name__", "rhs"),
            arguments=", ".join(["t", *states, *given]),
            stores="\n".join(stores),
        )
        return text + (_STOP_TEMPLATE.format(arguments=", ".join(["t", *states])) if self.stop else "")


def _check_names(field: str, names: list[str], least: int) -> None:
    if len(names) < least or len(set(names)) < len(names) or not all(str(n).isidentifier() for n in names):
        raise InputError(f"{field} = {names}: must be different Python names, at least {least}")


def _check_arguments(field: str, function: Any, state: list[str], parameters: list[str]) -> None:
    """Arguments are matched by name: a value never lands in the wrong place silently."""
    if not isinstance(function, types.FunctionType):
        raise InputError(f"{field} = {function!r}: must be a plain Python function")
    taken = list(inspect.signature(function).parameters)
    if taken[1 : 1 + len(state)] != state or sorted(taken[1 + len(state) :]) != sorted(parameters):
        wanted = ", ".join(["t", *state, *parameters])
        raise InputError(f"{field}: takes ({', '.join(taken)}), must take ({wanted})")


def _copy(function: types.FunctionType, module: str) -> types.FunctionType:
    """A function object of its own, said to be of ``module``.

    Numba compiles one object once, whatever becomes of its globals; and a kernel from the disk wants to
    import the module of every function in it, which for the user's may be a notebook.
    """
    code, known = function.__code__, function.__globals__
    copy = types.FunctionType(code, known, function.__name__, function.__defaults__, function.__closure__)
    copy.__module__ = module
    return copy


def _write_once(path: Path, source: str) -> None:
    """The file keeps its first time stamp: numba takes a newer one for a changed source."""
    if path.exists():
        return
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        aside = path.with_suffix(f".{os.getpid()}.tmp")
        aside.write_text(source, encoding="utf-8")
        os.replace(aside, path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None
