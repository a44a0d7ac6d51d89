"""Equations of motion of a mechanism, derived by SymPy and written as functions.

With the metric a, T = a_ij q_i' q_j' / 2, Lagrange's equations are a_ij q_j'' = r_i with

    r_i = Q_i - dU/dq_i - dD/dq_i' + sum of F dx/dq_i - (da_ij/dq_k - da_jk/dq_i / 2) q_j' q_k',

and Hamilton's q' = a^-1 p, p_i' = (da_jk/dq_i) q_j' q_k' / 2 + the forces.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import sympy

from fastmech.errors import InputError
from fastmech.loads import Function, Sampled
from fastmech.models.elements import ElementParts
from fastmech.models.statics import Coordinate, Statics
from fastmech.models.writer import StepBody, Texts, WrittenCoefficients, expanded, simplest


class Derived(NamedTuple):
    """Texts of a mechanism's functions, with numbers for :func:`fastmech.models.mechanism.in_precision`.

    Of states, coefficients and parameters each function takes one number each, in their order.
    """

    coefficients: tuple[str, ...]  #: their names
    functions: dict[str, tuple[list[str], str]]  #: the coefficients that it takes, and text, by name


class Equations(NamedTuple):
    """The pieces of the equations of motion as expressions."""

    metric: Any  #: matrix a
    forces: list[Any]  #: generalized forces without those of inertia, loads as symbols
    inertia: list[Any]  #: (da_ij/dq_k - da_jk/dq_i / 2) q_j' q_k'
    gain: list[Any]  #: (da_jk/dq_i) q_j' q_k' / 2
    loads: list[Any]  #: symbols of the loads' values
    means: dict[Any, Any]  #: their values at rest


#: Of friction in a plane that stays as motion stops.
NO_DIRECTION = (
    "dissipation, generalized_forces: friction has no direction where rates are zero, as that of "
    "c * sqrt(x.dot**2 + y.dot**2); let it fade with the speed, "
    "c * sqrt(x.dot**2 + y.dot**2 + e**2), or act along a coordinate, c * Abs(x.dot)"
)


def equations(parts: ElementParts, q: Sequence[Any], v: Sequence[Any], means: Sequence[Any]) -> Equations:
    """From energies and forces.

    Raises:
        InputError: the kinetic energy is not quadratic in the rates.
    """
    n, rest = len(q), dict.fromkeys(v, 0)
    metric = sympy.zeros(n)
    for i in range(n):
        for j in range(i + 1):
            entry = sympy.diff(parts.kinetic, v[i], v[j])
            if entry.free_symbols & {*v}:
                entry = sympy.simplify(entry)
            metric[i, j] = metric[j, i] = parts.metric[i, j] + _by_terms(entry, q)
    for i in range(n):
        if metric[i, i] == 0:
            raise InputError(f"kinetic: is not positive definite: {q[i]} moves no mass")
    linear = [parts.kinetic.subs(rest), *(sympy.diff(parts.kinetic, rate).subs(rest) for rate in v)]
    if metric.free_symbols & {*v} or any(sympy.simplify(term) != 0 for term in linear):
        raise InputError("kinetic: must be quadratic in the rates, with no other terms")
    loads = [sympy.Symbol(f"load_{k}", real=True) for k in range(len(parts.loads))]
    forces, inertia, gain = [], [], []
    potential = _by_terms(parts.potential, q)
    for i in range(n):
        lost = parts.forces[i] - sympy.diff(parts.dissipation, v[i])
        if _without_value(lost, rest):
            lost = sympy.powsimp(lost)  # x**n / x, as the slope of a power is written
            if _without_value(lost, rest):
                raise InputError(NO_DIRECTION)
        loaded = sum(f * moved[i] for f, (_, moved, _) in zip(loads, parts.loads, strict=True))
        forces.append(lost - sympy.diff(potential, q[i]) + loaded)
        pairs = [(j, k) for j in range(n) for k in range(n)]
        gain.append(sum(sympy.diff(metric[j, k], q[i]) * v[j] * v[k] for j, k in pairs) / 2)
        inertia.append(sum(sympy.diff(metric[i, j], q[k]) * v[j] * v[k] for j, k in pairs) - gain[i])
    return Equations(metric, forces, inertia, gain, loads, means=dict(zip(loads, means, strict=True)))


def _without_value(force: Any, rest: Mapping[Any, Any]) -> bool:
    """Whether it divides by rates where all are zero, as Coulomb's friction in a plane does."""
    return any(
        power.exp.is_negative and power.base.has(*rest) and sympy.expand(power.base.xreplace(rest)) == 0
        for power in sympy.sympify(force).atoms(sympy.Pow)
    )


