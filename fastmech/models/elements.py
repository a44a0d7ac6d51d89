"""What a mechanism is built from, the engineer's way, and the energies and forces that follow.

Points are expressions of the coordinates, by name or in place: two components [m] in a plane, or three.
"""

from __future__ import annotations

import sys
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import sympy

from fastmech.errors import InputError, shown
from fastmech.loads import Constant, Function, Load, Sampled
from fastmech.models.drawing import Element
from fastmech.models.writer import expanded, refuse_unknown, simplest


@dataclass(frozen=True)
class Body:
    """A rigid body: ``center`` of mass, a point; ``mass`` [kg]; ``inertia`` [kg m2]; ``angle`` [rad]."""

    center: Any
    mass: Any
    inertia: Any
    angle: Any


@dataclass(frozen=True)
class Spring:
    """A linear spring between points ``a`` and ``b``: ``stiffness`` [N/m], ``free_length`` [m]."""

    a: Any
    b: Any
    stiffness: Any
    free_length: Any = 0


@dataclass(frozen=True)
class TorsionSpring:
    """A spring on an ``angle`` or difference of two [rad]: ``stiffness`` [N m/rad], ``free_angle`` [rad]."""

    angle: Any
    stiffness: Any
    free_angle: Any = 0


@dataclass(frozen=True)
class Damper:
    """A viscous damper between points ``a`` and ``b``: ``coefficient`` [N s/m].

    It acts ``along`` a direction, not zero, or by default the line through both points.
    """

    a: Any
    b: Any
    coefficient: Any
    along: Any = None


@dataclass(frozen=True)
class TorsionDamper:
    """A damper on an ``angle`` or difference of two [rad]: ``coefficient`` [N m s/rad]."""

    angle: Any
    coefficient: Any


@dataclass(frozen=True)
class Force:
    """A ``load`` [N] on a ``point``: one of :mod:`fastmech.loads`, or a number or parameter, constant.

    Its ``direction`` is a unit vector of expressions, for all values of coordinates and parameters: its
    length is tried at random ones. One made of coordinates follows a body.
    """

    point: Any
    load: Any
    direction: Any


@dataclass(frozen=True)
class Torque:
    """A ``load`` [N m] on an ``angle`` [rad]: one of :mod:`fastmech.loads`, or a number or parameter."""

    angle: Any
    load: Any


class Acting(NamedTuple):
    """A load and what it acts on."""

    load: Load
    moved: tuple[Any, ...]  #: d(place along the load)/d(coordinate), one a coordinate
    place: Any  #: where it acts, along its direction [m], or the angle [rad]; None: it follows a body


class Piece(NamedTuple):
    """An element as it is drawn, and what it is beside that."""

    kind: Element
    size: Any  #: what it is zero with
    a: Any  #: one end; of an angle that
    b: Any
    beside: Mapping[str, Any] = {}  #: further expressions by what they are, none of them zero


class ElementParts(NamedTuple):
    """All that a mechanism's motion follows from, as SymPy expressions."""

    metric: Any  #: matrix of masses and bodies, T = a_ij q_i' q_j' / 2
    kinetic: Any  #: T beside that [J]
    potential: Any  #: U [J]
    dissipation: Any  #: Rayleigh's function, half the power that dampers take [W]
    forces: tuple[Any, ...]  #: generalized forces beside those, one a coordinate
    loads: tuple[Acting, ...]

    def put(self, values: Mapping[Any, Any]) -> ElementParts:
        """The same with values of some symbols."""
        loads = []
        for load, moved, place in self.loads:
            given = {k: v.xreplace(values) for k, v in vars(load).items() if isinstance(v, sympy.Expr)}
            put = None if place is None else place.xreplace(values)
            loads.append(Acting(replace(load, **given), tuple(x.xreplace(values) for x in moved), put))
        a, T, U, D = (sympy.sympify(part).xreplace(values) for part in self[:4])
        return ElementParts(a, T, U, D, tuple(x.xreplace(values) for x in self.forces), loads=tuple(loads))

    @property
    def finite(self) -> bool:
        """Whether no expression divides by zero."""
        loads = (part for acting in self.loads for part in (*vars(acting.load).values(), *acting.moved))
        parts = (*self[:4], *self.forces, *loads)
        told = (part for part in parts if isinstance(part, sympy.Basic | sympy.MatrixBase))
        return not any(part.has(sympy.zoo, sympy.nan) for part in told)


#: Units of loads' times; their other fields are forces or torques.
_UNITS = {"rate": "1/s", "frequency": "1/s", "phase": "1", "start": "s", "duration": "s"}


