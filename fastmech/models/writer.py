"""Compiled functions written from SymPy expressions.

What depends on parameters alone is computed once a trajectory: expressions keep *coefficients* of it. What is
left becomes plain assignments that share their common subexpressions, with one sine and cosine for each
angle, one root and one reciprocal of it for each radicand.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

import sympy
from sympy.printing.pycode import PythonCodePrinter

from fastmech.errors import InputError

#: Multiples of a coordinate in a sine whose sine is written by those of the coordinate itself.
HARMONICS = 4

#: Functions that the text may call; the engine has sine, cosine and exponential of its own.
FUNCTIONS = {
    "sin": "sin", "cos": "cos", "sqrt": "np.sqrt", "log": "np.log", "tan": "np.tan", "Abs": "abs",
    "asin": "np.arcsin", "acos": "np.arccos", "atan": "np.arctan", "atan2": "np.arctan2",
    "sinh": "np.sinh", "cosh": "np.cosh", "tanh": "np.tanh",
    "asinh": "np.arcsinh", "acosh": "np.arccosh", "atanh": "np.arctanh", "sign": "np.sign",
    "Min": "min", "Max": "max",
}  # fmt: skip

#: What expressions may have, by name and by kind.
KNOWN = (*FUNCTIONS, "exp", "Piecewise", "Heaviside")
PLAIN = sympy.Symbol | sympy.Number | sympy.NumberSymbol | sympy.Add | sympy.Mul | sympy.Pow


def refuse_unknown(where: str, expression: Any) -> None:
    """Refuse what cannot be written.

    Raises:
        InputError: the expression has a function or an operation that is not known here.
    """
    for part in sympy.preorder_traversal(expression):
        name = part.func.__name__
        known = name in KNOWN or name.startswith("function_") or isinstance(part, PLAIN)
        if isinstance(part, sympy.Expr) and not known:
            raise InputError(
                f"{where}: has {name}, which is not known here; functions are {', '.join(KNOWN)}"
            )


class Printer(PythonCodePrinter):  # type: ignore[misc]
    """Python text in which a number is ``<<0.5>>``, for :func:`fastmech.models.mechanism.in_precision`."""

    def doprint(self, expr: Any) -> str:
        """The text; derivatives may have functions that were not given."""
        refuse_unknown("equations", expr)
        return str(super().doprint(expr))

    def _number(self, value: Any) -> str:
        text = f"<<{float(value)!r}>>"
        return f"({text})" if value < 0 else text

    _print_Float = _print_Rational = _print_Integer = _print_Zero = _print_One = _print_NegativeOne = (  # noqa: N815
        lambda self, expr: self._number(expr)
    )
    _print_Half = _print_Pi = _print_Exp1 = _print_NumberSymbol = _print_Float  # noqa: N815

    def _print_Pow(self, expr: Any, **_: Any) -> str:
        base, power = expr.as_base_exp()
        if power.is_Integer and 1 < abs(power) <= 16:
            text = "*".join([f"({self._print(base)})"] * abs(int(power)))
            return f"({text})" if power > 0 else f"({self._number(1)}/({text}))"
        if power in (1, -1):
            return f"({self._number(1)}/({self._print(base)}))" if power < 0 else self._print(base)
        if (2 * power).is_Integer:
            rest, root = int(power - sympy.Rational(1, 2)), f"np.sqrt({self._print(base)})"
            return root if not rest else f"({root}*{self._print_Pow(sympy.Pow(base, rest, evaluate=False))})"
        return f"(({self._print(base)})**({self._print(power)}))"

    def _print_exp(self, expr: Any) -> str:
        """Of the time the engine's own, which is for what decays."""
        known = all(symbol.name == "t" or symbol.name.startswith("_k") for symbol in expr.free_symbols)
        return f"{'' if known else 'np.'}exp({self._print(expr.args[0])})"

    def _print_Function(self, expr: Any) -> str:
        name = FUNCTIONS.get(expr.func.__name__, expr.func.__name__)
        arguments = [self._print(argument) for argument in expr.args]
        if name in ("min", "max") and len(arguments) > 2:
            return f"{name}({arguments[0]}, {self._print_Function(expr.func(*expr.args[1:]))})"
        return f"{name}({', '.join(arguments)})"

    def _print_Piecewise(self, expr: Any) -> str:
        *cases, (last, _) = expr.args
        text = self._print(last)
        for value, condition in reversed(cases):
            text = f"({self._print(value)} if {self._print(condition)} else {text})"
        return text


