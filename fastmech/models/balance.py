"""A mechanism's forces at rest, their Jacobian and its energy in intervals: kernels from expressions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import lru_cache, reduce
from math import inf, isfinite, nextafter
from typing import TYPE_CHECKING, Any

import sympy
from sympy.simplify.fu import TR8

from fastmech.errors import InputError, shown
from fastmech.generated import new_module, run_module
from fastmech.intervals import arithmetic
from fastmech.intervals.arithmetic import Interval
from fastmech.models.statics import Statics

if TYPE_CHECKING:
    from fastmech.models.mechanism import Mechanism

_SOURCE = '''"""Made by fastmech: {about}, in intervals."""

from fastmech.intervals.arithmetic import {operations}
from fastmech.intervals.search import {signature}
from fastmech.jit import EXACT, kernel


@kernel({signature}, **EXACT)
def {head}:
{body}
'''

#: Jump of a potential, over its parts, that is rounding of the numbers in it.
ROUNDED = 1e-14

_SAME_NAME = ("sign", "sin", "cos", "exp", "log", "asin", "acos", "atan", "sinh", "cosh", "tanh")
_FUNCTIONS = {getattr(sympy, name): name for name in (*_SAME_NAME, "asinh", "acosh", "atanh")}
_FUNCTIONS |= {sympy.Abs: "absolute", sympy.Heaviside: "step"}


class _Chosen(sympy.Function):  # type: ignore[misc]
    """``_Chosen(c, a, b)``: a where c is positive, else b; its slope knows of the jump between them."""

    @classmethod
    def eval(cls, c: Any, a: Any, b: Any) -> Any:
        return (a if c > 0 else b) if c.is_number and c != 0 else None

    def _eval_derivative(self, s: Any) -> Any:
        c, a, b = self.args
        return _Chosen(c, a.diff(s), b.diff(s)) + sympy.DiracDelta(c) * (a - b) * c.diff(s)


class _Angle(sympy.Function):  # type: ignore[misc]
    """atan2, whose slope knows of the jump left of the origin."""

    def fdiff(self, argindex: int = 1) -> Any:
        y, x = self.args
        if argindex == 2:
            return -y / (x**2 + y**2)
        return x / (x**2 + y**2) - 2 * sympy.pi * sympy.DiracDelta(y) * sympy.Heaviside(-x)


class _Jump(sympy.Function):  # type: ignore[misc]
    """``_Jump(c, g)``: the slope of a potential that jumps where c is zero, if g is 1 and not 0 there."""

    def _eval_derivative(self, s: Any) -> Any:
        return self if self.args[0].has(s) else sympy.S.Zero


def balance_kernel(statics: Statics) -> Any:
    """``forces(q, p, f, J)`` writes enclosures of forces (n, 2) and Jacobian (n, n, 2) over a box (n, 2).

    The box ``q`` and the parameters ``p`` (count, 2) are intervals. Where a force cannot be zero the kernel
    returns False and does not write ``J``.

    Raises:
        InputError: an expression has a function or a symbol of which no enclosure is known.
    """
    return _made("balance", source(statics)).forces


def energy_kernel(mechanism: Mechanism) -> Any:
    """``energy(q, v, p, found)`` writes the least and the greatest T + U, loads at their means, over a box.

    Coordinates ``q`` and rates ``v`` (n, 2) and parameters ``p`` (count, 2) are intervals. Raises as
    :func:`balance_kernel`.
    """
    statics = mechanism.statics()
    names = _names(statics)
    rates = [sympy.Symbol(f"{coordinate.symbol}_dot", real=True) for coordinate in statics.coordinates]
    names |= {symbol: f"v{i}" for i, symbol in enumerate(rates)}
    whole = _untangled(mechanism.energy())
    still = whole.xreplace(dict.fromkeys(rates, 0))
    _, written, (kinetic, potential) = _shared([whole - still, _sums(still)], names)
    lines = [*_unpacked(statics), *(f"v{i} = v[{i}, 0], v[{i}, 1]" for i in range(len(rates)))]
    lines += written.values()
    lines.append(f"found[0], found[1] = add({_text(kinetic, names)}, {_text(potential, names)})")
    about = "energy of a mechanism, loads at their means"
    return _made("energy", _written(about, "ENERGY_SIGNATURE", "energy(q, v, p, found)", lines)).energy


def enclosing(statics: Statics, expressions: Sequence[Any]) -> str:
    """Text of a function that bounds expressions of coordinates and parameters over boxes."""
    names = _names(statics)
    given = ", ".join(names.values())
    _, written, outputs = _shared([_sums(_untangled(x)) for x in expressions], names)
    lines = "".join(f"    {line}\n" for line in written.values())
    texts = ", ".join(_text(output, names) for output in outputs)
    return f"def found({given}):\n{lines}    return [{texts}]\n"


def enclosures(values: Sequence[Interval], text: str) -> Callable[[Any], list[Interval]]:
    """The function of such a text over boxes (n, 2 or more), for ranges of the parameters' values."""
    known: dict[str, Any] = {name: getattr(arithmetic, name) for name in arithmetic.OPERATIONS}
    exec(text, known)

    def bounds(box: Any) -> list[Interval]:
        found: list[Interval] = known["found"](*((float(x[0]), float(x[1])) for x in box), *values)
        return found

    return bounds