class Builder:
    """Reads elements; every message names the argument and the number of the element in it."""

    def __init__(
        self, q: Sequence[Any], rates: Sequence[Any], known: Mapping[str, Any], lengths: Collection[str]
    ) -> None:
        self._q, self._rates, self._known, self._lengths = q, rates, known, lengths
        self._points: dict[str, Any] = {}
        self.drawn: list[Piece] = []
        self.terms: list[tuple[str, str, Any]] = []  #: where each comes from, its unit, expression
        self.used: set[str] = set()  #: names of all symbols in what was given
        self.dissipation: tuple[Any, ...] = ()  #: Rayleigh's function as given, then dampers' coefficients

    def expression(self, where: str, given: Any, rates: bool = False) -> Any:
        """An expression in known symbols, of rates too where they may occur."""
        try:
            found = sympy.sympify(given, strict=not isinstance(given, str))
        except (sympy.SympifyError, TypeError, AttributeError):
            found = None
        if isinstance(given, str) or not isinstance(found, sympy.Expr) or found.is_Matrix:
            raise InputError(f"{where} = {shown(given)}: must be a number or a SymPy expression")
        swaps, allowed = {}, {*self._known, *(str(rate) for rate in self._rates if rates)}
        for symbol in found.free_symbols:
            if symbol.name not in allowed:
                raise InputError(
                    f"{where}: has the symbol {shown(symbol)}, which is neither a coordinate"
                    f"{', a rate' if rates else ''} nor a parameter"
                )
            self.used.add(symbol.name)
            swaps[symbol] = self._known.get(symbol.name, sympy.Symbol(symbol.name, real=True))
        found = found.xreplace(swaps)
        undefined = found.atoms(sympy.core.function.AppliedUndef)
        too_large = any(abs(number) > sys.float_info.max for number in found.atoms(sympy.Number))
        if undefined or too_large or found.has(sympy.I, sympy.nan, sympy.oo, sympy.zoo):
            raise InputError(f"{where} = {shown(given)}: must be a finite real expression")
        refuse_unknown(where, found)
        # SymPy takes what may be complex, as a root or logarithm, for complex in the slope of its modulus.
        found = found.replace(sympy.Abs, lambda x: sympy.Abs(x) if x.is_extended_real else sympy.Max(x, -x))
        return found.replace(  # of whole and half powers more is known than of others
            lambda x: x.is_Pow and x.exp.is_Float and float(2 * x.exp) in range(-32, 33),
            lambda x: x.base ** sympy.Rational(x.exp),
        )

    def angle(self, where: str, given: Any) -> Any:
        """An expression that is no length, or sum of some."""
        found = self.expression(where, given)
        terms = [term.as_coeff_Mul() for term in sympy.Add.make_args(found)]
        if all(abs(factor) == 1 and str(rest) in self._lengths for factor, rest in terms):
            raise InputError(f"{where} = {shown(given)}: is a length; must be an angle [rad]")
        return found

    def point(self, where: str, given: Any) -> Any:
        """A point by name, or its two or three components."""
        if isinstance(given, str):
            if given not in self._points:
                names = ", ".join(self._points) or "none"
                raise InputError(f"{where} = {shown(given)}: no such point; points are {names}")
            return self._points[given]
        parts = list(given) if isinstance(given, Sequence | sympy.MatrixBase) else []
        if len(parts) not in (2, 3):
            raise InputError(f"{where} = {shown(given)}: must be a point's name or two or three expressions")
        return sympy.Matrix([self.expression(where, part) for part in parts])

    def points(self, given: Any) -> dict[str, Any]:
        """Named points."""
        if not isinstance(given, Mapping) or not all(isinstance(name, str) and name for name in given):
            raise InputError(f"points = {shown(given)}: must map names to places")
        for name, place in given.items():
            given_place = tuple(place) if isinstance(place, list) else place
            self._points[name] = self.point(f"points.{name}", given_place)
        return self._points

    def parts(self, given: Mapping[str, Any]) -> ElementParts:
        """Energies and forces of everything together."""
        potential = self.expression("potential", given["potential"])
        kinetic = self.expression("kinetic", given["kinetic"], rates=True)
        dissipation = self.expression("dissipation", given["dissipation"], rates=True)
        if dissipation != 0 and not dissipation.free_symbols & {*self._rates}:
            raise InputError(f"dissipation = {shown(dissipation)}: must have rates, as c * x.dot**2 / 2")
        self.dissipation = (dissipation,)
        self.terms += [("kinetic", "J", kinetic), ("potential", "J", potential)]
        self.terms += [("dissipation", "W", dissipation)]
        gravity, metric = given["gravity"], sympy.zeros(len(self._q))
        for number, mass in enumerate(_masses(given["masses"])):
            where = f"masses[{number}]"
            center = self.point(where, mass.center)
            m, inertia = (self.expression(where, value) for value in (mass.mass, mass.inertia))
            angle = sympy.Matrix([self.angle(f"{where}.angle", mass.angle)])
            beside = {"moment of inertia": inertia, "on": angle[0]} if inertia != 0 else {}
            self.drawn.append(Piece(Element.MASS, m, center, center, beside))
            own = m * self._inertia(center) + inertia * self._inertia(angle)
            rates = sympy.Matrix(self._rates)
            self.terms.append((where, "J", (rates.T * own * rates)[0] / 2))
            metric += own
            if gravity is not None:
                weight = -m * self._gravity(gravity, len(center)).dot(center)
                self.terms.append((f"gravity on {where}", "J", weight))
                potential += weight
        for number, spring in enumerate(_all("springs", given["springs"], Spring, TorsionSpring)):
            free, stretch_square = self._stretch_square(f"springs[{number}]", spring)
            stiffness = self.expression(f"springs[{number}].stiffness", spring.stiffness)
            self._draw(Element.SPRING, stiffness, spring, free)
            stored = stiffness * stretch_square / 2
            self.terms.append((f"springs[{number}]{_ends(spring)}", "J", stored))
            potential += stored
        for number, damper in enumerate(_all("dampers", given["dampers"], Damper, TorsionDamper)):
            rate_square = self._rate_square(f"dampers[{number}]", damper)
            coefficient = self.expression(f"dampers[{number}].coefficient", damper.coefficient)
            self._draw(Element.DAMPER, coefficient, damper)
            self.dissipation += (coefficient,)
            taken = coefficient * rate_square / 2
            self.terms.append((f"dampers[{number}]{_ends(damper)}", "W", taken))
            dissipation += taken
        acting = enumerate(_all("forces", given["forces"], Force, Torque))
        loads = tuple(self._load(f"forces[{number}]", force) for number, force in acting)
        forces = self._generalized(given["generalized_forces"])
        return ElementParts(metric, kinetic, potential, dissipation, forces, loads=loads)

    def _draw(self, kind: Element, size: Any, element: Any, free: Any = 0) -> None:
        """Between its points, a damper along a direction to where that leads; on an angle the angle twice."""
        if isinstance(element, TorsionSpring | TorsionDamper):
            angle = sympy.Matrix([self.expression("angle", element.angle), 0])
            turning = Element.TORSION_SPRING if kind is Element.SPRING else Element.TORSION_DAMPER
            self.drawn.append(Piece(turning, size, angle, angle, {"free angle": free} if free != 0 else {}))
            return
        a, b = self.point("a", element.a), self.point("b", element.b)
        if kind is Element.DAMPER and element.along is not None:
            along = self.point("along", element.along)
            a = b + along * (a - b).dot(along) / along.dot(along)
        self.drawn.append(Piece(kind, size, a, b, {"free length": free} if free != 0 else {}))

    def _inertia(self, place: Any) -> Any:
        """Metric of a unit mass, or of a unit of inertia, at a place."""
        moved = place.jacobian(sympy.Matrix(self._q))
        return (moved.T * moved).applyfunc(lambda entry: simplest(entry, self._q))

    def _generalized(self, given: Any) -> tuple[Any, ...]:
        if not isinstance(given, Mapping):
            raise InputError(f"generalized_forces = {shown(given)}: must map coordinates to expressions")
        named = {str(name): value for name, value in given.items()}
        for name in named.keys() - {str(q) for q in self._q}:
            raise InputError(f"generalized_forces: {shown(name)} is no coordinate")
        found = []
        for q, rate in zip(self._q, self._rates, strict=True):
            where = f"generalized_forces[{q}]"
            found.append(self.expression(where, named.get(str(q), 0), rates=True))
            self.terms.append((f"{where} * {rate}", "W", found[-1] * rate))
        return tuple(found)

    def _gravity(self, given: Any, components: int) -> Any:
        """The vector of gravity: a number g pulls along -y in a plane, along -z in space."""
        if isinstance(given, Sequence) and not isinstance(given, str):
            return self._fitting("gravity", self.point("gravity", given), components)
        return sympy.Matrix([*[0] * (components - 1), -self.expression("gravity", given)])

    def _fitting(self, where: str, vector: Any, components: int) -> Any:
        if len(vector) != components:
            raise InputError(f"{where}: has {len(vector)} components, must have the points' {components}")
        return vector

    def _between(self, where: str, a: Any, b: Any) -> Any:
        first = self.point(f"{where}.a", a)
        between = self._fitting(f"{where}.b", self.point(f"{where}.b", b), len(first)) - first
        if between.applyfunc(lambda part: simplest(part, self._q)).is_zero_matrix:
            raise InputError(f"{where}.b = {shown(b)}: must be another point than a")
        return between

    def _stretch_square(self, where: str, spring: Any) -> tuple[Any, Any]:
        """A spring's free length or angle, and the square of what it is stretched by."""
        if isinstance(spring, TorsionSpring):
            angle = self.angle(f"{where}.angle", spring.angle)
            free = self.expression(where, spring.free_angle)
            return free, (angle - free) ** 2
        between = self._between(where, spring.a, spring.b)
        square = between.dot(between)
        free = self.expression(f"{where}.free_length", spring.free_length)
        if free == 0:
            return free, simplest(square, self._q)
        return free, (sympy.sqrt(expanded(square, self._q)) - free) ** 2

    def _rate_square(self, where: str, damper: Any) -> Any:
        if isinstance(damper, TorsionDamper):
            return self._rate(self.angle(f"{where}.angle", damper.angle)) ** 2
        between = self._between(where, damper.a, damper.b)
        if damper.along is not None:
            direction = self.point(f"{where}.along", damper.along)
            self._fitting(f"{where}.along", direction, len(between))
            if direction.is_zero_matrix:
                raise InputError(f"{where}.along = {shown(damper.along)}: must not be zero")
            return self._velocity(between).dot(direction) ** 2 / direction.dot(direction)
        return between.dot(self._velocity(between)) ** 2 / simplest(between.dot(between), self._q)

    def _load(self, where: str, force: Any) -> Acting:
        load = force.load
        if not isinstance(load, Load):
            load = Constant(self.expression(f"{where}.load", load))
        if not isinstance(load, Sampled | Function):
            changed = {}
            for name, value in vars(load).items():
                changed[name] = found = self.expression(f"{where}.load.{name}", value)
                if found.free_symbols & {*self._q}:
                    raise InputError(f"{where}.load.{name}: depends on a coordinate; a load depends on time")
                if found.free_symbols:  # of a plain number the unit is known
                    told = _UNITS.get(name, "N m" if isinstance(force, Torque) else "N")
                    self.terms.append((f"{where}.load.{name}", told, found))
            load = type(load)(**changed)
        if isinstance(force, Torque):
            place = self.angle(f"{where}.angle", force.angle)
            self.terms.append((f"{where}.angle", "rad", place))
            return Acting(load, tuple(sympy.diff(place, q) for q in self._q), place)
        point = self.point(f"{where}.point", force.point)
        direction = self.point(f"{where}.direction", force.direction)
        direction = self._fitting(f"{where}.direction", direction, len(point))
        if not _has_length_one(direction):
            raise InputError(f"{where}.direction = {shown(force.direction)}: must be a unit vector")
        moved = tuple(simplest(point.diff(q).dot(direction), self._q) for q in self._q)
        arm = sum(x * rate for x, rate in zip(moved, self._rates, strict=True))
        self.terms.append((f"{where}.point", "m/s", arm))
        fixed = not direction.free_symbols & {*self._q}
        self.drawn.append(Piece(Element.LOAD, load, point, point + direction))
        return Acting(load, moved, point.dot(direction) if fixed else None)

    def _velocity(self, place: Any) -> Any:
        return sum((place.diff(q) * rate for q, rate in zip(self._q, self._rates, strict=True)), 0 * place)

    def _rate(self, angle: Any) -> Any:
        return sum(sympy.diff(angle, q) * rate for q, rate in zip(self._q, self._rates, strict=True))