def total_potential(parts: ElementParts, found: Equations, v: Sequence[Any]) -> Any:
    """U of springs, weights and loads at their means; None where forces are not known to have one.

    Forces that do no work whatever the rates, as gyroscopic ones, are zero at rest and change nothing.
    """
    means = [found.means[symbol] for symbol in found.loads]
    follows = any(acting.place is None and mean != 0 for acting, mean in zip(parts.loads, means, strict=True))
    power = sum(force * rate for force, rate in zip(parts.forces, v, strict=True))
    if follows or sympy.simplify(power) != 0:
        return None
    total = parts.potential
    for (_, _, place), mean in zip(parts.loads, means, strict=True):
        total -= 0 if mean == 0 else mean * place
    return total


def bounding_energy(parts: ElementParts, found: Equations, q: Sequence[Any], v: Sequence[Any]) -> Any:
    """T + U with that potential, or None."""
    total, n = total_potential(parts, found, v), len(q)
    if total is None:
        return None
    return sum(found.metric[i, j] * v[i] * v[j] for i in range(n) for j in range(n)) / 2 + total


def _by_terms(expression: Any, q: Sequence[Any]) -> Any:
    """Each term in the form that takes least to compute."""
    return sympy.Add(*(simplest(term, q) for term in sympy.Add.make_args(expression)))


def statics(
    parts: ElementParts,
    found: Equations,
    coordinates: tuple[Coordinate, ...],
    parameters: tuple[Any, ...],
    springs: tuple[tuple[Any, ...], ...],
) -> Statics:
    """Forces at rest, loads at their means.

    Whether they have a potential is asked of those alone that are not given by one.
    """
    q = [coordinate.symbol for coordinate in coordinates]
    v = [sympy.Symbol(f"{symbol}_dot", real=True) for symbol in q]
    at_rest = dict.fromkeys(v, 0) | found.means
    forces = tuple(sympy.sympify(force).subs(at_rest) for force in found.forces)
    acting = [(f, moved, place) for f, (_, moved, place) in zip(found.loads, parts.loads, strict=True)]
    other = []
    for i, (lost, rate) in enumerate(zip(parts.forces, v, strict=True)):
        following = sum(f * moved[i] for f, moved, place in acting if place is None)
        force = lost - sympy.diff(parts.dissipation, rate) + following
        other.append(sympy.sympify(force).subs(at_rest))
    pairs = [(i, j) for i in range(len(q)) for j in range(i)]
    curls = (simplest(sympy.diff(other[i], q[j]) - sympy.diff(other[j], q[i]), q) for i, j in pairs)
    conservative = all(curl.equals(0) is True for curl in curls)
    means = [(found.means[f], place) for f, _, place in acting if place is not None]
    stored = sympy.Add.make_args(parts.potential - sum(mean * place for mean, place in means if mean != 0))
    return Statics(
        coordinates, parameters, forces, conservative, springs=springs, stored=stored, other=tuple(other)
    )