def range_of(mechanism: Mechanism, expression: Any, domain: Any) -> Interval:
    """Bounds of an expression of coordinates and parameters over a box (n, 2 or more)."""
    values = [(value, value) for value in mechanism.parameters.values()]
    return enclosures(values, enclosing(mechanism.statics(), [expression]))(domain)[0]


@lru_cache(maxsize=256)
def _made(kind: str, text: str) -> Any:
    """The module of a text, run once."""
    return run_module(new_module(kind, text), text)


def _written(about: str, signature: str, head: str, lines: list[str]) -> str:
    """A module's text."""
    operations, body = ", ".join(arithmetic.OPERATIONS), "\n".join(f"    {line}" for line in lines)
    return _SOURCE.format(about=about, signature=signature, head=head, operations=operations, body=body)


def _shared(
    expressions: Sequence[Any], names: dict[Any, str]
) -> tuple[list[tuple[Any, Any]], dict[Any, str], list[Any]]:
    """Common subexpressions by symbols, whose names are added, lines that assign them, and what is left."""
    shared, outputs = sympy.cse(expressions, symbols=sympy.numbered_symbols("x", real=True))
    names |= {symbol: f"x{i}" for i, (symbol, _) in enumerate(shared)}
    return shared, {symbol: f"{names[symbol]} = {_text(x, names)}" for symbol, x in shared}, outputs


def _names(statics: Statics) -> dict[Any, str]:
    """Coordinates and parameters by what the texts call them."""
    names = {coordinate.symbol: f"q{i}" for i, coordinate in enumerate(statics.coordinates)}
    return names | {symbol: f"p{i}" for i, symbol in enumerate(statics.parameters)}


def _unpacked(statics: Statics) -> list[str]:
    """Lines that make pairs of arrays' rows."""
    each = (("q", statics.coordinates), ("p", statics.parameters))
    return [f"{k}{i} = {k}[{i}, 0], {k}[{i}, 1]" for k, x in each for i in range(len(x))]


def source(statics: Statics) -> str:
    """The kernel's source: subexpressions are shared, and what only the Jacobian needs comes last."""
    statics = jumping(statics)
    q = [coordinate.symbol for coordinate in statics.coordinates]
    n = len(q)
    given = (statics.forces, statics.also, (statics.regular,))
    forces, also, (regular,) = ([_sums(_joined(_untangled(x))) for x in each] for each in given)
    jacobian = [_joined(force.diff(symbol)) for force in forces for symbol in q]
    if regular.free_symbols:
        jacobian[0] += sympy.DiracDelta(regular)  # no bounds where it may vanish
    names = _names(statics)
    shared, written, outputs = _shared([*forces, *also, *jacobian], names)
    first = n + len(also)
    needed = set().union(*(output.free_symbols for output in outputs[:first]))
    for symbol, expression in reversed(shared):
        needed |= expression.free_symbols if symbol in needed else set()
    lines = _unpacked(statics)
    lines += [written[symbol] for symbol, _ in shared if symbol in needed]
    for i, force in enumerate(outputs[:n]):
        lines.append(f"f[{i}, 0], f[{i}, 1] = {_text(force, names)}")
    lines += [f"g{i}, h{i} = {_text(output, names)}" for i, output in enumerate(outputs[n:first])]
    ends = [(f"f[{i}, 0]", f"f[{i}, 1]") for i in range(n)] + [(f"g{i}", f"h{i}") for i in range(len(also))]
    nowhere = " or ".join(f"{low} > 0.0 or {high} < 0.0" for low, high in ends)
    lines += [f"if {nowhere}:", "    return False"]
    lines += [written[symbol] for symbol, _ in shared if symbol not in needed]
    for k, slope in enumerate(outputs[first:]):
        lines.append(f"J[{k // n}, {k % n}, 0], J[{k // n}, {k % n}, 1] = {_text(slope, names)}")
    about = "forces of a mechanism at rest and their Jacobian"
    return _written(about, "FORCES_SIGNATURE", "forces(q, p, f, J)", [*lines, "return True"])


def _untangled(x: Any) -> Any:
    """In functions of which bounds are known, and whose slopes have bounds only where they have no jump."""
    x = sympy.sympify(x).replace(sympy.tan, lambda angle: sympy.sin(angle) / sympy.cos(angle))
    x = x.replace(sympy.atan2, _Angle).replace(sympy.Piecewise, _choice)
    return x.replace(lambda part: part.is_Mul and part.has(sympy.sinh), _ratio)


