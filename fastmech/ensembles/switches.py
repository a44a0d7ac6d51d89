"""Where a user's function decides: a copy of it that notes how far each decision is from turning over.

A step that passes a branch of the right-hand side has another error than its method's order tells, and one
that passes two has an error that no two runs tell. So the copy notes, at every comparison, the difference
of its two sides and its outcome; ``abs``, ``min``, ``floor`` and their like decide too. Equal outcomes at
two points of a motion then mean that they lie on the same smooth piece, and the differences tell how near
it was to being left.

Whether a function decides anything, by its compiled code: the last word on what its source hides. Smooth
arithmetic compiles to arithmetic. Every jump and every kink needs one of few instructions: a comparison of
floating-point numbers, a conversion to a whole number, a rounding, a magnitude, a sign, or a look at a
number's bits; or an inverse that folds: the root of a square, also as the length of one side, an angle by
its own sine. What none of them reaches from time or state is smooth, as far as its operations are: not
where one has a pole.
"""

from __future__ import annotations

import ast
import builtins
import linecache
import math
import operator
import re
import types
from collections.abc import Collection
from typing import Any

import numba
import numpy as np
from numba import types as kinds
from numba.core.registry import CPUDispatcher
from numba.extending import overload

from fastmech.arrays import Floats, Integers
from fastmech.callee import CalleeType
from fastmech.jit import INLINED, VECTOR, inlined
from fastmech.kernels.rebuilding import CHOSEN, enclosed, rebuilt
from fastmech.kernels.sincos import WITHIN, cos, sin

#: Instructions of LLVM that decide.
_DECIDES = re.compile(
    r"\b(?:fcmp|fptosi|fptoui)\b|bitcast (?:<\d+ x )?double.* to (?:<\d+ x )?i64"
    r"|@llvm\.(?:fabs|copysign|minnum|maxnum|minimum|maximum|floor|ceil|trunc|l?l?rint|nearbyint|l?l?round"
    r"|roundeven|is\.fpclass)\b"
)

#: LLVM makes a square root of the power 1/2, and asks first for the one number where they differ.
_ROOT = re.compile(r"fcmp (?:\w+ )*oeq double %\S+, 0xFFF0000000000000")

#: What compiled code may call: mathematics without jumps, memory, sums of products.
_SMOOTH_CALLS = re.compile(
    r"llvm\.\S+|a?(?:sin|cos|tan)h?|exp[2m1]*|log(?:2|10|1p)?|sqrt|cbrt|pow|hypot|erfc?|(?:numba_)?[tl]?gamma"
    r"|NRT_\w+|numba_xx(?:dot|gemv|gemm)|numba_gil_\w+|numba_fatal_error|Py_FatalError"
)

_NAME = r'%(?:"[^"]+"|[\w.$-]+)'

#: Smooth functions that make a kink or a jump of another one: the root of a square, an angle's own angle.
_INVERSE = re.compile(rf"call .*@(?:llvm\.)?(sqrt|a(?:sin|cos|tan))(?:\.f64)?\(double ({_NAME})\)")
_FOLDED = {"sqrt": re.compile(rf"fmul (?:\w+ )*double ({_NAME}), \1$")}
_LENGTH = re.compile(rf"@hypot\(double (?:0\.0*e\+00,|({_NAME}), double (?:\1|0\.0*e\+00)\))")
_TURNING = re.compile(r"call .*@(?:llvm\.)?(?:sin|cos|tan)(?:\.f64)?\(")