class _Solver:
    """Lines that solve a x = r by elimination.

    Rows whose diagonal is constant come first: their multipliers need no division, and where one is left,
    there is one division in all.
    """

    def __init__(self, metric: Any, q: Sequence[Any]) -> None:
        self._metric, self._first = metric, list[int]()
        for i in range(metric.rows):
            if not metric[i, i].free_symbols & {*q} and not any(metric[i, j] != 0 for j in self._first):
                self._first.append(i)
        self._rest = [i for i in range(metric.rows) if i not in self._first]

    def outputs(self, r: Sequence[Any]) -> dict[str, Any]:
        """What the lines want by name, of a right side: rows of ``first`` come divided by their diagonal."""
        a, found = self._metric, {}
        for i in self._first:
            found[f"_r{i}"] = _divided(r[i], a[i, i])
            for j in self._rest:
                if a[j, i] != 0:
                    found[f"_a{j}_{i}"], found[f"_m{j}_{i}"] = a[j, i], _divided(a[j, i], a[i, i])
        for j in self._rest:
            found[f"_r{j}"] = r[j]
            found |= {f"_a{j}_{k}": a[j, k] for k in self._rest if k <= j and a[j, k] != 0}
        return found

    def lines(self) -> list[str]:
        """Lines that assign d0, d1, ..."""
        left, lines = list(self._rest), []
        known = {(j, k): f"_a{j}_{k}" for j in left for k in left if k <= j and self._metric[j, k] != 0}

        def reduce(i: int, j: int, k: int, multiplier: str, entry: str) -> None:
            before = f"{known[j, k]} - " if (j, k) in known else "-"
            lines.append(f"_b{j}_{k}_{i} = {before}{entry} * {multiplier}")
            known[j, k] = f"_b{j}_{k}_{i}"

        back = []
        for i in self._first:
            coupled = [j for j in left if self._metric[j, i] != 0]
            for j in coupled:
                lines.append(f"_r{j} = _r{j} - _a{j}_{i} * _r{i}")
                for k in coupled:
                    if k <= j:
                        reduce(i, j, k, f"_m{k}_{i}", f"_a{j}_{i}")
            back.append((i, f"_r{i}", [(f"_m{j}_{i}", j) for j in coupled]))
        while len(left) > 2 or (len(left) == 2 and (left[1], left[0]) not in known):
            i = left.pop(0)
            coupled = [j for j in left if (j, i) in known]
            lines.append(f"_inverse{i} = <<1.0>> / {known[i, i]}")
            for j in coupled:
                lines += [f"_m{j}_{i} = {known[j, i]} * _inverse{i}", f"_r{j} = _r{j} - _m{j}_{i} * _r{i}"]
                for k in coupled:
                    if k <= j:
                        reduce(i, j, k, f"_m{k}_{i}", known[j, i])
            back.append((i, f"_r{i} * _inverse{i}", [(f"_m{j}_{i}", j) for j in coupled]))
        if len(left) == 2:
            i, j = left
            a, b, c = known[i, i], known[j, i], known[j, j]
            lines += [
                f"_inverse{i} = <<1.0>> / ({a} * {c} - {b} * {b})",
                f"_d{i} = ({c} * _r{i} - {b} * _r{j}) * _inverse{i}",
                f"_d{j} = ({a} * _r{j} - {b} * _r{i}) * _inverse{i}",
            ]
        elif left:
            lines.append(f"_d{left[0]} = _r{left[0]} / {known[left[0], left[0]]}")
        for i, right, terms in reversed(back):
            lines.append(f"_d{i} = " + " - ".join([right, *(f"{m} * _d{j}" for m, j in terms)]))
        return lines


def _divided(expression: Any, by: Any) -> Any:
    """Each term over ``by``."""
    return sympy.Add(*(term / by for term in sympy.Add.make_args(sympy.sympify(expression))))


