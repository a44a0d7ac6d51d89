"""Kernels as arguments of kernels: a driver is given its right-hand side as an address.

Numba takes compiled functions as arguments too, but looks each one up anew at every call, with the
interpreter's lock held: that takes as long as a step of many lanes. Of a :class:`Callee` it reads one number.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core import cgutils
from numba.core import config as numba_config
from numba.experimental.function_type import FunctionModel
from numba.extending import NativeValue, register_model, unbox


class CalleeType(types.FunctionType):
    """The type of an argument that is called: a first-class function whose address is known."""


register_model(CalleeType)(FunctionModel)


class Callee:
    """A kernel as an argument of kernels."""

    __slots__ = ("_kernel", "_numba_type_", "address")

    def __init__(self, kernel: Any) -> None:
        """Of a kernel of one signature, which it keeps alive."""
        kernel.make()
        (compiled,) = kernel.overloads.values()
        self._kernel = kernel
        self._numba_type_ = CalleeType(compiled.signature)
        self.address = compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name)


def _address(typ: Any, obj: Any, c: Any) -> Any:
    make: Any = cgutils.create_struct_proxy
    function = make(typ)(c.context, c.builder)
    address = c.pyapi.object_getattr_string(obj, "address")
    function.jit_addr = c.pyapi.long_as_voidptr(address)
    c.pyapi.decref(address)
    value: Any = NativeValue
    return value(function._getvalue())


_unbox: Any = unbox
_unbox(CalleeType)(_address)


def callee(kernel: Any) -> Any:
    """A kernel of one signature as an argument of kernels; in Python the function itself."""
    settings: Any = numba_config
    if settings.DISABLE_JIT:
        return kernel
    known = getattr(kernel, "callee", None)
    if known is None:
        known = kernel.callee = Callee(kernel)
    return known


def entry(kernel: Any) -> Any:
    """The compiled function of a kernel of one signature, which is called without a look at types.

    That look takes longer at tuples of arrays than a small run of a few steps. Arguments must be of the
    kernel's types, arrays in C order: only the size of their numbers is checked.
    """
    settings: Any = numba_config
    if settings.DISABLE_JIT:
        return kernel
    kernel.make()
    (compiled,) = kernel.overloads.values()
    return compiled.entry_point