def decides(function: Any, arguments: list[Any], steady: Collection[str]) -> bool:
    """Whether a function of ``arguments``, numba's types, decides by others than those called ``steady``.

    What numba does not understand may do so.
    """
    # Trigonometry as the mathematics library has it: the package's own looks whether angles are large.
    plain = rebuilt(function, __name__, {sin: math.sin, cos: math.cos, **CHOSEN})
    options: Any = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "error_model": "numpy"}
    options["fastmath"] = {"nsz"}  # NaN stays: asking for it is a decision
    try:
        made: Any = numba.njit(tuple(arguments), **options)(plain)
    except Exception:  # numba lets those of the code it looks at pass
        return True
    text = made.inspect_llvm(made.signatures[0])
    outside = re.findall(r"^declare .*?@([\w.$]+)\(", text, re.MULTILINE)
    if not all(_SMOOTH_CALLS.fullmatch(name) for name in outside):
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
        # Without the blocks that a merged value comes from.
        values = re.findall(_NAME, re.sub(rf", {_NAME} \]", "", instruction))
        return any(changes(name) for name in values)

    def folds(instruction: str) -> bool:
        """Whether it is the inverse of the function that made what it is given, and folds there."""
        if _LENGTH.search(instruction):
            return True
        inverse = _INVERSE.search(instruction)
        return bool(inverse and _FOLDED.get(inverse[1], _TURNING).search(made.get(inverse[2], "")))

    return any(
        reaches(rest)
        for rest in made.values()
        if (_DECIDES.search(rest) and not _ROOT.search(rest)) or folds(rest)
    )


#: Decisions of a call that are noted at most.
MOST_NOTES = 64

#: ``switches(t, y, params, seen)`` notes the decisions of one trajectory in state ``y`` (dim,).
SWITCHES_SIGNATURE = kinds.void(kinds.float64, VECTOR, VECTOR, VECTOR)
SWITCHES = CalleeType(SWITCHES_SIGNATURE)


@inlined
def note(seen: Floats, value: float, outcome: float) -> None:
    """Add a decision to ``seen``: [number, value, outcome, value, outcome, ...]."""
    k = int(seen[0])
    seen[0] = k + 1
    if k < MOST_NOTES:
        seen[1 + 2 * k], seen[2 + 2 * k] = value, outcome


def _comparing(compare: Any) -> Any:
    """A comparison that is noted; ``==`` by which side is less."""
    side = operator.lt if compare is operator.eq else compare

    def compared(seen: Floats, a: float, b: float) -> bool:
        note(seen, a - b + 0.0, side(a, b) + 0.0)
        return compare(a, b)

    return inlined(compared)


@inlined
def _beside(seen: Floats, a: float, b: float) -> float:
    """``a``, noted as less than ``b`` or not."""
    note(seen, a - b + 0.0, (a < b) + 0.0)
    return a


@inlined
def _whole(seen: Floats, x: float) -> float:
    """``x``, noted as a number that changes sides at integers and half way between them."""
    note(seen, math.sin(2.0 * math.pi * x), (math.sin(2.0 * math.pi * x) < 0.0) + 0.0)
    return x


@inlined
def _part(seen: Floats, part: float, ratio: float) -> float:
    """A remainder or a whole quotient, noted by its ratio."""
    _whole(seen, ratio)
    return part


@inlined
def _among(seen: Floats, x: float, knots: Floats) -> float:
    """``x``, noted by the knots (rising) beside it: how far it is from the nearer and the other."""
    above: Any = np.searchsorted(knots, x)
    low, high = x - knots[max(above - 1, 0)], x - knots[min(above, knots.size - 1)]
    note(seen, low if low < -high else high, above + 0.0)
    note(seen, high if low < -high else low, above + 0.0)
    return x


Blind = tuple[Integers, Floats]


@inlined
def _blind_bool(seen: Blind, a: float, b: float) -> bool:
    seen[1][0] = a - b  # what the sides hide is computed still
    return seen[0][0] > 0


@inlined
def _blind_beside(seen: Blind, a: float, b: float) -> float:
    seen[1][0] = a - b
    return a


@inlined
def _blind_whole(seen: Blind, x: float) -> float:
    seen[1][0] = x
    return seen[0][0] + 0.0


@inlined
def _blind_int(seen: Blind, x: float) -> int:
    seen[1][0] = x
    return seen[0][0]


def _blind_part(seen: Blind, part: float, ratio: float) -> float:
    raise NotImplementedError


@overload(_blind_part, jit_options=INLINED, strict=False)
def _blind_part_of_its_type(seen: Any, part: Any, ratio: Any) -> Any:
    blind = _blind_int if isinstance(part, kinds.Integer) else _blind_whole
    return lambda seen, part, ratio: blind(seen, ratio)


