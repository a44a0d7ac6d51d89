"""Where a user's function decides: a copy of it that notes how far each decision is from turning over.

A step that passes a branch of the right-hand side has another error than its method's order tells, and one
that passes two has an error that no two runs tell. So the copy notes, at every comparison of values that
depend on time or state, the difference of its two sides and its outcome; ``abs``, ``min``, ``floor`` and
their like decide too. Equal outcomes at two points of a motion then mean that they lie on the same smooth
piece, and the differences tell how near it was to being left.

Whether a function decides anything, by its compiled code: the last word on what its source hides. Smooth
arithmetic compiles to arithmetic. Every jump and every kink needs one of few instructions: a comparison of
floating-point numbers, a conversion to a whole number, a rounding, a magnitude, a sign, or a look at a
number's bits; or an inverse that folds: the root of a square, an angle by its own sine. What none of them
reaches from time or state is smooth, as far as its operations are: not where one has a pole.
"""

from __future__ import annotations

import ast
import builtins
import linecache
import math
import re
import types
from collections.abc import Collection
from typing import Any

import numba
import numpy as np
from numba import types as kinds
from numba.core.registry import CPUDispatcher

from fastmech.arrays import Floats, Integers
from fastmech.callee import CalleeType
from fastmech.jit import INLINED, VECTOR, inlined
from fastmech.kernels.rebuilding import enclosed, rebuilt
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


@inlined
def _less(seen: Floats, a: float, b: float) -> bool:
    outcome = a < b
    note(seen, a - b + 0.0, outcome + 0.0)
    return outcome


@inlined
def _at_most(seen: Floats, a: float, b: float) -> bool:
    outcome = a <= b
    note(seen, a - b + 0.0, outcome + 0.0)
    return outcome


@inlined
def _equal(seen: Floats, a: float, b: float) -> bool:
    note(seen, a - b + 0.0, (a < b) + 0.0)
    return a == b


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


#: What the copy calls in its own globals, and what one calls whose decisions nothing takes.
_HELPERS = {f"_fastmech{f.__name__}": f for f in (_less, _at_most, _equal, _beside, _whole)}
_BLIND: dict[str, Any] = dict.fromkeys(
    ("_fastmech_less", "_fastmech_at_most", "_fastmech_equal"), _blind_bool
)
_BLIND |= {"_fastmech_beside": _blind_beside, "_fastmech_whole": _blind_whole, "_fastmech_int": _blind_int}
#: Type of the first argument of such a copy.
BLIND: Any = kinds.Tuple((kinds.Array(kinds.int64, 1, "C"), VECTOR))  # type: ignore[no-untyped-call]

_COMPARED = {
    ast.Lt: ("_less", 1),
    ast.Gt: ("_less", -1),
    ast.LtE: ("_at_most", 1),
    ast.GtE: ("_at_most", -1),
    ast.Eq: ("_equal", 1),
    ast.NotEq: ("_equal", 1),
}