def derive(
    parts: ElementParts, found: Equations, q: Sequence[Any], v: Sequence[Any], parameters: Sequence[Any]
) -> Derived:
    """Write all functions of a mechanism."""
    n, t = len(q), sympy.Symbol("t", real=True)
    p = [sympy.Symbol(f"p_{symbol}", real=True) for symbol in q]
    coefficients = WrittenCoefficients([*q, *v, *p, t])

    def lifted(outputs: dict[str, Any]) -> dict[str, Any]:
        return {name: coefficients.lift(expanded(sympy.sympify(e), q)) for name, e in outputs.items()}

    values = [
        sympy.Function(f"function_{k}")(t) if isinstance(load, Sampled | Function) else load.expression(t)
        for k, (load, *_) in enumerate(parts.loads)
    ]
    acting = dict(zip(found.loads, values, strict=True))
    forces = [sympy.sympify(force).xreplace(acting) for force in found.forces]
    metric = found.metric.applyfunc(lambda entry: expanded(entry, q))
    solver = _Solver(metric, q)
    pairs = [(i, j) for i in range(n) for j in range(i + 1)]
    entries = {f"_a{i}_{j}": metric[i, j] for i, j in pairs}
    full = [[f"_a{max(i, j)}_{min(i, j)}" for j in range(n)] for i in range(n)]
    lagrange = lifted(solver.outputs([f - h for f, h in zip(forces, found.inertia, strict=True)]))
    velocities = lifted(solver.outputs(p))
    canonical = velocities | lifted(
        {f"_f{i}": f + g for i, (f, g) in enumerate(zip(forces, found.gain, strict=True))}
    )
    at_rest = dict.fromkeys(v, 0) | found.means
    slopes = {
        f"_{name}{i}_{j}": -sympy.diff(force, by[j]).subs(at_rest)
        for name, by in (("c", v), ("s", q)) for i, force in enumerate(found.forces) for j in range(n)
    }  # fmt: skip
    arms = [sum(x * rate for x, rate in zip(moved, v, strict=True)) for _, moved, _ in parts.loads]
    powers = {
        "_brought": sum(force * arm for force, arm in zip(values, arms, strict=True)),
        "_damped": sum(rate * sympy.diff(parts.dissipation, rate) for rate in v),
        "_taken": -sum(rate * force for rate, force in zip(v, parts.forces, strict=True)),
    }
    bounding = None  # it may have coefficients of its own, as those of a lasting force's place
    if (total := total_potential(parts, found, v)) is not None:
        bounding = lifted(entries | {"_U": _by_terms(total, q)})
    plain = {
        "momenta": ([*q, *v], lifted(entries)),
        "energies": ([*q, *v], lifted(entries | {"_U": _by_terms(parts.potential, q)})),
        "metric": (q, lifted(entries)),
        "velocities": ([*q, *p], velocities),
        "powers": ([t, *q, *v], lifted(powers)),
        "slopes": (q, lifted(slopes)),
    }
    kinetic = [f"<<{0.5 if i == j else 1.0}>> * {full[i][j]} * {v[i]} * {v[j]}" for i, j in pairs]
    momenta = (" + ".join(f"{full[i][j]} * {v[j]}" for j in range(n)) for i in range(n))
    after = {
        "momenta": [_tuple(momenta)],
        "energies": [_tuple([" + ".join(kinetic), "_U"])],
        "metric": [_tuple(full[i][j] for i in range(n) for j in range(n))],
        "velocities": [*solver.lines(), _tuple(f"_d{i}" for i in range(n))],
    }
    own = [symbol.name for symbol in coefficients.named.values()]
    texts = Texts(own)
    for name, (arguments, outputs) in plain.items():
        texts.plain(name, list(map(str, arguments)), outputs, *after.get(name, []))
    if bounding is not None:
        result = " + ".join([*kinetic, "_U"])
        texts.packed("bounding", list(map(str, [*q, *v])), bounding, f"({result},)")
    body, solved = StepBody(lagrange), [f"_d{i}" for i in range(n)]
    lines = [*body.text()[0], *solver.lines()]
    texts.motion("lagrange", list(map(str, [*q, *v])), body, lines, _tuple([*map(str, v), *solved]))
    body = StepBody(canonical)
    first, last = body.text([str(rate) for rate in v])
    rates = [f"{rate} = _d{i}" for i, rate in enumerate(v)]
    lines, result = [*first, *solver.lines(), *rates, *last], _tuple([*solved, *(f"_f{i}" for i in range(n))])
    texts.motion("hamilton", list(map(str, [*q, *p])), body, lines, result)
    texts.coefficients(list(map(str, parameters)), list(coefficients.named))
    return Derived(tuple(own), texts.written)


def _tuple(parts: Iterable[str]) -> str:
    return f"({', '.join(parts)},)"