def _has_length_one(vector: Any) -> bool:
    """Whether it has wherever it is a number, for 1000 random values of all its symbols, to rounding."""
    square, random = vector.dot(vector), np.random.default_rng(0)
    symbols = sorted(square.free_symbols, key=str)
    values = random.normal(size=(len(symbols), 1000)) * 10.0 ** random.uniform(-1.0, 1.0, 1000)
    with np.errstate(all="ignore"):
        found = np.asarray(sympy.lambdify(symbols, square)(*values), dtype=np.float64)
    known = np.isfinite(found)
    return bool(known.any() and (abs(found[known] - 1.0) < 1e-10).all())


def _ends(element: Any) -> str:
    """The points that an element joins, in brackets."""
    return f" ({element.a}-{element.b})" if hasattr(element, "a") else ""


def _masses(given: Any) -> list[Body]:
    """Mass points by point's name, and bodies."""
    if isinstance(given, Mapping):
        given = list(given.items())
    each = _all("masses", given, Body, tuple)
    return [one if isinstance(one, Body) else Body(one[0], one[1], 0, 0) for one in each]


def _all(field: str, given: Any, *kinds: type) -> list[Any]:
    """A list of elements of these kinds."""
    if not isinstance(given, Sequence) or isinstance(given, str):
        raise InputError(f"{field} = {shown(given)}: must be a list")
    for number, element in enumerate(given):
        if not isinstance(element, kinds) or (isinstance(element, tuple) and len(element) != 2):
            told = " or ".join("(point, mass)" if kind is tuple else kind.__name__ for kind in kinds)
            raise InputError(f"{field}[{number}] = {shown(element)}: must be a {told}")
    return list(given)
