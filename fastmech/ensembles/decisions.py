"""Whether a function decides anything, by its compiled code: the last word on what its source hides.

Smooth arithmetic compiles to arithmetic. Every jump and every kink needs one of few instructions: a
comparison of floating-point numbers, a conversion to a whole number, a rounding, a magnitude, a sign, or a
look at a number's bits; or an inverse that folds: the root of a square, an angle by its own sine. What none
of them reaches from time or state is smooth, as far as its operations are: not where one has a pole.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from typing import Any

import numba

from fastmech.kernels.rebuilding import rebuilt
from fastmech.kernels.sincos import cos, sin

#: Instructions of LLVM that decide.
_DECIDES = re.compile(
    r"\b(?:fcmp|fptosi|fptoui)\b|bitcast (?:<\d+ x )?double.* to (?:<\d+ x )?i64"
    r"|@llvm\.(?:fabs|copysign|minnum|maxnum|minimum|maximum|floor|ceil|trunc|l?l?rint|nearbyint|l?l?round"
    r"|roundeven|is\.fpclass)\b"
)

#: LLVM makes a square root of the power 1/2, and asks first for the one number where they differ.
_ROOT = re.compile(r"fcmp (?:\w+ )*oeq double %\S+, 0xFFF0000000000000")

#: What compiled code may call: mathematics without jumps, memory, sums of products.
_SMOOTH = re.compile(
    r"llvm\.\S+|a?(?:sin|cos|tan)h?|exp[2m1]*|log(?:2|10|1p)?|sqrt|cbrt|pow|hypot|erfc?|(?:numba_)?[tl]?gamma"
    r"|NRT_\w+|numba_xx(?:dot|gemv|gemm)|numba_gil_\w+|numba_fatal_error|Py_FatalError"
)

_NAME = r'%(?:"[^"]+"|[\w.$-]+)'

#: Smooth functions that make a kink or a jump of another one: the root of a square, an angle's own angle.
_INVERSE = re.compile(rf"call .*@(?:llvm\.)?(sqrt|a(?:sin|cos|tan))(?:\.f64)?\(double ({_NAME})\)")
_FOLDED = {"sqrt": re.compile(rf"fmul (?:\w+ )*double ({_NAME}), \1$")}
_TURNING = re.compile(r"call .*@(?:llvm\.)?(?:sin|cos|tan)(?:\.f64)?\(")


def decides(function: Any, arguments: list[Any], steady: Collection[str]) -> bool:
    """Whether a function of ``arguments``, numba's types, decides by others than those called ``steady``.

    Errors of the compiler pass.
    """
    # Trigonometry as the mathematics library has it: the package's own looks whether angles are large.
    plain = rebuilt(function, __name__, {sin: math.sin, cos: math.cos})
    options: Any = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "error_model": "numpy"}
    options["fastmath"] = {"nsz"}  # NaN stays: asking for it is a decision
    made: Any = numba.njit(tuple(arguments), **options)(plain)
    text = made.inspect_llvm(made.signatures[0])
    outside = re.findall(r"^declare .*?@([\w.$]+)\(", text, re.MULTILINE)
    if not all(_SMOOTH.fullmatch(name) for name in outside):
        return True
    return any(_decides(body, steady) for body in re.split(r"^define ", text, flags=re.MULTILINE)[1:])


def _decides(body: str, steady: Collection[str]) -> bool:
    """The same of one function of LLVM's, of which ``%arg.x`` is the argument x, or ``%arg.x.4`` a part."""
    made = dict(re.findall(rf"^  ({_NAME}) = (.*)$", body, re.MULTILINE))
    known: dict[str, bool] = {}

    def changes(name: str) -> bool:
        """Whether a value is of what is not steady; one that waits for itself adds nothing."""
        if name not in known:
            known[name] = False
            known[name] = reaches(made[name]) if name in made else name.split(".")[1] not in steady
        return known[name]

    def reaches(instruction: str) -> bool:
        if "alloca " in instruction or "@NRT_" in instruction:  # whatever has been written there
            return True
        values = re.sub(rf", {_NAME} \]", "", instruction)  # without the places that a phi comes from
        return any(changes(name) for name in re.findall(_NAME, values))

    def folds(instruction: str) -> bool:
        """Whether it is the inverse of the function that made what it is given, and folds there."""
        inverse = _INVERSE.search(instruction)
        return bool(inverse and _FOLDED.get(inverse[1], _TURNING).search(made.get(inverse[2], "")))

    deciding = {
        name
        for name, rest in made.items()
        if (_DECIDES.search(rest) and not _ROOT.search(rest)) or folds(rest)
    }
    return any(reaches(made[name]) for name in deciding)