for _name in ("sqrt", *FUNCTIONS):  # of which SymPy's printer has its own ways
    setattr(Printer, f"_print_{_name}", Printer._print_Function)

PRINTER = Printer({"fully_qualified_modules": False})


class WrittenCoefficients:
    """Parts of expressions that depend on parameters alone, each with a name."""

    def __init__(self, dynamic: Iterable[Any]) -> None:
        self._dynamic = frozenset(dynamic)
        self.named: dict[Any, Any] = {}  #: symbols by expression

    def lift(self, expression: Any) -> Any:
        """The expression with its coefficients' symbols."""
        own, rest = self._split(expression)
        return rest if own == 1 else self._name(own) * rest

    def _split(self, expression: Any) -> tuple[Any, Any]:
        """A coefficient before everything, in parameters still, and the rest, lifted."""
        if isinstance(expression, sympy.Expr) and not expression.free_symbols & self._dynamic:
            return expression, sympy.S.One
        if expression.is_Add:
            return self._sum(self._terms(expression))
        if expression.is_Mul:
            owns, rests = zip(*map(self._split, expression.args), strict=True)
            return sympy.Mul(*owns), sympy.Mul(*rests)
        if expression.is_Pow and expression.exp.is_Integer:
            own, rest = self._split(expression.base)
            return own**expression.exp, rest**expression.exp
        lifted = expression.func(*map(self.lift, expression.args)) if expression.args else expression
        return sympy.S.One, lifted

    def _terms(self, expression: Any) -> list[tuple[Any, Any]]:
        """Coefficients and the rest of all terms; a coefficient before a bracket with others goes inside."""
        found = []
        for term in sympy.Add.make_args(expression):
            own, rest = term.as_independent(*self._dynamic, as_Add=False)
            inner = self._terms(rest) if rest.is_Add else []
            if any(factor.free_symbols for factor, _ in inner):
                found += [(own * factor, part) for factor, part in inner]
            else:
                found.append((own, rest))
        return found

    def _sum(self, terms: list[tuple[Any, Any]]) -> tuple[Any, Any]:
        """Terms of the same coefficient together."""
        by_rest: dict[Any, Any] = {}
        for own, rest in terms:
            inner, part = self._split(rest)
            by_rest[part] = by_rest.get(part, 0) + own * inner
        by_own: dict[Any, list[Any]] = {}
        for rest, own in by_rest.items():
            number, factor = own.as_coeff_Mul()
            if factor.could_extract_minus_sign():
                number, factor = -number, -factor
            by_own.setdefault(factor, []).append(number * rest)
        sums = {}
        for factor, parts in by_own.items():
            number, part = sympy.Add(*parts).as_content_primitive()
            sums[factor] = number, part
        if len(sums) == 1:
            ((factor, (number, part)),) = sums.items()
            return factor * number, part
        named = (self._name(factor) * number * part for factor, (number, part) in sums.items())
        return sympy.S.One, sympy.Add(*named)

    def _name(self, expression: Any) -> Any:
        if not expression.free_symbols:
            return expression
        number, factor = expression.as_coeff_Mul()
        if factor.could_extract_minus_sign():
            number, factor = -number, -factor
        if factor not in self.named:
            self.named[factor] = sympy.Symbol(f"_k{len(self.named)}", real=True)
        return number * self.named[factor]