def _choice(*cases: Any) -> Any:
    """A ``Piecewise``; where no condition holds it is its last, as in motions."""
    (found, _), *others = reversed(cases)
    for value, condition in others:
        found = _where(condition, value, found)
    return found


def _where(condition: Any, a: Any, b: Any) -> Any:
    """``a`` where a condition holds, else ``b``."""
    if isinstance(condition, sympy.StrictGreaterThan | sympy.GreaterThan):
        return _Chosen(condition.lhs - condition.rhs, a, b)
    if isinstance(condition, sympy.StrictLessThan | sympy.LessThan):
        return _Chosen(condition.rhs - condition.lhs, a, b)
    if isinstance(condition, sympy.And):
        return reduce(lambda found, part: _where(part, found, b), condition.args, a)
    if isinstance(condition, sympy.Or):
        return reduce(lambda found, part: _where(part, a, found), condition.args, b)
    raise _unbounded(condition)


def _ratio(product: Any) -> Any:
    """With sinh / cosh as tanh, which is bounded closely."""
    for factor in product.args:
        if factor.func is sympy.sinh and 1 / sympy.cosh(factor.args[0]) in product.args:
            return product / factor * sympy.cosh(factor.args[0]) * sympy.tanh(factor.args[0])
    return product


def jumping(statics: Statics) -> Statics:
    """With the slopes of jumps of the potential in its forces, which then have no bounds where it may jump.

    SymPy's derivatives of pieces do not have them, nor are there any where the pieces' slopes are alike.
    """
    forces = list(statics.forces)
    for stored in statics.stored:
        if not stored.has(sympy.Piecewise, sympy.atan2, sympy.sign, sympy.Heaviside):
            continue
        term = _untangled(stored).replace(sympy.sign, lambda c: _Chosen(c, 1, -1))
        term = term.replace(sympy.Heaviside, lambda c, *_: _Chosen(c, 1, 0))
        for part in sorted(term.atoms(_Chosen, _Angle), key=sympy.default_sort_key):
            border, first, second = part.args if part.func is _Chosen else (part.args[0], sympy.pi, -sympy.pi)
            size = term.xreplace({part: first}) - term.xreplace({part: second})
            gate = _gate(size, border)
            if part.func is _Angle and gate != 0:
                gate = _Chosen(-part.args[1], gate, 0)
            if gate != 0:
                for i, coordinate in enumerate(statics.coordinates):
                    forces[i] += _Jump(border, gate) * border.diff(coordinate.symbol)
    return statics._replace(forces=tuple(forces), stored=())


def _gate(size: Any, border: Any) -> Any:
    """1, but 0 where a size is shown to vanish on a border, for each choice of pieces that it has."""
    inner = max(size.atoms(_Chosen), key=sympy.count_ops, default=None)
    if inner is None:
        return sympy.Integer(not _vanishes(size, border, ROUNDED))
    alike = [x for x in size.atoms(_Chosen) if x.args[0] == inner.args[0]]
    a, b = (_gate(size.xreplace({x: x.args[k] for x in alike}), border) for k in (1, 2))
    return a if a == b else _Chosen(inner.args[0], a, b)


def _joined(x: Any) -> Any:
    """Without the slopes of jumps of what is zero where it would jump, as the force of a contact is."""
    x = sympy.sympify(x)
    for jump in sorted(x.atoms(sympy.DiracDelta), key=sympy.default_sort_key):
        mark = sympy.Dummy()
        if _vanishes(x.xreplace({jump: mark}).diff(mark), jump.args[0]):
            x = x.xreplace({jump: sympy.S.Zero})
    return x


def _vanishes(x: Any, border: Any, rounded: float = 0.0) -> bool:
    """Whether an expression is shown to be zero, within a share of its parts, where a border is."""
    exact = {number: sympy.Rational(number) for number in (x - border).atoms(sympy.Float)}
    x, border = x.xreplace(exact), sympy.expand(border.xreplace(exact))
    places = [{border: sympy.S.Zero}]
    for term in sympy.Add.make_args(border):
        number, rest = term.as_coeff_Mul()
        if rest.free_symbols:
            places.append({rest: rest - border / number})
    try:
        scale = max(map(abs, sympy.expand(x).as_coefficients_dict().values())) if rounded else 0
        for place in places:
            # What jumps on the border itself has either of its values there, not those of SymPy.
            jumps = [y for y in x.atoms(sympy.sign, sympy.Heaviside) if y.args[0].xreplace(place).is_zero]
            left = sympy.expand(x.xreplace({y: sympy.Dummy() for y in jumps}).xreplace(place))
            if all(abs(part) <= rounded * scale for part in left.as_coefficients_dict().values()):
                return True
    except ValueError:  # SymPy compares numbers alone
        pass
    return False