#: Functions by what they decide: the sign of an argument, between arguments, the integer below; and those
#: that decide nothing, or nothing that their arguments' decisions do not tell.
_SIGN = {"abs": 0, "absolute": 0, "fabs": 0, "sign": 0, "heaviside": 0, "copysign": 1, "signbit": 0}
_SIGN |= {"atan2": 0, "arctan2": 0}  # which jump from pi to -pi
_EXTREME = {"min", "max", "minimum", "maximum", "fmin", "fmax"}
_INTEGER = {"floor", "ceil", "trunc", "rint", "round", "int", "fix"}
_RATIO = {"fmod", "mod", "remainder"}
_SMOOTH = {
    *("sin", "cos", "tan", "asin", "acos", "atan", "arcsin", "arccos", "arctan"),
    *("sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "arcsinh", "arccosh", "arctanh", "sinc"),
    *("exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "sqrt", "cbrt", "pow", "power", "square"),
    *("hypot", "erf", "erfc", "gamma", "lgamma", "radians", "degrees", "deg2rad", "rad2deg", "float"),
    *("bool", "len", "range", "where", "isnan", "isfinite", "isinf", "zeros", "ones", "empty", "array"),
    *("dot", "sum", "add", "subtract", "multiply", "divide", "negative", "reciprocal"),
}


class UnclearError(Exception):
    """A function of which it cannot be told where it decides."""


def watching(function: Any, depend: set[str], blind: bool = False) -> tuple[types.FunctionType, int]:
    """A copy that takes the array of its notes as first argument, and how many places of it note.

    ``depend`` names the arguments that change on the way; what depends on others alone is no decision. In a
    ``blind`` copy the decisions that would be noted are taken by nothing that it computes.

    Raises:
        UnclearError: the source is not at hand, or it calls what is not known to be smooth.
    """
    node = _definition(function)
    known = {**function.__globals__, **enclosed(function)}
    watch = _Watch(known, _depending(node, depend), blind)
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
    return made, watch.places


def require_noted(function: Any, depend: set[str], arguments: list[Any]) -> bool:
    """Whether a function decides, having made sure that a copy notes where; ``arguments`` are numba's types.

    Raises:
        UnclearError: it decides, and it cannot be told where.
    """
    names = function.__code__.co_varnames[: len(arguments)]
    steady = {name for name in names if name not in depend}
    try:
        blind, places = watching(function, depend, blind=True)
        reason, given = "its compiled code decides where its source does not show it", [BLIND, *arguments]
    except UnclearError as unclear:
        blind, places, reason, given = function, 0, str(unclear), arguments
    if numba.config.DISABLE_JIT and blind is not function:  # type: ignore[attr-defined]
        return places > 0
    try:
        hidden = decides(blind, given, steady)
    except Exception:  # whatever numba does not understand
        hidden = True
    if hidden:
        raise UnclearError(reason)
    return places > 0


def _kind(value: Any) -> str:
    """What a function that is called decides: ``smooth``: nothing, ``""``: unknown, else its name."""
    name = getattr(value, "__name__", "")
    home = str(getattr(value, "__module__", None) or "").split(".")[0]
    if value in WITHIN:
        return "smooth"
    if not (isinstance(value, np.ufunc) or home in ("math", "numpy", "builtins")):
        return ""
    if name in _SMOOTH:
        return "smooth"
    return name if name in {*_SIGN, *_EXTREME, *_INTEGER, *_RATIO, "clip"} else ""


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
        raise UnclearError("its source is not at hand")
    definition: ast.FunctionDef | ast.Lambda = found[0]
    if isinstance(definition, ast.Lambda):
        returned = ast.Return(definition.body)
        return ast.FunctionDef("lambda_", definition.args, [returned], [])
    return definition


#: What is asked of an array, and does not change with its numbers.
_FIXED = ("ndim", "shape", "size")


def _names(node: ast.AST) -> set[str]:
    """Names on whose values an expression depends."""
    if isinstance(node, ast.Attribute) and node.attr in _FIXED:
        return set()
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "len":
        return set()
    own = {node.id} if isinstance(node, ast.Name) else set()
    return own.union(*map(_names, ast.iter_child_nodes(node)))


def _shared(*nodes: ast.AST) -> set[str]:
    """Names whose arrays or lists these expressions hand on, whole or in part."""
    found = set()
    for node in nodes:
        while isinstance(node, ast.Subscript | ast.Attribute | ast.Starred):
            node = node.value
        if isinstance(node, ast.Name):
            found.add(node.id)
    return found


def _written(*targets: ast.AST) -> set[str]:
    """Names that an assignment changes, whole or in part; the index of an item is none of them."""
    found = set()
    for target in targets:
        found |= _written(*target.elts) if isinstance(target, ast.Tuple | ast.List) else _shared(target)
    return found


def _depending(node: ast.FunctionDef, depend: set[str]) -> set[str]:
    """Names whose values depend on the arguments ``depend``.

    What is called may write what it is given into an array that it is given too, and two names may mean one
    array. So may names of its own that a function hands on; its arguments are its caller's to judge.
    """
    stored = {n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
    own = stored - {argument.arg for argument in node.args.args}
    found, before = set(depend), -1
    while len(found) != before:
        before = len(found)
        for part in ast.walk(node):
            if isinstance(part, ast.Assign) and _names(part.value) & found:
                found |= _written(*part.targets)
            elif isinstance(part, ast.Assign) and _shared(*part.targets) & found:
                found |= _shared(part.value) & own
            elif isinstance(part, ast.Call):
                given = [*part.args, *(keyword.value for keyword in part.keywords)]
                if any(_names(one) & found for one in given):
                    found |= (
                        _shared(*given, *([part.func] if isinstance(part.func, ast.Attribute) else [])) & own
                    )
            elif isinstance(part, ast.AugAssign | ast.AnnAssign | ast.NamedExpr):
                if part.value is not None and _names(part.value) & found:
                    found |= _written(part.target)
            elif isinstance(part, ast.For) and _names(part.iter) & found:
                found |= _names(part.target)
            elif isinstance(part, ast.If | ast.While) and _names(part.test) & found:
                # What is assigned in a branch depends on who took it.
                inside = ast.walk(ast.Module([*part.body, *part.orelse], []))
                found |= {n.id for n in inside if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
    return found


def _sum(parts: list[ast.expr]) -> ast.expr:
    total = parts[0]
    for part in parts[1:]:
        total = ast.BinOp(total, ast.Add(), part)
    return total


class _Watch(ast.NodeTransformer):
    """Puts notes into a function."""

    def __init__(self, known: dict[str, Any], depending: set[str], blind: bool) -> None:
        """``known`` are its globals, ``depending`` its names that change on the way."""
        self._known, self._depending, self._blind = known, depending, blind
        self.callees: dict[str, Any] = {}
        self.places = 0

    def _noting(self, helper: str, *arguments: ast.expr) -> ast.Call:
        self.places += 1
        seen: list[ast.expr] = [ast.Name("_fastmech_seen", ast.Load()), *arguments]
        return ast.Call(ast.Name(f"_fastmech{helper}", ast.Load()), seen, [])

    def _depends(self, node: ast.AST) -> bool:
        return bool(_names(node) & self._depending)

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        """Each comparison of a chain, whose middle parts are computed twice."""
        depends = self._depends(node)
        self.generic_visit(node)
        if not depends:
            return node
        pairs: list[ast.expr] = []
        for a, op, b in zip([node.left, *node.comparators], node.ops, node.comparators, strict=False):
            if type(op) not in _COMPARED:
                raise UnclearError(f"it compares in a way that is not known, line {node.lineno}")
            helper, sign = _COMPARED[type(op)]
            one: ast.expr = self._noting(helper, *((a, b) if sign > 0 else (b, a)))
            pairs.append(ast.UnaryOp(ast.Not(), one) if isinstance(op, ast.NotEq) else one)
        return pairs[0] if len(pairs) == 1 else ast.BoolOp(ast.And(), pairs)

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        """Remainders and whole quotients jump."""
        depends = self._depends(node)
        self.generic_visit(node)
        if depends and isinstance(node.op, ast.Mod | ast.FloorDiv):
            return self._ratio(node, "left", node.left, node.right)
        return node

    def _ratio(self, node: Any, place: str, a: ast.expr, b: ast.expr) -> Any:
        whole = self._noting("_whole", ast.BinOp(a, ast.Div(), b))
        if self._blind:
            return whole
        return ast.BinOp(node, ast.Add(), ast.BinOp(ast.Constant(0.0), ast.Mult(), whole))

    def visit_Call(self, node: ast.Call) -> ast.expr:
        """What is called decides by its arguments, or is a compiled function of the user's."""
        depends = [self._depends(argument) for argument in node.args]
        if not any(depends) and not any(self._depends(keyword.value) for keyword in node.keywords):
            return node
        value = self._value(node.func)
        kind = _kind(value)
        if isinstance(value, CPUDispatcher | types.FunctionType) and not kind:
            return self._watched(node, getattr(value, "py_func", value), depends)
        if not kind:
            raise UnclearError(
                f"it calls {ast.unparse(node.func)}, of which it is not known whether it is smooth"
            )
        self.generic_visit(node)
        args = node.args
        if kind in _SIGN and len(args) > _SIGN[kind]:
            args[_SIGN[kind]] = self._noting("_beside", args[_SIGN[kind]], ast.Constant(0.0))
            if self._blind:
                return _sum(args)
        elif kind in _INTEGER:
            if self._blind:
                home = getattr(value, "__module__", None) or "numpy"
                whole = home in ("math", "builtins") and len(args) == 1
                return self._noting("_int" if whole else "_whole", args[0])
            args[0] = self._noting("_whole", args[0])
        elif kind in _RATIO:
            return self._ratio(node, "args", *args)
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
        elif kind != "smooth":
            raise UnclearError(f"it calls {ast.unparse(node.func)} in a way that is not known")
        return node

    def _value(self, node: ast.expr) -> Any:
        """What a name, or an attribute of one, is before the function runs."""
        if isinstance(node, ast.Name):
            return self._known.get(node.id, vars(builtins).get(node.id))
        if isinstance(node, ast.Attribute):
            return getattr(self._value(node.value), node.attr, None)
        return None

    def _watched(self, node: ast.Call, function: Any, depends: list[bool]) -> ast.expr:
        """The call of a compiled function whose decisions are noted too."""
        if node.keywords:
            raise UnclearError(f"it calls {ast.unparse(node.func)} with names of arguments")
        names = function.__code__.co_varnames
        # An array made for the call may be written into by what is called.
        changes = [one or isinstance(part, ast.Call) for one, part in zip(depends, node.args, strict=True)]
        changing = {name for name, one in zip(names, changes, strict=False) if one}
        copy, places = watching(function, changing, self._blind)
        self.places += places
        name = f"_fastmech_callee{len(self.callees)}"
        self.callees[name] = numba.njit(**INLINED)(copy)
        self.generic_visit(node)
        return ast.Call(ast.Name(name, ast.Load()), [ast.Name("_fastmech_seen", ast.Load()), *node.args], [])