#: What the copy calls in its own globals, and what one calls whose decisions nothing takes.
_HELPERS: dict[str, Any] = {f"_fastmech{f.__name__}": f for f in (_beside, _whole, _part, _among)}
_HELPERS |= {f"_fastmech_{f.__name__}": _comparing(f) for f in (operator.lt, operator.le, operator.eq)}
_BLIND: dict[str, Any] = dict.fromkeys(("_fastmech_lt", "_fastmech_le", "_fastmech_eq"), _blind_bool)
_BLIND |= {"_fastmech_beside": _blind_beside, "_fastmech_whole": _blind_whole}
_BLIND |= {"_fastmech_int": _blind_int, "_fastmech_part": _blind_part}
#: Type of the first argument of such a copy.
BLIND: Any = kinds.Tuple((kinds.Array(kinds.int64, 1, "C"), VECTOR))  # type: ignore[no-untyped-call]

_COMPARED = {
    ast.Lt: ("_lt", 1),
    ast.Gt: ("_lt", -1),
    ast.LtE: ("_le", 1),
    ast.GtE: ("_le", -1),
    ast.Eq: ("_eq", 1),
    ast.NotEq: ("_eq", 1),
}
_COMPARING: dict[str, type[ast.cmpop]] = {"less": ast.Lt, "less_equal": ast.LtE, "equal": ast.Eq}
_COMPARING |= {"greater": ast.Gt, "greater_equal": ast.GtE, "not_equal": ast.NotEq}

