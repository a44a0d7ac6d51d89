"""What a right-hand side costs, counted in arithmetic operations: the same on every machine."""

from __future__ import annotations

import types
from typing import Any

import numpy as np

from fastmech.integrators.method import Adams, ImplicitRungeKutta, Method
from fastmech.kernels.rebuilding import rebuilt
from fastmech.kernels.sincos import cos, sin

#: Operations of the mechanism's equations: additions and products, two divisions and two sine-cosine pairs,
#: those counted as below.
MECHANISM = 110.0

#: Operations of a right-hand side that takes arrays, for each state: they are not counted.
VECTOR_RHS = 10.0

#: Operations that a product with a row of an Adams method's history takes the time of: it lies in memory. Of
#: ``fm.work_precision``'s rates on Henon and Heiles' system and on the mechanism, beside ``dop853``'s.
HISTORY = 1.7

#: Operations that a division, and a function such as sine or root, take the time of.
DIVISION, FUNCTION = 5.0, 20.0

#: Time of an implicit step in right-hand sides of an explicit one: its iterations with their Jacobians and
#: small linear systems. Measured for ``radau5`` on the mechanism at steps that suit 1e-4 to 1e-8.
IMPLICIT_STEP = 75.0


class _Counted:
    """A number that counts what is done with it."""

    def __init__(self, value: float, count: list[float]) -> None:
        self.value, self.count = value, count

    def _made(self, value: Any, operations: float) -> Any:
        self.count[0] += operations
        return _Counted(value, self.count)

    def __float__(self) -> float:
        """Asked for by the functions of :mod:`math`."""
        self.count[0] += FUNCTION
        return float(self.value)

    def __bool__(self) -> bool:
        return bool(self.value)

    def __hash__(self) -> int:
        return hash(self.value)

    def __getattr__(self, name: str) -> Any:
        """NumPy calls the method ``sin`` of what is no number of its own."""
        function = getattr(np, name, None)
        if name.startswith("_") or not isinstance(function, np.ufunc):
            raise AttributeError(name)
        return lambda: self._made(function(self.value), FUNCTION)


def _operator(name: str, operations: float) -> Any:
    def operate(self: _Counted, *others: Any) -> Any:
        plain = [other.value if isinstance(other, _Counted) else other for other in others]
        return self._made(getattr(np.float64(self.value), name)(*plain), operations)

    return operate


for _name in ("add", "sub", "mul", "lt", "le", "gt", "ge", "eq", "ne", "neg", "abs", "pos"):
    setattr(_Counted, f"__{_name}__", _operator(f"__{_name}__", 1.0))
for _name in ("radd", "rsub", "rmul"):
    setattr(_Counted, f"__{_name}__", _operator(f"__{_name}__", 1.0))
for _name in ("truediv", "rtruediv", "mod", "rmod", "floordiv", "rfloordiv"):
    setattr(_Counted, f"__{_name}__", _operator(f"__{_name}__", DIVISION))
for _name in ("pow", "rpow"):
    setattr(_Counted, f"__{_name}__", _operator(f"__{_name}__", 2.0))


def operations_of(rhs: types.FunctionType, arguments: list[float]) -> float:
    """Operations of one call of a user's right-hand side with these arguments, where they can be counted.

    Else (it calls what takes only floats) ten for each argument.
    """
    count = [0.0]
    given = [_Counted(value, count) for value in arguments]
    called: Any = {sin: lambda x: np.sin(x), cos: lambda x: np.cos(x)}  # NumPy asks the number itself
    try:
        with np.errstate(all="ignore"):
            rebuilt(rhs, __name__, called)(*given)
    except Exception:  # whatever a user's function may raise: then nothing is known
        return VECTOR_RHS * len(arguments)
    return max(count[0], 1.0)


def step_operations(method: Method, operations: float, dim: int) -> float:
    """Operations of a step: its right-hand sides, and its sums over stages or history."""
    if isinstance(method, ImplicitRungeKutta):
        return IMPLICIT_STEP * operations
    if isinstance(method, Adams):
        sums = 2 if method.corrects else 1
        return sums * (operations + HISTORY * method.rows * dim)
    tableau: Any = getattr(method, "tableau")  # noqa: B009
    weights = sum(1 for row in (*tableau.a, tableau.b) for weight in row if weight)
    return float(tableau.stages * operations + weights * dim)


def start_operations(method: Method, operations: float, dim: int) -> float:
    """Operations of an Adams method's start beside the steps that it replaces; 0 of others."""
    if not isinstance(method, Adams):
        return 0.0
    per_step = method.starter.stages * (operations + 0.5 * method.starter.stages * dim)
    return float(method.start_steps * per_step)