def _sums(x: Any) -> Any:
    """Products of sines and cosines as sums, if that is shorter: angles occur less often, bounds are closer.

    Quotients and roots stay: expanded, they are bounded worse. What is in them becomes sums by itself.
    """
    if _whole(x):
        return min(x, sympy.expand(TR8(sympy.expand(x))), key=sympy.count_ops)
    if x.is_Add or x.is_Mul:
        plain = x.func(*(part for part in x.args if _whole(part)))
        return x.func(_sums(plain), *(_sums(part) for part in x.args if not _whole(part)))
    return x.func(*map(_sums, x.args))


def _whole(x: Any) -> bool:
    """Whether an expression has no quotients and no roots."""
    return all(power.exp.is_Integer and power.exp > 0 for power in x.atoms(sympy.Pow))


def _text(x: Any, names: dict[Any, str]) -> str:
    """An expression as calls of interval operations."""
    if x in names:
        return names[x]
    if x.is_Symbol:
        raise InputError(f"forces: {shown(str(x))} is neither a coordinate nor a parameter")
    if x.is_Number or x in (sympy.pi, sympy.E):
        return _constant(x)
    if x.is_Add:
        first, *others = sorted(x.args, key=lambda term: term.could_extract_minus_sign())
        text = _text(first, names)
        for term in others:
            minus = term.could_extract_minus_sign()
            text = f"{'sub' if minus else 'add'}({text}, {_text(-term if minus else term, names)})"
        return text
    if x.is_Mul:
        sign, factors = ("neg({})", (-x).as_ordered_factors()) if x.args[0] == -1 else ("{}", x.args)
        above: list[str] = []
        below: list[str] = []
        for factor in factors:
            falls = factor.is_Pow and factor.exp.is_Rational and factor.exp < 0
            (below if falls else above).append(_text(1 / factor if falls else factor, names))
        text = reduce("mul({}, {})".format, above or ["(1.0, 1.0)"])
        return sign.format(f"div({text}, {reduce('mul({}, {})'.format, below)})" if below else text)
    if x.is_Pow and x.exp.is_Rational and x.exp.q <= 2:
        if x.exp < 0:
            return f"div((1.0, 1.0), {_text(1 / x, names)})"
        base = _text(x.base, names)
        if x.exp.q == 2:
            base = f"sqrt({base})"
        return base if x.exp.p == 1 else f"power({base}, {x.exp.p})"
    if x.is_Pow:
        return f"raised({_text(x.base, names)}, {_text(x.exp, names)})"
    if isinstance(x, sympy.Max | sympy.Min):
        sign = "neg({})" if isinstance(x, sympy.Min) else "{}"
        each = [sign.format(_text(part, names)) for part in x.args]
        return sign.format(reduce("greatest({}, {})".format, each))
    if x.func in (_Chosen, _Angle):
        given = ", ".join(_text(part, names) for part in x.args)
        return f"{'chosen' if x.func is _Chosen else 'atan2'}({given})"
    if x.func in _FUNCTIONS:
        return f"{_FUNCTIONS[x.func]}({_text(x.args[0], names)})"
    if x.func is _Jump:
        border, gate = (_text(part, names) for part in x.args)
        return f"chosen(sub({gate}, (0.5, 0.5)), div((0.0, 0.0), {border}), (0.0, 0.0))"
    if x.func is sympy.DiracDelta:  # slope of a jump: zero, and unbounded where it jumps
        return f"div((0.0, 0.0), {_text(x.args[0], names)})"
    raise _unbounded(x)


def _unbounded(x: Any) -> InputError:
    what = x.func.__name__ if x.is_Function else str(x)
    return InputError(
        f"forces: {shown(what)} has no proved bounds; known are sums, products, powers, sin, cos, tan, asin, "
        "acos, atan, atan2, sinh, cosh, tanh, asinh, acosh, atanh, exp, log, Abs, sign, Max, Min, Heaviside, "
        "and Piecewise by inequalities, of coordinates and parameters"
    )


def _constant(x: Any) -> str:
    """An exact number as the least interval of floating-point numbers."""
    if x in (sympy.pi, sympy.E):
        value = float(x)
        return f"({nextafter(value, -inf)!r}, {nextafter(value, inf)!r})"
    if x.is_Float or not x.is_finite:
        value = float(x)
        if not isfinite(value):
            raise InputError(f"forces: {shown(str(x))} is not a finite number")
        return f"({value!r}, {value!r})"
    exact, value = Fraction(int(x.p), int(x.q)), float(x)
    low = value if value <= exact else nextafter(value, -inf)
    return f"({low!r}, {value if value >= exact else nextafter(value, inf)!r})"