#: Functions by what they decide: the sign of the first argument, between arguments, the integer below, knots;
#: and those that decide nothing, or nothing that their arguments' decisions do not tell.
_SIGN = {*("abs", "absolute", "fabs", "sign", "heaviside", "copysign", "signbit")}
_SIGN |= {"atan2", "arctan2"}  # which jump from pi to -pi
_EXTREME = {"min", "max", "minimum", "maximum", "fmin", "fmax"}
_INTEGER = {"floor", "ceil", "trunc", "rint", "round", "int", "fix"}
_RATIO = {"fmod", "mod", "remainder"}
_DECIDING = {*_SIGN, *_EXTREME, *_INTEGER, *_RATIO, *_COMPARING, "clip", "where", "interp"}
_SMOOTH = {
    *("sin", "cos", "tan", "asin", "acos", "atan", "arcsin", "arccos", "arctan"),
    *("sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "arcsinh", "arccosh", "arctanh", "sinc"),
    *("exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "sqrt", "cbrt", "pow", "power", "square"),
    *("hypot", "erf", "erfc", "gamma", "lgamma", "radians", "degrees", "deg2rad", "rad2deg", "float"),
    *("bool", "len", "range", "isnan", "isfinite", "isinf", "zeros", "ones", "empty", "array"),
    *("dot", "sum", "add", "subtract", "multiply", "divide", "negative", "reciprocal"),
}


#: What makes a decision plain.
ADVICE = "write what decides as `a if c else b`"


class UnclearError(Exception):
    """A function of which it cannot be told where it decides."""


def watching(function: Any, blind: bool = False) -> tuple[types.FunctionType, int, str]:
    """A copy that takes the array of its notes as first argument; how many places note; what is unclear.

    In a ``blind`` copy the decisions that would be noted are taken by nothing that it computes.

    Raises:
        UnclearError: the source is not at hand.
    """
    node = _definition(function)
    known = {**function.__globals__, **enclosed(function)}
    watch = _Watch(known, blind)
    body = [watch.visit(part) for part in node.body]
    copy = ast.FunctionDef(node.name, node.args, body, [])
    copy.args.args.insert(0, ast.arg("_fastmech_seen"))
    for argument in copy.args.args:
        argument.annotation = None
    module: Any = ast.fix_missing_locations(ast.Module([copy], []))
    place = {**known, **(_BLIND if blind else _HELPERS), **watch.callees}
    exec(compile(module, function.__code__.co_filename, "exec"), place)
    made = place[node.name]
    made.__defaults__, made.__module__ = function.__defaults__, __name__
    return made, watch.places, watch.unclear


def require_noted(function: Any, depend: set[str], arguments: list[Any]) -> bool:
    """Whether a function decides, having made sure that a copy notes where; ``arguments`` are numba's types.

    ``depend`` names the arguments that change on the way; what depends on others alone is no decision.

    Raises:
        UnclearError: it decides, and it cannot be told where.
    """
    names = function.__code__.co_varnames[: len(arguments)]
    steady = {name for name in names if name not in depend}
    compiles = not numba.config.DISABLE_JIT  # type: ignore[attr-defined]
    if compiles and steady and not decides(function, arguments, steady):
        return False
    try:
        blind, places, unclear = watching(function, blind=True)
    except UnclearError:
        if compiles and not decides(function, arguments, steady):
            return False
        raise
    if compiles and decides(blind, [BLIND, *arguments], steady):
        hidden = f"its compiled code decides where its source does not show it; {ADVICE}"
        raise UnclearError(unclear or hidden)
    return places > 0


def _kind(value: Any) -> str:
    """What a function that is called decides: ``smooth``: nothing, ``""``: unknown, else its name."""
    name = getattr(value, "__name__", "")
    home = str(getattr(value, "__module__", None) or "").split(".")[0]
    if value in WITHIN:
        return "smooth"
    if not (isinstance(value, np.ufunc) or home in ("math", "numpy", "builtins")):
        return ""
    return "smooth" if name in _SMOOTH else name if name in _DECIDING else ""


def _definition(function: Any) -> ast.FunctionDef:
    """The part of the source that defines a function; of a lambda the function that it is."""
    code = function.__code__
    try:
        tree = ast.parse("".join(linecache.getlines(code.co_filename, function.__globals__)))
    except SyntaxError:
        raise UnclearError("its source cannot be read") from None
    key = code.co_firstlineno, code.co_name, list(code.co_varnames[: code.co_argcount])
    found: list[Any] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.Lambda):
            first = min([node.lineno, *(d.lineno for d in getattr(node, "decorator_list", []))])
            if (first, getattr(node, "name", "<lambda>"), [a.arg for a in node.args.args]) == key:
                found.append(node)
    if len(found) != 1:
        raise UnclearError("its source is not at hand; define it in a file")
    definition: ast.FunctionDef | ast.Lambda = found[0]
    if isinstance(definition, ast.Lambda):
        returned = ast.Return(definition.body)
        return ast.FunctionDef("lambda_", definition.args, [returned], [])
    return definition


def _sum(parts: list[ast.expr]) -> ast.expr:
    total = parts[0]
    for part in parts[1:]:
        total = ast.BinOp(total, ast.Add(), part)
    return total


class _Watch(ast.NodeTransformer):
    """Puts notes into a function."""

    def __init__(self, known: dict[str, Any], blind: bool) -> None:
        """``known`` are the function's globals."""
        self._known, self._blind = known, blind
        self.callees: dict[str, Any] = {}
        self.places = 0
        self.unclear = ""  #: why the first call or comparison is left as it is of which nothing is known

    def _noting(self, helper: str, *arguments: ast.expr) -> ast.Call:
        self.places += 1
        seen: list[ast.expr] = [ast.Name("_fastmech_seen", ast.Load()), *arguments]
        return ast.Call(ast.Name(f"_fastmech{helper}", ast.Load()), seen, [])

    def _left(self, node: ast.expr, why: str, advice: str = f"; {ADVICE}") -> ast.expr:
        self.unclear = self.unclear or f"{why}, line {node.lineno}{advice}"
        return node

    def visit(self, node: ast.AST) -> Any:
        """Functions inside it, and comprehensions, are left to what compiled code tells."""
        inside = ast.FunctionDef | ast.Lambda | ast.ListComp | ast.GeneratorExp
        return node if isinstance(node, inside) else super().visit(node)

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        """Each comparison of a chain, whose middle parts are computed twice."""
        self.generic_visit(node)
        if not all(type(op) in _COMPARED for op in node.ops):
            return self._left(node, "it compares in a way that is not known")
        pairs: list[ast.expr] = []
        for a, op, b in zip([node.left, *node.comparators], node.ops, node.comparators, strict=False):
            helper, sign = _COMPARED[type(op)]
            one: ast.expr = self._noting(helper, *((a, b) if sign > 0 else (b, a)))
            pairs.append(ast.UnaryOp(ast.Not(), one) if isinstance(op, ast.NotEq) else one)
        return pairs[0] if len(pairs) == 1 else ast.BoolOp(ast.And(), pairs)

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        """Remainders and whole quotients jump."""
        self.generic_visit(node)
        jumps = isinstance(node.op, ast.Mod | ast.FloorDiv)
        return self._ratio(node, node.left, node.right) if jumps else node

    def _ratio(self, node: ast.expr, a: ast.expr, b: ast.expr) -> ast.expr:
        part = ast.BinOp(a, ast.Add(), b) if self._blind else node  # of the same type
        return self._noting("_part", part, ast.BinOp(a, ast.Div(), b))

    def visit_Call(self, node: ast.Call) -> ast.expr:
        """What is called decides by its arguments, or is a compiled function of the user's."""
        value, called, args = self._value(node.func), ast.unparse(node.func), node.args
        kind = _kind(value)
        if kind in _COMPARING and len(args) == 2:
            compared = ast.Compare(args[0], [_COMPARING[kind]()], args[1:])
            return self.visit_Compare(ast.copy_location(compared, node))
        self.generic_visit(node)
        if kind == "where" and len(args) == 3:
            return ast.IfExp(*args)
        if isinstance(value, CPUDispatcher | types.FunctionType) and not kind:
            return self._watched(node, getattr(value, "py_func", value))
        if not kind:
            return self._left(node, f"it calls {called}, of which it is not known whether it is smooth")
        if kind in _SIGN and args:
            both = 2 if kind == "copysign" else 1  # it is the size of the one and the sign of the other
            args[:both] = [self._noting("_beside", arg, ast.Constant(0.0)) for arg in args[:both]]
            if self._blind:
                return _sum(args)
        elif kind in _INTEGER:
            if self._blind:
                home = getattr(value, "__module__", None) or "numpy"
                whole = home in ("math", "builtins") and len(args) == 1
                return self._noting("_int" if whole else "_whole", args[0])
            args[0] = self._noting("_whole", args[0])
        elif kind in _RATIO:
            return self._ratio(node, *args)
        elif kind in _EXTREME and len(args) > 1:
            folded = args[0]
            for other in args[1:]:
                beside = [folded, self._noting("_beside", other, folded)]
                folded = _sum(beside) if self._blind else ast.Call(node.func, beside, [])
            return folded
        elif kind == "clip" and len(args) == 3:
            args[0] = self._noting("_beside", self._noting("_beside", *args[:2]), args[2])
            if self._blind:
                return args[0]
        elif kind == "interp" and all(isinstance(self._value(a), np.ndarray) for a in args[1:]):
            if self._blind:
                return self._noting("_whole", args[0])
            args[0] = self._noting("_among", *args[:2])
        elif kind != "smooth":
            return self._left(node, f"it calls {called} in a way that is not known")
        return node

    def _value(self, node: ast.expr) -> Any:
        """What a name, or an attribute of one, is before the function runs."""
        if isinstance(node, ast.Name):
            return self._known.get(node.id, vars(builtins).get(node.id))
        if isinstance(node, ast.Attribute):
            return getattr(self._value(node.value), node.attr, None)
        return None

    def _watched(self, node: ast.Call, function: Any) -> ast.expr:
        """The call of a compiled function whose decisions are noted too."""
        if node.keywords:
            return self._left(node, f"it calls {ast.unparse(node.func)} with names of arguments")
        try:
            copy, places, unclear = watching(function, self._blind)
        except UnclearError as why:
            return self._left(node, f"it calls {ast.unparse(node.func)}: {why}", "")
        self.places += places
        self.unclear = self.unclear or unclear
        name = f"_fastmech_callee{len(self.callees)}"
        self.callees[name] = numba.njit(**INLINED)(copy)
        return ast.Call(ast.Name(name, ast.Load()), [ast.Name("_fastmech_seen", ast.Load()), *node.args], [])