def simplest(expression: Any, q: Sequence[Any]) -> Any:
    """An expression, or what it becomes without squares of cosines, whichever takes less to compute.

    What stands under a root stays: of a sum of squares no rounding makes a negative number.
    """
    if not expression.has(sympy.sin, sympy.cos):
        return expression
    pairs = {a: sympy.symbols(f"_s{k} _c{k}", real=True) for k, a in enumerate(q)}
    into = {f(a): pair[k] for a, pair in pairs.items() for k, f in enumerate((sympy.sin, sympy.cos))}
    plain = expanded(expression, q).xreplace(into)
    roots = {root: sympy.Dummy(positive=True) for root in plain.atoms(sympy.Pow) if not root.exp.is_Integer}
    flat = sympy.expand(plain.xreplace(roots))
    for s, c in pairs.values():
        flat = flat.replace(
            lambda x, c=c: x.is_Pow and x.base == c and x.exp.is_Integer and x.exp > 1,
            lambda x, s=s: (1 - s**2) ** (x.exp // 2) * x.base ** (x.exp % 2),
        )
        flat = sympy.expand(flat)
    flat = flat.xreplace({dummy: root for root, dummy in roots.items()})
    lifted = WrittenCoefficients([*q, *into.values()])
    best = min((flat, plain), key=lambda e: sympy.count_ops(lifted.lift(e)))
    return best.xreplace({new: old for old, new in into.items()})


def expanded(expression: Any, q: Sequence[Any]) -> Any:
    """Sines and cosines of sums and multiples by those of the coordinates."""

    def small(x: Any) -> bool:
        found = [x.args[0].coeff(symbol) for symbol in q]
        return any(found) and all(c.is_Integer and abs(c) <= HARMONICS for c in found)

    expression = expression.replace(sympy.tan, lambda x: sympy.sin(x) / sympy.cos(x))
    expression = expression.replace(sympy.Heaviside, lambda x, *_: sympy.Piecewise((0, x < 0), (1, True)))
    expression = expression.replace(sympy.DiracDelta, lambda *_: sympy.S.Zero)
    return expression.replace(
        lambda x: isinstance(x, sympy.sin | sympy.cos) and not x.args[0].is_Symbol and small(x),
        lambda x: sympy.expand_trig(x),
    )


class StepBody:
    """A function's body: ``outputs`` assigned by name, of expressions in symbols that are its arguments."""

    def __init__(self, outputs: dict[str, Any]) -> None:
        values = [sympy.sympify(value) for value in outputs.values()]
        found = {x.args[0] for v in values for x in v.atoms(sympy.sin, sympy.cos)}
        self.angles: list[Any] = sorted(found, key=sympy.default_sort_key)
        swaps = {}
        for k, angle in enumerate(self.angles):
            for f in (sympy.sin, sympy.cos):
                swaps[f(angle)] = sympy.Symbol(f"_{f.__name__}{k}", real=True)
        values = [value.xreplace(swaps) for value in values]
        lines: list[tuple[str, Any]] = []
        for k, base in enumerate(self._radicands(values)):
            root, inverse = (sympy.Symbol(f"_{name}{k}", positive=True) for name in ("root", "inverse"))
            powers = {x.exp for v in values for x in v.atoms(sympy.Pow) if x.base == base}
            lines.append((root.name, sympy.sqrt(base)))
            if any(power < 0 for power in powers):
                lines.append((inverse.name, 1 / root))
            made = {}
            for power in powers:
                if (2 * power).is_Integer and power < 0:
                    made[base**power] = inverse ** (-2 * power)
                elif (2 * power).is_Integer and not power.is_Integer:
                    made[base**power] = root * base ** (power - sympy.Rational(1, 2))
            values = [value.xreplace(made) for value in values]
        shared, values = sympy.cse(values, symbols=sympy.numbered_symbols("_x", real=True))
        lines += [(name.name, value) for name, value in shared]
        self.lines = [*lines, *zip(outputs, values, strict=True)]  #: names and expressions, in an order

    @staticmethod
    def _radicands(values: list[Any]) -> list[Any]:
        """Of roots, but those that stand inside others."""
        powers = {x for v in values for x in v.atoms(sympy.Pow)}
        found = {x.base for x in powers if (2 * x.exp).is_Integer and not x.exp.is_Integer and x.free_symbols}
        inner = {base for base in found if any(base in x.atoms(sympy.Expr) for x in found - {base})}
        return sorted(found - inner, key=sympy.default_sort_key)

    def text(self, late: Iterable[str] = ()) -> tuple[list[str], list[str]]:
        """Lines, and those that depend on the names ``late``."""
        waiting, first, last = set(late), [], []
        for name, value in self.lines:
            line = f"{name} = {PRINTER.doprint(value)}"
            if waiting & {symbol.name for symbol in value.free_symbols}:
                waiting.add(name)
                last.append(line)
            else:
                first.append(line)
        return first, last

    def trigonometry(self, variant: str) -> list[str]:
        """Lines before them: sines and cosines of ``any`` size, ``within`` the packed range, or ``near``."""
        lines = []
        for k, angle in enumerate(self.angles):
            text, pair = PRINTER.doprint(angle), f"_sin{k}, _cos{k}"
            if variant == "any":
                lines.append(f"{pair} = sin({text}), cos({text})")
            elif variant == "within":
                lines += [f"_angle{k} = {text}", f"{pair} = sincos(_angle{k})"]
            else:
                given = [f"_kept[{3 * k + row}]" for row in range(3)]
                lines.append(f"{pair} = turned({given[0]}, {given[1]}, {text} - {given[2]})")
        if variant == "within":
            squares = " + ".join(f"_angle{k} * _angle{k}" for k in range(len(self.angles)))
            lines += ["_limit = reduction_limit(_angle0)", f"_beyond = {squares} > _limit * _limit"]
        return lines

    @property
    def kept(self) -> str:
        """What the packed loop keeps for the motion nearby."""
        return f"({', '.join(f'_sin{k}, _cos{k}, _angle{k}' for k in range(len(self.angles)))})"


class Texts:
    """Functions of a mechanism as text; of states and coefficients each takes one number each."""

    def __init__(self, coefficients: Sequence[str]) -> None:
        self._own = list(coefficients)
        self.written: dict[str, tuple[list[str], str]] = {}  #: coefficients that it takes, and text, by name

    def plain(self, name: str, arguments: Sequence[str], outputs: dict[str, Any], *after: str) -> None:
        """A function that gives the outputs, or what the last line of ``after`` tells."""
        body = StepBody(outputs)
        *more, result = after or (f"({', '.join(outputs)},)",)
        lines = [*body.trigonometry("any"), *body.text()[0], *more, f"return {result}"]
        self._function(name, arguments, self._used(lines), lines)

    def packed(self, name: str, arguments: Sequence[str], outputs: dict[str, Any], result: str) -> None:
        """A plain function, and one for packed loops, which tells first whether the sines do not reach."""
        self.plain(name, arguments, outputs, result)
        body = StepBody(outputs)
        variant, beyond = ("within", "_beyond") if body.angles else ("any", "False")
        lines = [*body.trigonometry(variant), *body.text()[0], f"return {beyond}, {result}[0]"]
        self._function(f"{name}_within", arguments, self._used(lines), lines)

    def motion(self, name: str, states: Sequence[str], body: StepBody, lines: list[str], result: str) -> None:
        """What :class:`fastmech.kernels.blocks.Rates` wants."""
        own = self._used([*lines, *body.trigonometry("any")])
        lines = [*lines, f"return {result}"]
        self._function(f"{name}_rates", ["t", *states], own, [*body.trigonometry("any"), *lines])
        if body.angles:
            within = [*body.trigonometry("within"), *lines[:-1], f"return _beyond, {result}, {body.kept}"]
            self._function(f"{name}_rates_within", ["t", *states], own, within)
            near = [*body.trigonometry("near"), *lines]
            self._function(f"{name}_rates_near", ["t", *states], own, near, ["_kept"])

    def coefficients(self, parameters: Sequence[str], found: Sequence[Any]) -> None:
        """The function that gives the coefficients, of parameters."""
        each = "".join(f"{PRINTER.doprint(expression)}, " for expression in found)
        self._function("coefficients", parameters, [], [f"return ({each})"])

    def _used(self, lines: list[str]) -> list[str]:
        names = set(re.findall(r"\b_k\d+\b", "\n".join(lines)))
        return [name for name in self._own if name in names]

    def _function(
        self, name: str, arguments: Sequence[str], own: list[str], lines: list[str], more: Sequence[str] = ()
    ) -> None:
        body = "".join(f"    {line}\n" for line in lines)
        self.written[name] = own, f"def {name}({', '.join([*arguments, *own, *more])}):\n{body}"
